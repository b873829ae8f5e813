//! Variants in the words of a command line: `pixclock`, `paper-step1`, `paper-step2:50`.

use core::fmt;
use core::str::FromStr;

use crate::variant::Variant;

/// The name, and the tick behind a colon where there is a choice and it is not pixclock's 50 µs.
impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::STANDARD | Self::PaperDefault | Self::PaperStep1 => f.write_str(self.name()),
            Self::Pixclock { tick_us }
            | Self::PaperStep2 { tick_us }
            | Self::PaperTickOnly { tick_us } => {
                write!(f, "{}:{tick_us}", self.name())
            }
        }
    }
}

/// A text that names no variant. Displayed with the list of those that there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownVariant;

impl fmt::Display for UnknownVariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut before = "no such variant; allowed: ";
        for variant in Variant::all() {
            write!(f, "{before}{variant}")?;
            before = ", ";
        }
        Ok(())
    }
}

impl core::error::Error for UnknownVariant {}

impl FromStr for Variant {
    type Err = UnknownVariant;

    /// Reads what `Display` writes; a tick may also stand where there is no choice.
    fn from_str(text: &str) -> Result<Self, UnknownVariant> {
        let found = match text.split_once(':') {
            Some((name, tick)) => tick
                .parse()
                .ok()
                .and_then(|tick_us| Self::named(name)?.with_tick_us(tick_us)),
            // The paper's step II has no tick of its own, with and without its priority.
            None => Self::named(text).filter(|variant| {
                !matches!(
                    variant,
                    Self::PaperStep2 { .. } | Self::PaperTickOnly { .. }
                )
            }),
        };
        found.ok_or(UnknownVariant)
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;

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
            "paper-step2:",
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
