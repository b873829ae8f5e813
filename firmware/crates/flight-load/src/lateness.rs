//! How late interrupts come: PX4's histogram, and one of our own to hold beside it.

/// The upper bounds of the buckets: PX4's, of which those up to 5 µs are one here. \[µs\]
pub const BOUNDS_US: [u32; 6] = [5, 10, 20, 50, 100, 1_000];

/// PX4's `perf latency` in 2019, before PX4-Autopilot#12718, in these buckets and beyond them.
pub const PX4_BEFORE: Lateness = Lateness([
    222_732 + 13_251 + 14_411,
    14_074,
    10_630,
    5_480,
    4_458,
    7_012,
    0,
]);

/// The same after it.
pub const PX4_AFTER: Lateness = Lateness([239_788 + 12_847 + 14_937, 11_059, 8_494, 613, 0, 0, 1]);

/// Events by how late they came: one number for each of [`BOUNDS_US`], and those beyond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lateness(pub [u32; 7]);

impl Lateness {
    /// The bucket of an event that came this late, in µs; a begun µs counts.
    #[must_use]
    pub fn bucket(late_us: u32) -> usize {
        BOUNDS_US.partition_point(|&bound_us| bound_us < late_us)
    }

    /// All events.
    #[must_use]
    pub fn events(&self) -> u32 {
        self.0
            .iter()
            .fold(0, |sum, count| sum.saturating_add(*count))
    }

    /// The share of all events in each bucket.
    #[must_use]
    pub fn shares(&self) -> [f64; 7] {
        let all = f64::from(self.events().max(1));
        self.0.map(|count| f64::from(count) / all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bucket_holds_its_bound() {
        for (late_us, bucket) in [(0, 0), (5, 0), (6, 1), (100, 4), (1_000, 5), (1_001, 6)] {
            assert_eq!(Lateness::bucket(late_us), bucket, "{late_us}");
        }
        assert_eq!(PX4_BEFORE.events(), 292_048);
        // As the issue that reports it says: 3.9 % came more than 50 µs late.
        let late: f64 = PX4_BEFORE.shares().iter().skip(4).sum();
        assert!((late - 0.039).abs() < 0.0005, "{late}");
        assert_eq!(Lateness::default().shares(), [0.0; 7]);
    }
}
