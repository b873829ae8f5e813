//! How an image keeps the clock, in the words of the command line.
//!
//! *Purpose.* One place where variants and ticks are named, so that whoever builds an image and
//! whoever runs it mean the same.
//!
//! *Design.* `pixclock`, `paper-default`, `paper-step1` and `paper-step2:50`: a variant that allows
//! more than one tick has it in its value, so that no wrong combination can be said.
//!
//! *Limits.* The firmware's `build.rs` has its own list, and refuses what it has not.

use std::fmt;
use std::str::FromStr;

use crate::TICKS_US;

/// Our variant, or one of those that Shim, Joo and Kim (2021) measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// Ours.
    Pixclock {
        /// From tick to tick, in µs: one of [`TICKS_US`].
        tick_us: u32,
    },
    /// PX4 1.9 as it comes; tick 1000 µs.
    PaperDefault,
    /// The paper's step I; tick 1000 µs.
    PaperStep1,
    /// The paper's step II.
    PaperStep2 {
        /// From tick to tick, in µs: 500, 200 or 50.
        tick_us: u32,
    },
}

impl Variant {
    /// What is flashed.
    pub const STANDARD: Self = Self::Pixclock { tick_us: 50 };

    /// The paper's, with the ticks of its table 3.
    pub const PAPERS: [Self; 5] = [
        Self::PaperDefault,
        Self::PaperStep1,
        Self::PaperStep2 { tick_us: 500 },
        Self::PaperStep2 { tick_us: 200 },
        Self::PaperStep2 { tick_us: 50 },
    ];

    /// Its name, as in `PIXCLOCK_VARIANT`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pixclock { .. } => "pixclock",
            Self::PaperDefault => "paper-default",
            Self::PaperStep1 => "paper-step1",
            Self::PaperStep2 { .. } => "paper-step2",
        }
    }

    /// From tick to tick, in µs.
    #[must_use]
    pub const fn tick_us(self) -> u32 {
        match self {
            Self::Pixclock { tick_us } | Self::PaperStep2 { tick_us } => tick_us,
            Self::PaperDefault | Self::PaperStep1 => 1_000,
        }
    }

    /// Ours at every tick, and the paper's.
    pub fn all() -> impl Iterator<Item = Self> {
        let ours = TICKS_US
            .into_iter()
            .map(|tick_us| Self::Pixclock { tick_us });
        ours.chain(Self::PAPERS)
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::STANDARD | Self::PaperDefault | Self::PaperStep1 => f.write_str(self.name()),
            Self::Pixclock { tick_us } | Self::PaperStep2 { tick_us } => {
                write!(f, "{}:{tick_us}", self.name())
            }
        }
    }
}

/// A text that names no variant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownVariant(String);

impl fmt::Display for UnknownVariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let allowed: Vec<_> = Variant::all().map(|variant| variant.to_string()).collect();
        write!(
            f,
            "`{}` is no variant; allowed: {}",
            self.0,
            allowed.join(", ")
        )
    }
}

impl std::error::Error for UnknownVariant {}

impl FromStr for Variant {
    type Err = UnknownVariant;

    fn from_str(text: &str) -> Result<Self, UnknownVariant> {
        Self::all()
            .find(|variant| variant.to_string() == text)
            .ok_or_else(|| UnknownVariant(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variant_is_read_as_it_is_shown() {
        for variant in Variant::all() {
            assert_eq!(variant.to_string().parse(), Ok(variant));
        }
        assert_eq!("pixclock".parse(), Ok(Variant::STANDARD));
        assert_eq!("paper-step1".parse(), Ok(Variant::PaperStep1));
        let shortest = Variant::PaperStep2 { tick_us: 50 };
        assert_eq!("paper-step2:50".parse(), Ok(shortest));
    }

    #[test]
    fn what_is_no_variant_is_refused_with_the_list() {
        for wrong in [
            "",
            "paper",
            "paper-step2",
            "paper-step2:1000",
            "paper-default:50",
        ] {
            let refusal = wrong.parse::<Variant>().unwrap_err().to_string();
            assert!(
                refusal.contains("paper-step2:500, paper-step2:200"),
                "{refusal}"
            );
        }
    }
}
