//! The cases: what happens to the two boards of a trial.
//!
//! *Purpose.* Every row of the table of bounds as data.
//!
//! *Design.* A case names its receivers, the temperature, the pulse, and the window
//! in which the difference between the two boards is looked at. Several
//! temperatures are pooled. Crystals are drawn in ±50 ppm and begin cold, unless a
//! frequency was stored.
//!
//! *Limits.* Both boards have receivers of one kind.

use std::ops::Range;

use world::{Latency, Ramp, Wander};

/// ns.
pub const SECOND: u64 = 1_000_000_000;

/// Seeds to tune an estimator with.
pub const TUNING: Range<u64> = 0..60;
/// Seeds for published figures: never tune with these.
pub const FIGURES: Range<u64> = 20_000..20_050;

/// What the temperature does to the crystals; each board has its own sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Temperature {
    /// Nothing.
    Constant,
    /// 1 ppm/min, always the same way.
    Ramp,
    /// 1 ppm/min, turning every 120 s or so.
    Turning,
}

impl Temperature {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Ramp => "ramp",
            Self::Turning => "turning",
        }
    }

    /// What it is to a crystal that it drives up, or else down.
    #[must_use]
    pub fn ramp(self, up: bool) -> Ramp {
        let ramp = match self {
            Self::Constant => Ramp::None,
            Self::Ramp => Ramp::UP,
            Self::Turning => Ramp::TURNING,
        };
        if up { ramp } else { ramp.reversed() }
    }
}

/// How the floors of the receivers' latencies move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Floor {
    /// They do not.
    Still,
    /// 8 ms up and down, each from a phase of its own.
    Sine {
        /// In s.
        period_s: u64,
    },
    /// A random walk within 8 ms.
    Walk,
}

impl Floor {
    /// Of a receiver that begins at `phase`, in 10⁻⁶ of a period.
    #[must_use]
    pub const fn wander(self, phase: u32) -> Wander {
        match self {
            Self::Still => Wander::None,
            Self::Sine { period_s } => Wander::sine_8_ms(period_s * SECOND, phase),
            Self::Walk => Wander::WALK_8_MS,
        }
    }
}

/// The time pulses of both receivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pulse {
    /// 30 ns RMS, none of it slow.
    Plain,
    /// The same, half of it correlated over 100 s.
    HalfCorrelated,
    /// The same as the first, its sawtooth forecast by TIM-TP.
    Forecast,
}

/// The unit of a case's figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// 10⁻³ s.
    Ms,
    /// 10⁻⁶ s.
    Us,
    /// 10⁻⁹ s.
    Ns,
}

impl Unit {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ms => "ms",
            Self::Us => "us",
            Self::Ns => "ns",
        }
    }

    /// One of it. \[ns\]
    #[must_use]
    pub const fn ns(self) -> f64 {
        match self {
            Self::Ms => 1e6,
            Self::Us => 1e3,
            Self::Ns => 1.0,
        }
    }
}

/// What both boards lose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// The pulse; the messages go on.
    Pulse,
    /// The messages.
    Messages,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its title in the table.
    pub title: &'static str,
    /// The receivers.
    pub latency: fn() -> Latency,
    /// How their floors move.
    pub floor: Floor,
    /// The temperatures that are pooled.
    pub temperatures: &'static [Temperature],
    /// The pulses, if there are any.
    pub pulse: Option<Pulse>,
    /// The clock knows its frequency from another day.
    pub stored: bool,
    /// What is lost, and at which second.
    pub lost: Option<(Lost, u64)>,
    /// When the difference counts, after the start. \[s\]
    pub window_s: Range<u64>,
    /// Count one moment alone: the window's begin.
    pub one_moment: bool,
    /// It has converged when the difference stays below this until [`SETTLED_S`]. \[ns\]
    pub converged_ns: u32,
    /// The unit of its figures.
    pub unit: Unit,
}

/// When convergence is over, after the start: the bounds hold from here on. \[s\]
pub const SETTLED_S: u64 = 180;

const ANY: &[Temperature] = &[
    Temperature::Constant,
    Temperature::Ramp,
    Temperature::Turning,
];
const RAMPS: &[Temperature] = &[Temperature::Ramp, Temperature::Turning];
const CONSTANT: &[Temperature] = &[Temperature::Constant];

/// What most rows have in common.
const M8: Case = Case {
    name: "m8",
    title: "M8-like, still floors, any ramp",
    latency: Latency::m8,
    floor: Floor::Still,
    temperatures: ANY,
    pulse: None,
    stored: false,
    lost: None,
    window_s: SETTLED_S..780,
    one_moment: false,
    converged_ns: 1_000_000,
    unit: Unit::Ms,
};

