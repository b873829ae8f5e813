//! The affine model: UTC as a function of the cycles since boot.
//!
//! *Purpose.* `utc = base + ((cycles − at) · mult >> 28)`: the base time and the
//! elapsed time, with the elapsed part read to one cycle and its rate corrected.
//!
//! *Design.* As in Linux's timekeeper, steering changes nothing but `mult`. The
//! fraction of a nanosecond at `at` is part of the model, so rebasing it
//! draws the very same line from a later origin: no reading changes, however
//! often it is done. `mult` is 1.6 · 10⁹, one unit of it 0.6 ppb, and below 2³¹,
//! so that within 2³² cycles (25.5 s) of `at` the product and the fraction fit
//! 64 bits: one `umlal`. It is above 2²⁸ as well, more than a nanosecond a
//! cycle: a model is strictly increasing by construction.
//!
//! An unset clock counts from 1970 as if the board had been started then: its
//! readings are the time since boot, by the same formula.
//!
//! *Limits.* Rates within ±[`MAX_RATE`]. Farther than 25.5 s from `at` a reading
//! is still exact but takes two multiplications more; farther than 1.8 h its
//! uncertainty is rounded up by a tenth of a second's growth.

use timebase::{CORE_HZ, ClockState, Cycles};

use crate::utc::{Ppb, UtcNanos};

/// Bits of `mult` behind the binary point.
pub(crate) const SHIFT: u32 = 28;
/// The uncertainty of a clock whose second is not proved is kept in units of 2²⁹ ns.
const COARSE_BITS: u32 = 29;
const FRACTION: u64 = (1 << SHIFT) - 1;

/// The largest rate correction, in either direction: a crystal beyond ±2 000 ppm
/// is broken, the slew takes up to 400 ppm, and 100 ppm are to spare.
const MAX_RATE: Ppb = Ppb::from_ppm(2_500);

/// The clock at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The instant; the time since boot while the clock is unset.
    pub utc: UtcNanos,
    /// The state of the clock then.
    pub state: ClockState,
    /// How far UTC may be from it, in ns to either side; `u64::MAX` for an unset clock.
    pub uncertainty_ns: u64,
    /// The count of leap seconds in it came from the sky.
    pub leap_seconds_known: bool,
}

/// A straight piece of the clock's time line, with its quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockModel {
    pub(crate) at: Cycles,
    pub(crate) base: UtcNanos,
    /// What `base` lacks. [2⁻²⁸ ns]
    pub(crate) fraction: u32,
    /// The rate. [2⁻²⁸ ns a cycle]
    pub(crate) mult: u32,
    pub(crate) quality: Quality,
}

/// How good a model is; set by the clock, carried by the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Quality {
    pub(crate) state: ClockState,
    pub(crate) leap_seconds_known: bool,
    /// Half the width of the interval that holds UTC at `at`, in ns. Below 2³² ns for a
    /// clock whose second is proved, and below 2⁶¹ for one whose second is not.
    pub(crate) uncertainty_ns: u64,
    /// By how much it widens, in 2⁻³² ns a cycle; below 2²⁹.
    pub(crate) growth: u32,
}

impl ClockModel {
    /// The model of an unset clock: the time since boot.
    pub const BOOT: Self = Self {
        at: Cycles::BOOT,
        base: UtcNanos(0),
        fraction: 0,
        mult: mult(Ppb(0)),
        quality: Quality {
            state: ClockState::Unset,
            leap_seconds_known: false,
            uncertainty_ns: u64::MAX,
            growth: 0,
        },
    };

    /// Where this piece of the line begins.
    #[must_use]
    pub const fn at(&self) -> Cycles {
        self.at
    }

    /// UTC at `when`, before or after `at`, however far.
    #[must_use]
    #[inline]
    pub const fn utc_at(&self, when: Cycles) -> UtcNanos {
        self.point(when).0
    }

    /// The whole reading at `when`.
    #[must_use]
    pub const fn reading_at(&self, when: Cycles) -> Reading {
        Reading {
            utc: self.utc_at(when),
            state: self.quality.state,
            uncertainty_ns: self.uncertainty_at(when),
            leap_seconds_known: self.quality.leap_seconds_known,
        }
    }

    /// The same line with its origin at `at`; what its uncertainty is there is for others to say.
    #[must_use]
    #[inline]
    pub(crate) const fn rebased(&self, at: Cycles) -> Self {
        let (base, fraction) = self.point(at);
        Self {
            at,
            base,
            fraction,
            ..*self
        }
    }

    /// The model as eight words, the six that a reading of UTC needs first.
    pub(crate) const fn words(&self) -> [u32; 8] {
        let quality = &self.quality;
        [
            self.at.0 as u32,
            (self.at.0 >> 32) as u32,
            self.base.0 as u32,
            (self.base.0 >> 32) as u32,
            self.fraction,
            self.mult,
            coarse_uncertainty(quality),
            quality.growth << 3 | (quality.leap_seconds_known as u32) << 2 | quality.state.bits(),
        ]
    }

