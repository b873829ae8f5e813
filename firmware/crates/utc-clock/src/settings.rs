//! What is known about the receiver and the crystal before the first mark.
//!
//! *Purpose.* All that a clock cannot find out by itself, or only in minutes.

use crate::utc::{Ppb, UtcNanos};

/// How far a latency that was learnt under the pulse may be off afterwards: 10 ms, by which the
/// floors of real receivers wander. \[ns\]
pub(crate) const LEARNT_UNCERTAINTY_NS: u32 = 10_000_000;

/// What a clock knows beforehand about its receiver and its crystal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Follow only marks whose `confirmedTime` is set.
    pub require_confirmed: bool,
    /// From the epoch to the first byte on the wire. 0 until it is known: what equal boards have
    /// in common cancels between them. \[ns\]
    pub latency_ns: u32,
    /// How far off that may be. As long as the latency is taken for 0: 150 ms, for ArduPilot
    /// assumes 120 ms for the latency of an M8, and floors move. \[ns\]
    pub latency_uncertainty_ns: u32,
    /// How far the receiver's pulse may be from UTC beyond what its own noise shows: the antenna's
    /// cable has 5 ns a metre, and two receivers were 35 ns apart; and how far the filters are behind a
    /// ramp of 1 ppm a minute that turns round, before an innovation shows it. \[ns\]
    pub pulse_uncertainty_ns: u32,
    /// How far a crystal that turns by 1 ppm a minute leads the clock away under the pulse while
    /// noise hides the turn: what the filters themselves claim is made up to it. 1 in 10 000
    /// simulated flights saw 150 ns for a second, where the filters claimed 57. \[ns\]
    pub hidden_turn_ns: u32,
    /// The count of leap seconds, where no message has it: recordings without NAV-TIMELS. `None`:
    /// the receiver has to prove it.
    pub leap_seconds: Option<i8>,
    /// The earliest date that is believed; 1024 weeks after it is the end. A setting, so that
    /// old recordings can be played.
    pub date_floor: UtcNanos,
    /// How much faster than the crystal the clock has to run.
    pub frequency: Ppb,
    /// How far off that may be. 50 ppm while it is taken for 0: the crystals of
    /// three such boards were measured at +37, +37 and +44 ppm.
    pub frequency_uncertainty: Ppb,
}

impl Settings {
    /// An M8 on a Pixhawk 1 of which nothing has been learnt.
    pub const DEFAULT: Self = Self {
        require_confirmed: false,
        latency_ns: 0,
        latency_uncertainty_ns: 150_000_000,
        pulse_uncertainty_ns: 83,
        hidden_turn_ns: 95,
        leap_seconds: None,
        date_floor: Self::DATE_FLOOR,
        frequency: Ppb(0),
        frequency_uncertainty: Ppb::from_ppm(50),
    };

    /// 2025-01-01T00:00:00Z: no earlier epoch is believed. A constant that is raised with each
    /// release, because the date of a build would make builds differ.
    pub const DATE_FLOOR: UtcNanos = UtcNanos(1_735_689_600_000_000_000);

    /// The same for a receiver whose latency was measured \[ns\] and is known as well as one
    /// that is learnt under a pulse; 0 leaves it unknown.
    #[must_use]
    pub const fn with_latency_ns(self, latency_ns: u32) -> Self {
        if latency_ns == 0 {
            return self;
        }
        Self {
            latency_ns,
            latency_uncertainty_ns: LEARNT_UNCERTAINTY_NS,
            ..self
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
