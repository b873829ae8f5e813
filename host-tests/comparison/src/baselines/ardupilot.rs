//! ArduPilot's filter: the least lag of 100 messages.
//!
//! *Source.* ArduPilot, `libraries/AP_RTC/JitterCorrection.{h,cpp}`: a smaller lag
//! than the one assumed is taken over at once, one that is larger by more than
//! `max_lag_ms` at the cap; and the least of each 100 messages replaces whatever
//! is assumed, so that a drift is followed.
//!
//! *Left out.* `AP_RTC` allows the clock that is set from it to go forward only,
//! and does not set it while armed; and arrivals are seen on a polling grid of
//! 20 ms. Their count is in µs, this in ns.

use super::baseline::Baseline;

/// `max_lag_ms`. \[ns\]
const MAX_LAG_NS: i64 = 500_000_000;
/// `convergence_loops`.
const LOOPS: u16 = 100;

/// The minimum filter.
#[derive(Clone, Copy, Debug, Default)]
pub struct ArduPilot {
    /// Nominal time less UTC.
    lag_ns: Option<i64>,
    least_ns: i64,
    received: u16,
}

impl Baseline for ArduPilot {
    fn handle_mark(&mut self, local_ns: i64, epoch_utc_ns: i64) {
        let lag_ns = local_ns - epoch_utc_ns;
        let assumed = self.lag_ns.map_or(lag_ns, |lag| lag.min(lag_ns));
        self.lag_ns = Some(assumed.max(lag_ns - MAX_LAG_NS));

        self.least_ns = if self.received == 0 {
            lag_ns
        } else {
            self.least_ns.min(lag_ns)
        };
        self.received += 1;
        if self.received == LOOPS {
            self.lag_ns = Some(self.least_ns);
            self.received = 0;
        }
    }

    fn utc_ns(&self, local_ns: i64) -> Option<i64> {
        Some(local_ns - self.lag_ns?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// What it publishes after messages with these lags, 200 ms apart. \[ms\]
    fn lag_after(lags_ms: impl IntoIterator<Item = i64>) -> i64 {
        let mut clock = ArduPilot::default();
        for (number, lag) in (0..).zip(lags_ms) {
            let epoch = number * 200 * MS;
            clock.handle_mark(epoch + lag * MS, epoch);
        }
        -clock.utc_ns(0).unwrap() / MS
    }

    #[test]
    fn the_least_lag_holds_until_the_hundredth_message() {
        assert_eq!(lag_after([50, 30, 70]), 30);
        let drifted = |length| (0..length).map(|i| if i == 0 { 10 } else { 40 });
        assert_eq!(lag_after(drifted(199)), 10);
        assert_eq!(lag_after(drifted(200)), 40);
    }

    #[test]
    fn a_stall_beyond_the_cap_drags_it_along() {
        assert_eq!(lag_after([40, 40, 1_600]), 1_100);
        assert_eq!(lag_after([40, 40, 1_600, 41]), 41);
    }
}