    /// The inverse of [`Self::words`].
    pub(crate) const fn from_words(words: [u32; 8]) -> Self {
        let [
            at_low,
            at_high,
            base_low,
            base_high,
            fraction,
            mult,
            uncertainty,
            rest,
        ] = words;
        let state = match ClockState::from_bits(rest & 3) {
            Some(state) => state,
            None => ClockState::Unproved,
        };
        Self {
            at: Cycles(at_low as u64 | (at_high as u64) << 32),
            base: UtcNanos((base_low as u64 | (base_high as u64) << 32).cast_signed()),
            fraction,
            mult,
            quality: Quality {
                state,
                leap_seconds_known: rest & 4 != 0,
                uncertainty_ns: match state {
                    ClockState::Unset => u64::MAX,
                    ClockState::Set | ClockState::Holdover => uncertainty as u64,
                    ClockState::Unproved => (uncertainty as u64) << COARSE_BITS,
                },
                growth: rest >> 3,
            },
        }
    }

    const fn uncertainty_at(&self, when: Cycles) -> u64 {
        // Counted in started units of 256 cycles: never too little.
        let units = (when.since(self.at).unsigned_abs() >> 8) + 1;
        let grown = if units > u32::MAX as u64 {
            ((units >> 24) + 1).saturating_mul(self.quality.growth as u64)
        } else {
            (units * self.quality.growth as u64) >> 24
        };
        grown.saturating_add(self.quality.uncertainty_ns)
    }

    /// The line's value at `when` and the fraction behind its point.
    pub(crate) const fn point(&self, when: Cycles) -> (UtcNanos, u32) {
        let distance = when.since(self.at);
        // 2^28 cycles are exactly `mult` ns: what is a multiple of them needs no
        // shift, and the rest is short.
        let whole = (distance >> SHIFT).wrapping_mul(self.mult as i64);
        let rest = distance.cast_unsigned() & FRACTION;
        let product = rest * self.mult as u64 + self.fraction as u64;
        let ns = whole.wrapping_add((product >> SHIFT).cast_signed());
        (
            UtcNanos(self.base.0.wrapping_add(ns)),
            (product & FRACTION) as u32,
        )
    }
}

/// An uncertainty in one word: in ns, or where the second is not proved in units of 0.54 s, rounded
/// up, which reach 73 years.
const fn coarse_uncertainty(quality: &Quality) -> u32 {
    let units = match quality.state {
        ClockState::Unproved => (quality.uncertainty_ns >> COARSE_BITS) + 1,
        ClockState::Unset | ClockState::Set | ClockState::Holdover => quality.uncertainty_ns,
    };
    if units > u32::MAX as u64 {
        u32::MAX
    } else {
        units as u32
    }
}

/// `mult` of a clock that has to run `rate` faster than the crystal says.
pub(crate) const fn mult(rate: Ppb) -> u32 {
    // With 24 bits more, so that what is rounded is the sum and not the step.
    const UNIT: i64 = 1 << (SHIFT + 24);
    const NOMINAL: i64 = (UNIT as i128 * 1_000_000_000 / CORE_HZ as i128) as i64;
    const PER_PPB: i64 = NOMINAL / 1_000_000_000;
    let rate = if rate.0 > MAX_RATE.0 {
        MAX_RATE.0
    } else if rate.0 < -MAX_RATE.0 {
        -MAX_RATE.0
    } else {
        rate.0
    };
    ((NOMINAL + PER_PPB * rate as i64 + (1 << 23)) >> 24) as u32
}

