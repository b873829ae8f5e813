//! How PX4 1.9 finds the rate of a receiver's line.
//!
//! *Design.* With `SER_GPS1_BAUD` at *Auto* the driver tries [`RATES`] in turn, configures the receiver at
//! each, and stays where it gets NAV-PVT (PX4-GPSDrivers, `src/ubx.cpp`; Shim, Joo and Kim 2021, section 2.1.2).
//!
//! *Limits.* The time for each rate is 2 s whatever the receiver answers. A receiver that is lost later is not
//! searched again.

use timebase::{CORE_HZ, Cycles};

/// The rates, in PX4's order. \[Bd\]
pub const RATES: [u32; 5] = [38_400, 57_600, 9_600, 115_200, 230_400];

/// From rate to rate, in cycles: 2 s.
const EACH: u64 = 2 * CORE_HZ as u64;

/// The search for the rate; it begins with the first [`Self::poll`].
#[derive(Clone, Copy, Debug, Default)]
pub struct RateSearch {
    /// Rates that were tried.
    tried: usize,
    /// When the next is due.
    due: Cycles,
    is_over: bool,
}

impl RateSearch {
    /// A search that has not begun.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            tried: 0,
            due: Cycles::BOOT,
            is_over: false,
        }
    }

    /// The rate to be tried from now on, if it changes. \[Bd\]
    pub fn poll(&mut self, now: Cycles) -> Option<u32> {
        if self.is_over || now < self.due {
            return None;
        }
        let rate = RATES.iter().cycle().nth(self.tried % RATES.len()).copied();
        self.tried = self.tried.wrapping_add(1);
        self.due = now.plus(EACH);
        rate
    }

    /// A NAV-PVT has come: the search is over.
    pub const fn handle_nav_pvt(&mut self) {
        self.is_over = true;
    }

    /// When to call [`Self::poll`] again; `None` when it is over.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Cycles> {
        (!self.is_over).then_some(self.due)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rate_has_its_two_seconds_until_a_nav_pvt_comes() {
        let mut search = RateSearch::new();
        let mut now = Cycles::from_micros(300);
        for round in 0..2 {
            for rate in RATES {
                assert_eq!(search.poll(now), Some(rate), "round {round}");
                assert_eq!(search.poll(now), None);
                let due = search.poll_timeout().unwrap();
                assert_eq!(due.since(now), 2 * i64::from(CORE_HZ));
                assert_eq!(search.poll(Cycles(due.0 - 1)), None);
                now = due;
            }
        }
        search.handle_nav_pvt();
        assert_eq!(search.poll_timeout(), None);
        assert_eq!(search.poll(now.plus(100 * EACH)), None);
    }
}
