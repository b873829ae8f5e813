//! The crystal: how far a clock that runs on by it may be off.
//!
//! *Purpose.* The one model of the crystal that the published uncertainty rests on.
//!
//! *Design.* At some moment the clock is known to some ns and its frequency to some ppb; from
//! then on the crystal may drift by 1 ppm a minute, as its temperature does. So the
//! uncertainty grows by `frequency · t + ½ · drift · t²`. Drift does not lead a crystal out of its
//! specification: the linear part of it stops at `SPECIFICATION_PPB`.
//!
//! *Limits.* A crystal that is heated faster is not covered.

use timebase::{CORE_HZ, Cycles};

use crate::float::float;
use crate::utc::Ppb;

/// The fastest drift of a crystal: 1 ppm a minute. \[ppb/s\]
pub(crate) const DRIFT_PPB_PER_S: f32 = 1_000.0 / 60.0;

/// So far a crystal can be off, with the room that a learner needs: three boards were measured at
/// +37, +37 and +44 ppm. \[ppb\]
pub(crate) const CRYSTAL_PPB: f32 = 110_000.0;

/// ±50 ppm over its range of temperature: three such boards were measured at +37, +37 and
/// +44 ppm. \[ppb\]
const SPECIFICATION_PPB: f32 = 50_000.0;

/// The rate that makes up for a crystal that is `crystal_ppb` fast: the sign changes here and in
/// [`crystal_ppb`], its inverse. On the board's own counter it is exact: a rate of 1 − f, where f
/// was measured by that counter's seconds.
pub(crate) fn rate(crystal_ppb: f32) -> Ppb {
    Ppb(-libm::rintf(crystal_ppb) as i32)
}

/// By how much a crystal is fast that a clock of this rate makes up for. \[ppb\]
pub(crate) const fn crystal_ppb(rate: Ppb) -> f32 {
    -(rate.0 as f32)
}

/// What is known, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// The moment.
    pub at: Cycles,
    /// How far the clock may be off then. \[ns\]
    pub phase_ns: f32,
    /// How far its frequency may be off. \[ppb\]
    pub frequency_ppb: f32,
}

impl Uncertainty {
    /// How far the clock may be off at `when`. \[ns\]
    #[must_use]
    #[inline(never)] // Asked in many places: it may be small.
    pub fn at(&self, when: Cycles) -> f32 {
        self.after_s(self.since_s(when))
    }

    /// From the moment to `when`, or from `when` to the moment. \[s\]
    #[inline]
    pub(crate) fn since_s(&self, when: Cycles) -> f32 {
        float(when.since(self.at).saturating_abs()) * (1.0 / CORE_HZ as f32)
    }

    /// How far the clock may be off so many seconds from the moment. \[ns\]
    #[inline]
    pub(crate) fn after_s(&self, s: f32) -> f32 {
        let drifted_ppb = (0.5 * DRIFT_PPB_PER_S * s).min(SPECIFICATION_PPB);
        self.phase_ns + (self.frequency_ppb + drifted_ppb) * s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_parabola_and_then_a_line() {
        let uncertainty = Uncertainty {
            at: Cycles(u64::from(CORE_HZ)),
            phase_ns: 100.0,
            frequency_ppb: 10.0,
        };
        let after = |s: u64| uncertainty.at(uncertainty.at.plus(s * u64::from(CORE_HZ)));
        assert_eq!(after(0), 100.0);
        // 60 s: 10 ppb of them, and half of 1 ppm of them.
        assert!((after(60) - (100.0 + 600.0 + 30_000.0)).abs() < 1.0);
        // A day: 50 ppm of it.
        let day = after(86_400) / 86_400.0;
        assert!((day - 50_010.0).abs() < 1.0, "{day}");
    }
}
