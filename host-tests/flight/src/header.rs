//! What is known about a flight beside what the board saw: the truth, the crystal,
//! what the clock was set to.

use std::fmt;

use crate::{Crystal, WorldPicos};

/// True UTC at the start of a flight that does not say: 2026-11-22T01:02:03Z, in ns
/// since 1970.
const START_UTC_NS: i64 = 1_795_309_323 * 1_000_000_000;

/// What stands above a flight's events.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The board's crystal.
    pub crystal: Crystal,
    /// True UTC at the start, in ns since 1970.
    pub start_utc_ns: i64,
    /// Where true UTC steps.
    pub leaps: Vec<LeapStep>,
    /// The latency of messages that the user set, in µs; 0 is unknown.
    pub latency_us: u32,
    /// What the clock asked CFG-TP5 for; `None` where that is not known.
    pub pulse: Option<PulseShape>,
    /// The flight lacks TIM-TP, falling edges and NAV-TIMELS on purpose.
    pub is_bare: bool,
    /// Spans to be judged apart.
    pub windows: Vec<Window>,
    /// Lines that mean nothing, without their `#`.
    pub comments: Vec<String>,
}

/// A step of true UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeapStep {
    /// From this moment on.
    pub at: WorldPicos,
    /// How far, in ns.
    pub by_ns: i64,
}

/// A pulse, as CFG-TP5 describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseShape {
    /// How long it lasts, in ns.
    pub width_ns: u32,
    /// It rises at the second; else it falls.
    pub is_high: bool,
}

/// A span of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Its first moment, in s.
    pub from_s: f64,
    /// The first moment after it, in s.
    pub until_s: f64,
    /// What it is about.
    pub name: String,
}

impl Window {
    /// Whether it has a moment.
    #[must_use]
    pub fn has(&self, at: WorldPicos) -> bool {
        (self.from_s * 1e6..self.until_s * 1e6).contains(&at.as_micros())
    }
}

impl Default for Header {
    fn default() -> Self {
        Self {
            crystal: Crystal::constant(0.0),
            start_utc_ns: START_UTC_NS,
            leaps: Vec::new(),
            latency_us: 0,
            pulse: None,
            is_bare: false,
            windows: Vec::new(),
            comments: Vec::new(),
        }
    }
}

impl Header {
    /// True UTC at a moment, in ns since 1970.
    #[must_use]
    pub fn utc_ns(&self, at: WorldPicos) -> i64 {
        let leaps = self.leaps.iter().filter(|leap| leap.at <= at);
        leaps
            .map(|leap| leap.by_ns)
            .fold(self.start_utc_ns, i64::saturating_add)
            .saturating_add(at.as_nanos())
    }
}

/// The lines of a file's header.
impl fmt::Display for Header {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for comment in &self.comments {
            writeln!(f, "# {comment}")?;
        }
        match self.crystal.knots() {
            [only] => writeln!(f, "# ppm {}", only.ppm)?,
            knots => {
                for knot in knots {
                    writeln!(f, "# crystal {} {}", knot.at_s, knot.ppm)?;
                }
            }
        }
        if self.start_utc_ns != START_UTC_NS {
            writeln!(f, "# start_ns {}", self.start_utc_ns)?;
        }
        for leap in &self.leaps {
            writeln!(f, "# leap {} {}", leap.at, leap.by_ns)?;
        }
        if self.latency_us != 0 {
            writeln!(f, "# latency_us {}", self.latency_us)?;
        }
        if let Some(pulse) = self.pulse {
            writeln!(f, "# pulse {pulse}")?;
        }
        if self.is_bare {
            writeln!(f, "# bare")?;
        }
        for window in &self.windows {
            let Window {
                from_s,
                until_s,
                name,
            } = window;
            writeln!(f, "# window {from_s} {until_s} {name}")?;
        }
        Ok(())
    }
}

/// As in `100ms high`.
impl fmt::Display for PulseShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let polarity = if self.is_high { "high" } else { "low" };
        if self.width_ns.is_multiple_of(1_000_000) {
            write!(f, "{}ms {polarity}", self.width_ns / 1_000_000)
        } else {
            write!(f, "{}ns {polarity}", self.width_ns)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_truth_is_the_start_the_time_since_and_the_leaps_up_to_then() {
        let leap = LeapStep {
            at: WorldPicos::from_millis(2_000),
            by_ns: -1_000_000_000,
        };
        let header = Header {
            leaps: vec![leap],
            ..Header::default()
        };
        let since = |ms| header.utc_ns(WorldPicos::from_millis(ms)) - START_UTC_NS;
        assert_eq!(since(1_963), 1_963_000_000);
        assert_eq!(since(2_000), 1_000_000_000);
        assert_eq!(since(-37), -37_000_000);
    }

    #[test]
    fn a_window_has_its_begin_and_not_its_end() {
        let window = Window {
            from_s: 37.0,
            until_s: 74.0,
            name: String::new(),
        };
        let has = |ms| window.has(WorldPicos::from_millis(ms));
        assert_eq!(
            [36_963, 37_000, 73_963, 74_000].map(has),
            [false, true, true, false]
        );
    }
}
