//! The units of this crate.
//!
//! *Purpose.* [`UtcNanos`], an instant of UTC, and [`Ppb`], a rate.
//!
//! *Design.* POSIX's scale: a day has 86 400 s and a leap second shares its
//! number with the second that follows, so differences need no table.
//!
//! *Limits.* `i64` ns reach from 1677 to 2262; the calendar knows 1980 to 2100.

use timebase::divide;

/// Nanoseconds of UTC since 1970-01-01T00:00:00Z, leap seconds not counted.
///
/// Shown in the manner of ISO 8601 with nanoseconds, or with as many decimals
/// as the format's precision says: `{:.6}` shows µs. An instant outside of
/// 1980 to 2100 is shown as a number of ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UtcNanos(pub i64);

impl UtcNanos {
    /// `self` and `ns` nanoseconds more; stops at the ends of the scale.
    #[must_use]
    #[inline]
    pub const fn plus_nanos(self, ns: i64) -> Self {
        Self(self.0.saturating_add(ns))
    }

    /// Nanoseconds from `earlier` to `self`, negative when `self` is the earlier
    /// one; stops at the ends of the scale.
    #[must_use]
    #[inline]
    pub const fn since(self, earlier: Self) -> i64 {
        self.0.saturating_sub(earlier.0)
    }

    /// Whole microseconds since 1970, rounded down: what MAVLink carries. An
    /// instant before 1970 is 0.
    #[must_use]
    #[inline]
    pub const fn as_micros(self) -> u64 {
        divide::<1_000>(if self.0 < 0 {
            0
        } else {
            self.0.cast_unsigned()
        })
    }
}

/// A rate or its error in parts in 10⁹: 1 ppb is 1 ns a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ppb(pub i32);

impl Ppb {
    /// `ppm` parts in 10⁶; stops at the ends of the scale.
    #[must_use]
    pub const fn from_ppm(ppm: i32) -> Self {
        Self(ppm.saturating_mul(1_000))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn micros_are_the_quotient() {
        for ns in [0, 1, 999, 1_000, 1_451_606_400_000_000_000, i64::MAX] {
            for near in [ns, ns.saturating_add(999), ns - 1] {
                let expected = u64::try_from(near / 1_000).unwrap_or(0);
                assert_eq!(UtcNanos(near).as_micros(), expected, "{near}");
            }
        }
        assert_eq!(UtcNanos(i64::MIN).as_micros(), 0);
    }
}
