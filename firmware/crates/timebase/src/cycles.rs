//! The unit of time since boot, and its conversions.
//!
//! *Purpose.* [`Cycles`]: a 64-bit count of core clock cycles since boot. One is 5.95 ns, and the
//! count lasts for 3 480 years.
//!
//! *Design.* Conversions to ns and µs are exact and do not divide ([`divide`]). An interrupt that
//! must be short takes a 32-bit [`Stamp`], the low word; the task that reads its ring extends it.
//!
//! *Limits.* The conversions assume exactly [`CORE_HZ`]. The UTC clock corrects for what the
//! crystal really does.

use crate::division::divide;

/// The core clock of the Pixhawk 1, in Hz: 24 MHz crystal, PLL M = 24, N = 336, P = 2
/// (PX4 `boards/px4/fmu-v2`, `board.h`).
pub const CORE_HZ: u32 = 168_000_000;

/// Core cycles in a µs, exactly.
pub(crate) const CYCLES_PER_US: u64 = CORE_HZ as u64 / 1_000_000;

/// Time since boot, in cycles of the core clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cycles(pub u64);

impl Cycles {
    /// The moment at which the time driver started.
    pub const BOOT: Self = Self(0);

    /// Whole µs since boot, rounded down.
    #[must_use]
    #[inline]
    pub const fn as_micros(self) -> u64 {
        divide::<CYCLES_PER_US>(self.0)
    }

    /// ns since boot, rounded down; stops at `u64::MAX` after 584 years.
    #[must_use]
    #[inline]
    pub const fn as_nanos(self) -> u64 {
        let whole = self.as_micros();
        // Less than a µs is left over, so the rest is 32-bit arithmetic.
        let rest = (self.0.wrapping_sub(whole.wrapping_mul(CYCLES_PER_US))) as u32;
        whole
            .saturating_mul(1_000)
            .saturating_add((rest * 125 / 21) as u64)
    }

    /// The first cycle that is not earlier than `us` µs after boot; stops at
    /// `u64::MAX`.
    #[must_use]
    #[inline]
    pub const fn from_micros(us: u64) -> Self {
        Self(us.saturating_mul(CYCLES_PER_US))
    }

    /// The first cycle that is not earlier than `ns` ns after boot; stops at
    /// `u64::MAX`. For set-up and tests: it divides.
    #[must_use]
    pub const fn from_nanos(ns: u64) -> Self {
        let cycles = (ns as u128 * 21).div_ceil(125);
        Self(if cycles > u64::MAX as u128 {
            u64::MAX
        } else {
            cycles as u64
        })
    }

    /// Cycles from `earlier` to `self`; negative when `self` is the earlier one.
    #[must_use]
    #[inline]
    pub const fn since(self, earlier: Self) -> i64 {
        self.0.wrapping_sub(earlier.0).cast_signed()
    }

    /// The low word, for comparison with a [`Stamp`].
    #[must_use]
    #[inline]
    pub const fn stamp(self) -> Stamp {
        Stamp(self.0 as u32)
    }

    /// `self` and `cycles` more; stops at `u64::MAX`.
    #[must_use]
    #[inline]
    pub const fn plus(self, cycles: u64) -> Self {
        Self(self.0.saturating_add(cycles))
    }
}

/// The low 32 bits of [`Cycles`], which an interrupt gives to a byte.
///
/// It is unambiguous for 25.5 s, so it has to be extended before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Stamp(pub u32);

impl Stamp {
    /// The full time of a stamp that was taken at most 25.5 s before `now`.
    #[must_use]
    #[inline]
    pub const fn extend(self, now: Cycles) -> Cycles {
        let age = (now.0 as u32).wrapping_sub(self.0);
        Cycles(now.0.saturating_sub(age as u64))
    }
}

/// One byte of a serial line, with the stamp that its interrupt gave it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StampedByte {
    /// When the byte had arrived.
    pub stamp: Stamp,
    /// The byte.
    pub byte: u8,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both ends, every carry of the wide multiplication, and what lies between.
    fn samples() -> impl Iterator<Item = u64> {
        let edges = (0..64).flat_map(|bit| {
            let edge = 1_u64 << bit;
            [edge - 1, edge, edge + 1]
        });
        let mut state = 1_u64;
        let scattered = (0..100_000).map(move |_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            state >> (state % 61)
        });
        edges.chain(scattered).chain([u64::MAX])
    }

    #[test]
    fn micros_are_the_floor_of_a_division() {
        for cycles in samples() {
            assert_eq!(Cycles(cycles).as_micros(), cycles / 168, "{cycles}");
        }
    }

    #[test]
    fn nanos_are_the_floor_of_a_division() {
        for cycles in samples() {
            let exact = u128::from(cycles) * 125 / 21;
            let expected = u64::try_from(exact).unwrap_or(u64::MAX);
            assert_eq!(Cycles(cycles).as_nanos(), expected, "{cycles}");
        }
    }

    #[test]
    fn from_micros_and_nanos_are_never_early() {
        for value in samples().map(|value| value >> 12) {
            assert_eq!(Cycles::from_micros(value).as_micros(), value);
            let cycles = Cycles::from_nanos(value);
            assert!(cycles.as_nanos() >= value);
            assert!(cycles.0 == 0 || Cycles(cycles.0 - 1).as_nanos() < value);
        }
        assert_eq!(Cycles::from_micros(u64::MAX), Cycles(u64::MAX));
        assert_eq!(Cycles::from_nanos(u64::MAX).as_nanos(), u64::MAX);
    }

    #[test]
    fn a_stamp_is_extended_across_the_wrap_of_its_word() {
        let now = Cycles(0x2_0000_0005);
        assert_eq!(
            Cycles(0x1_ffff_fff0).stamp().extend(now),
            Cycles(0x1_ffff_fff0)
        );
        assert_eq!(now.stamp().extend(now), now);
        assert_eq!(Cycles(7).since(Cycles(9)), -2);
    }
}