/// The growth of the uncertainty of a clock whose rate is known to `uncertainty`.
pub(crate) const fn growth(uncertainty: Ppb) -> u32 {
    // One ppb is 10^9 / CORE_HZ billionths of a ns a cycle: 2^32 / CORE_HZ here.
    const PER_PPB: u64 = (1 << 52) / CORE_HZ as u64 + 1;
    const MAX: u32 = (1 << 29) - 1;
    let growth = (uncertainty.0.unsigned_abs() as u64 * PER_PPB) >> 20;
    if growth > MAX as u64 {
        MAX
    } else {
        growth as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = CORE_HZ as u64;

    fn line(rate: Ppb) -> ClockModel {
        ClockModel {
            base: UtcNanos(1_800_000_000_000_000_000),
            at: Cycles(5 * SECOND),
            mult: mult(rate),
            ..ClockModel::BOOT
        }
    }

    #[test]
    fn an_unset_clock_shows_the_time_since_boot() {
        for s in [0, 1, 60, 3_600] {
            let ns = ClockModel::BOOT.utc_at(Cycles(s * SECOND)).0;
            let off = ns - i64::try_from(s).unwrap() * 1_000_000_000;
            // Half a unit of mult is 0.3 ppb.
            assert!(off.unsigned_abs() <= s / 3 + 1, "{s} s: {off} ns off");
        }
    }

    #[test]
    fn a_rate_is_what_it_says() {
        for ppb in [-2_500_000, -500_000, -40_000, -1, 0, 1, 40_000, 2_500_000] {
            let model = line(Ppb(ppb));
            let hour = model
                .utc_at(model.at.plus(3_600 * SECOND))
                .since(model.base);
            let wanted = 3_600 * (1_000_000_000 + i64::from(ppb));
            assert!((hour - wanted).abs() <= 3_600 / 3 + 1, "{ppb} ppb");
        }
        assert_eq!(mult(Ppb(i32::MAX)), mult(MAX_RATE));
        assert_eq!(mult(Ppb(i32::MIN)), mult(Ppb(-MAX_RATE.0)));
    }

    #[test]
    fn every_rate_allowed_keeps_mult_in_its_range() {
        for rate in [MAX_RATE, Ppb(-MAX_RATE.0)] {
            let mult = mult(rate);
            assert!(mult > 1 << SHIFT, "strictly increasing");
            assert!(mult < 1 << 31, "the product of 2^32 cycles fits 64 bits");
        }
    }

    #[test]
    fn rebasing_changes_no_reading() {
        let first = line(Ppb(-499_999));
        let mut model = first;
        let mut step = 1_u64;
        for _ in 0..10_000 {
            step = step.wrapping_mul(6_364_136_223_846_793_005) | 1;
            model = model.rebased(model.at.plus(step >> 33));
            for probe in [0, 1, 2, 3, step >> 32] {
                let when = model.at.plus(probe);
                assert_eq!(model.utc_at(when), first.utc_at(when));
            }
        }
        assert!(model.at.since(first.at) > 1 << 40);
    }

    #[test]
    fn far_and_backwards_it_is_the_same_line() {
        let model = line(Ppb(123_456));
        let exact = |when: i64| {
            let product = i128::from(when - i64::try_from(model.at.0).unwrap())
                * i128::from(model.mult)
                + i128::from(model.fraction);
            model.base.0 + i64::try_from(product >> SHIFT).unwrap()
        };
        for when in [
            0,
            1,
            839_999_999,
            840_000_000,
            840_000_001,
            1 << 40,
            1 << 58,
        ] {
            assert_eq!(model.utc_at(Cycles(when)).0, exact(when.cast_signed()));
        }
    }

    #[test]
    fn words_hold_the_whole_model() {
        for (state, uncertainty_ns) in [
            (ClockState::Unset, u64::MAX),
            (ClockState::Set, 0xffff_fffc),
            (ClockState::Holdover, 0xffff_fffc),
            // 18 s, in units of 2²⁹ ns.
            (ClockState::Unproved, 34 << COARSE_BITS),
        ] {
            let model = ClockModel {
                at: Cycles(0x0123_4567_89ab_cdef),
                base: UtcNanos(-2),
                fraction: 0x0fff_fffe,
                mult: 0x7fff_fffd,
                quality: Quality {
                    state,
                    leap_seconds_known: state == ClockState::Set,
                    uncertainty_ns,
                    growth: 0x1fff_fffb,
                },
            };
            let copy = ClockModel::from_words(model.words());
            if state == ClockState::Unproved {
                // Rounded up by a unit.
                let up = copy.quality.uncertainty_ns - uncertainty_ns;
                assert_eq!(up, 1 << COARSE_BITS);
                let quality = model.quality;
                assert_eq!(ClockModel { quality, ..copy }, model);
            } else {
                assert_eq!(copy, model);
            }
        }
    }

    #[test]
    fn uncertainty_grows_on_both_sides_for_ever() {
        let mut model = line(Ppb(0));
        model.quality.uncertainty_ns = 1_000;
        model.quality.growth = growth(Ppb::from_ppm(50));
        let after = model.reading_at(model.at.plus(SECOND)).uncertainty_ns;
        let before = model.reading_at(Cycles(model.at.0 - SECOND)).uncertainty_ns;
        // 50 ppm of a second are 50 µs; a started unit may be 1 ns more.
        assert!((51_000..=51_002).contains(&after), "{after}");
        assert_eq!(before, after);
        // 1 740 years later, of each second 50 µs.
        let far = Cycles(u64::MAX / 2);
        let years = model.reading_at(far).uncertainty_ns;
        let grown = (far.0 - model.at.0) / SECOND * 50_000;
        assert!(years.abs_diff(grown) <= grown / 100_000, "{years}");
    }
}
