//! PX4's mapper: a leaky maximum of UTC less arrival.
//!
//! *Source.* PX4, `UtcToHrtMapper` (2026): lateness only ever lowers UTC less
//! arrival, so the largest one is the best; it leaks at the worst drift of a
//! crystal, and a fall by more than a stall's worth begins anew.
//!
//! *Left out.* It maps the epochs of samples for the estimator and keeps those
//! between the last one and the arrival; the wall clock itself is not set from it.
//! Here the offset is published as if it were. Their count is in µs, this in ns.

use super::baseline::Baseline;

/// `kMaxClockDriftPpm`: the leak.
const LEAK_PPM: i64 = 100;
/// `kUtcDiscontinuityResetUs`. \[ns\]
const RESET_NS: i64 = 100_000_000;

/// The leaky maximum.
#[derive(Clone, Copy, Debug, Default)]
pub struct Px4 {
    /// UTC less nominal time, and when it was last updated.
    state: Option<(i64, i64)>,
}

impl Baseline for Px4 {
    fn handle_mark(&mut self, local_ns: i64, epoch_utc_ns: i64) {
        let offset = epoch_utc_ns - local_ns;
        let offset_ns = match self.state {
            Some((offset_ns, then)) if offset >= offset_ns - RESET_NS => {
                let leak = (local_ns - then).max(0) * LEAK_PPM / 1_000_000;
                offset.max(offset_ns - leak)
            }
            _ => offset,
        };
        self.state = Some((offset_ns, local_ns));
    }

    fn utc_ns(&self, local_ns: i64) -> Option<i64> {
        let (offset_ns, _) = self.state?;
        Some(local_ns + offset_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    #[test]
    fn the_least_late_leaks_at_100_ppm_and_a_stall_begins_anew() {
        let mut clock = Px4::default();
        clock.handle_mark(0, 0);
        clock.handle_mark(SECOND + 30_000_000, SECOND);
        // 1.03 s of leak.
        assert_eq!(clock.utc_ns(2 * SECOND), Some(2 * SECOND - 103_000));
        clock.handle_mark(2 * SECOND + 110_000_000, 2 * SECOND);
        assert_eq!(clock.utc_ns(3 * SECOND), Some(3 * SECOND - 110_000_000));
        // And up again at once.
        clock.handle_mark(3 * SECOND, 3 * SECOND);
        assert_eq!(clock.utc_ns(3 * SECOND), Some(3 * SECOND));
    }
}