const PULSE: Case = Case {
    pulse: Some(Pulse::Plain),
    temperatures: CONSTANT,
    converged_ns: 1_000,
    unit: Unit::Ns,
    ..M8
};

/// 10 min of lock, and a period or 10 min more.
const fn wander(name: &'static str, title: &'static str, floor: Floor) -> Case {
    let longer_s = match floor {
        Floor::Sine { period_s } if period_s > 600 => period_s,
        _ => 600,
    };
    Case {
        name,
        title,
        floor,
        temperatures: CONSTANT,
        window_s: 600..600 + longer_s,
        ..M8
    }
}

/// All of them, in the order of the table.
pub static CASES: [Case; 20] = [
    M8,
    Case {
        name: "harsh",
        title: "harsh M8 (even over 90 ms), any ramp",
        latency: Latency::harsh_m8,
        converged_ns: 4_000_000,
        ..M8
    },
    Case {
        name: "f9",
        title: "F9-like, any ramp",
        latency: Latency::f9,
        ..M8
    },
    Case {
        name: "stored",
        title: "M8-like from a stored frequency, any ramp",
        stored: true,
        ..M8
    },
    Case {
        name: "gamma",
        title: "soft edge: gamma, any ramp",
        latency: Latency::gamma,
        ..M8
    },
    Case {
        name: "rayleigh",
        title: "soft edge: Rayleigh, any ramp",
        latency: Latency::rayleigh,
        ..M8
    },
    Case {
        name: "correlated",
        title: "M8-like, jitter correlated over 20 s, any ramp",
        latency: m8_with_memory,
        ..M8
    },
    wander(
        "wander-60s",
        "floors wander as a sine of 60 s",
        Floor::Sine { period_s: 60 },
    ),
    wander(
        "wander-2min",
        "floors wander as a sine of 2 min",
        Floor::Sine { period_s: 120 },
    ),
    wander(
        "wander-4min",
        "floors wander as a sine of 4 min",
        Floor::Sine { period_s: 240 },
    ),
    wander(
        "wander-10min",
        "floors wander as a sine of 10 min",
        Floor::Sine { period_s: 600 },
    ),
    wander(
        "wander-30min",
        "floors wander as a sine of 30 min",
        Floor::Sine { period_s: 1_800 },
    ),
    wander(
        "wander-1h",
        "floors wander as a sine of 1 h",
        Floor::Sine { period_s: 3_600 },
    ),
    wander("wander-walk", "floors walk at random", Floor::Walk),
    Case {
        name: "pulse",
        title: "pulse of 30 ns, ramps",
        temperatures: RAMPS,
        ..PULSE
    },
    Case {
        name: "pulse-constant",
        title: "pulse of 30 ns, constant temperature",
        ..PULSE
    },
    Case {
        name: "pulse-half",
        title: "pulse of 30 ns, half of it correlated, ramps",
        pulse: Some(Pulse::HalfCorrelated),
        temperatures: RAMPS,
        ..PULSE
    },
    Case {
        name: "pulse-timtp",
        title: "pulse of 30 ns, its sawtooth forecast by TIM-TP, ramps",
        pulse: Some(Pulse::Forecast),
        temperatures: RAMPS,
        ..PULSE
    },
    Case {
        name: "pulse-lost",
        title: "60 s after the pulse is lost, constant temperature",
        lost: Some((Lost::Pulse, 780)),
        window_s: 840..841,
        one_moment: true,
        unit: Unit::Us,
        ..PULSE
    },
    Case {
        name: "messages-lost",
        title: "60 s after the messages are lost, constant temperature",
        temperatures: CONSTANT,
        lost: Some((Lost::Messages, 780)),
        window_s: 840..841,
        one_moment: true,
        unit: Unit::Us,
        ..M8
    },
];

impl Case {
    /// When a trial of it is over, in s after the start.
    #[must_use]
    pub const fn end_s(&self) -> u64 {
        self.window_s.end
    }
}

fn m8_with_memory() -> Latency {
    Latency::m8().with_memory(20 * SECOND)
}

/// The case that is called `name`.
#[must_use]
pub fn find(name: &str) -> Option<&'static Case> {
    CASES.iter().find(|case| case.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_case_is_found_by_its_name_and_no_other() {
        for case in &CASES {
            assert_eq!(find(case.name).unwrap().title, case.title);
            assert!(case.window_s.start < case.window_s.end);
        }
        assert!(find("m9").is_none());
    }
}
