//! Time Stamps: milliseconds since 2000 in 40 bits.

/// 2000-01-01 00:00:00 UTC as Unix time. \[ms\]
const UNIX_MS_2000: i64 = 946_684_800_000;
/// Where 40 bits wrap: 34.8 years, the first time in November 2034. \[ms\]
const WRAP_MS: i64 = 1 << 40;
const NS_PER_MS: i64 = 1_000_000;

/// A Time Stamp: whole milliseconds since 2000-01-01 00:00 UTC, without leap seconds, modulo 2⁴⁰.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeStamp {
    /// Below 2⁴⁰. \[ms\]
    pub ms: u64,
    /// What is left of the millisecond, below 1 000 000: the standard has no field for it. \[ns\]
    pub fraction_ns: u32,
}

impl TimeStamp {
    /// The stamp of a time since 1970. \[ns\]
    #[must_use]
    pub const fn from_unix_ns(unix_ns: i64) -> Self {
        let ms = unix_ns.div_euclid(NS_PER_MS) - UNIX_MS_2000;
        Self {
            ms: ms.rem_euclid(WRAP_MS) as u64,
            fraction_ns: unix_ns.rem_euclid(NS_PER_MS) as u32,
        }
    }

    /// The time since 1970 that it means: of all that it could, the nearest to `near_unix_ns`. \[ns\]
    ///
    /// `None` when that is beyond what 64 bits hold.
    #[must_use]
    pub const fn unix_ns(self, near_unix_ns: i64) -> Option<i64> {
        let near_ms = near_unix_ns.div_euclid(NS_PER_MS) - UNIX_MS_2000;
        let apart = (self.ms as i64).wrapping_sub(near_ms).rem_euclid(WRAP_MS);
        let apart = if apart >= WRAP_MS / 2 {
            apart - WRAP_MS
        } else {
            apart
        };
        let ms = near_ms + apart + UNIX_MS_2000;
        match ms.checked_mul(NS_PER_MS) {
            Some(ns) => ns.checked_add(self.fraction_ns as i64),
            None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_of_known_times() {
        for (unix_ms, stamp_ms) in [
            (946_684_800_000, 0),
            (1_483_228_799_999, 536_543_999_999),
            (1_483_228_800_000, 536_544_000_000),
            (1_795_848_000_123, 849_163_200_123),
            (2_046_196_427_775, (1 << 40) - 1),
            (2_046_196_427_776, 0),
            (946_684_799_999, (1 << 40) - 1),
        ] {
            let unix_ns = unix_ms * NS_PER_MS + 456_789;
            let stamp = TimeStamp::from_unix_ns(unix_ns);
            assert_eq!((stamp.ms, stamp.fraction_ns), (stamp_ms, 456_789));
            // Whatever the reader's clock is off by, below 17 years.
            for off_s in [0, 500_000_000, -500_000_000] {
                let near = unix_ns + off_s * 1_000_000_000;
                assert_eq!(stamp.unix_ns(near), Some(unix_ns));
            }
        }
    }

    #[test]
    fn no_time_is_too_far_for_an_answer() {
        let greatest = TimeStamp {
            ms: (1 << 40) - 1,
            fraction_ns: 999_999,
        };
        for near in [i64::MIN, i64::MAX, 0] {
            if let Some(found) = greatest.unix_ns(near) {
                assert!(found.abs_diff(near) <= (WRAP_MS / 2 * NS_PER_MS).unsigned_abs());
            }
        }
    }
}
