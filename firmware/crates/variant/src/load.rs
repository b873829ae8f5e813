//! The load that an image is built with beside its clock.

use core::fmt;
use core::str::FromStr;

/// A synthetic flight stack in an image: how much of the core it takes, and which parts it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    percent: u8,
    parts: LoadParts,
}

/// The parts of a load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadParts {
    /// Interrupts that read sensors.
    pub interrupts: bool,
    /// Sections that mask them.
    pub masked: bool,
    /// Tasks.
    pub tasks: bool,
}

impl LoadParts {
    /// All of them.
    pub const ALL: Self = Self {
        interrupts: true,
        masked: true,
        tasks: true,
    };
    const NONE: Self = Self {
        interrupts: false,
        masked: false,
        tasks: false,
    };
}

impl Load {
    /// What PX4 takes of the core: the median of its `top` on FMUv2 is between 49.5 and 59.7 %
    /// (PX4-Autopilot#2883, #2968).
    pub const PX4_PERCENT: u8 = 55;

    /// The greatest load. \[%\]
    pub const MAX_PERCENT: u8 = 80;

    /// All parts at the rates that take `percent` of the core; `None` above [`Self::MAX_PERCENT`].
    #[must_use]
    pub const fn of(percent: u8) -> Option<Self> {
        if percent > Self::MAX_PERCENT {
            return None;
        }
        Some(Self {
            percent,
            parts: LoadParts::ALL,
        })
    }

    /// What all parts together would take of the core. \[%\]
    #[must_use]
    pub const fn percent(self) -> u8 {
        self.percent
    }

    /// The parts that it has.
    #[must_use]
    pub const fn parts(self) -> LoadParts {
        self.parts
    }
}

/// As the build setting `PIXCLOCK_LOAD` has it: `px4`, `60`, `px4,masked`.
impl fmt::Display for Load {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.percent == Self::PX4_PERCENT {
            f.write_str("px4")?;
        } else {
            write!(f, "{}", self.percent)?;
        }
        if self.parts == LoadParts::ALL {
            return Ok(());
        }
        let LoadParts {
            interrupts,
            masked,
            tasks,
        } = self.parts;
        for (has, name) in [
            (interrupts, "interrupts"),
            (masked, "masked"),
            (tasks, "tasks"),
        ] {
            if has {
                write!(f, ",{name}")?;
            }
        }
        Ok(())
    }
}

/// A text that names no load. Displayed with what would.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownLoad;

impl fmt::Display for UnknownLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "no such load; allowed: px4 ({} % of the core) or a whole number from 0 to {}, and behind a \
             comma `interrupts`, `masked` or `tasks` to have these parts alone, as in px4,masked,tasks",
            Load::PX4_PERCENT,
            Load::MAX_PERCENT
        )
    }
}

impl core::error::Error for UnknownLoad {}

impl FromStr for Load {
    type Err = UnknownLoad;

    fn from_str(text: &str) -> Result<Self, UnknownLoad> {
        let mut words = text.split(',');
        let percent = match words.next() {
            Some("px4") => Self::PX4_PERCENT,
            // `parse` would take a sign as well.
            Some(number) if number.bytes().all(|byte| byte.is_ascii_digit()) => {
                number.parse().map_err(|_| UnknownLoad)?
            }
            _ => return Err(UnknownLoad),
        };
        let mut parts = LoadParts::NONE;
        for word in words {
            let part = match word {
                "interrupts" => &mut parts.interrupts,
                "masked" => &mut parts.masked,
                "tasks" => &mut parts.tasks,
                _ => return Err(UnknownLoad),
            };
            if core::mem::replace(part, true) {
                return Err(UnknownLoad);
            }
        }
        if parts == LoadParts::NONE {
            parts = LoadParts::ALL;
        }
        let load = Self::of(percent).ok_or(UnknownLoad)?;
        Ok(Self { parts, ..load })
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;

    use super::*;

    #[test]
    fn a_load_is_read_as_it_is_shown() {
        for text in ["px4", "0", "80", "20,tasks", "px4,interrupts,masked"] {
            let load: Load = text.parse().unwrap();
            assert_eq!(load.to_string(), text);
        }
        let px4: Load = "px4".parse().unwrap();
        assert_eq!(px4.percent(), 55);
        assert_eq!(px4.parts(), LoadParts::ALL);
        assert_eq!("55".parse(), Ok(px4));
        assert_eq!("px4,masked,interrupts,tasks".parse(), Ok(px4));
    }

    #[test]
    fn nonsense_is_refused_with_what_is_allowed() {
        for wrong in [
            "",
            "81",
            "-1",
            "+5",
            "5.5",
            "PX4",
            "px4,",
            "px4,sensors",
            "masked",
            "px4,tasks,tasks",
            "999",
            " 20",
        ] {
            let refusal = wrong.parse::<Load>().unwrap_err().to_string();
            assert!(refusal.contains("from 0 to 80"), "{refusal}");
        }
    }
}
