//! The methods of keeping time that the experiment compares.
//!
//! *Purpose.* The name of each method, the images that its boards need, and the paper's
//! figure for it.
//!
//! *Design.* A method is a build setting of the firmware, a tick and a baud rate of the
//! receiver's line for each board, and whether the receiver's pulse is wired.
//!
//! *Limits.* The paper gives one figure for its default, which stands here for equal and
//! for unequal baud rates, because it names unequal ones as a cause (section 2.1.2).

use std::fmt;
use std::str::FromStr;

use variant::{Image, Variant};

/// The baud rate of every board of the mixed method but the first: a Here+'s own. \[Bd\]
const SLOW_BAUD: u32 = 38_400;

/// A method of keeping time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Method {
    /// PX4 1.9 as it was, both receivers at 115200.
    PaperDefault,
    /// The same, the first receiver at 115200, every other at 38400.
    PaperDefaultMixed,
    /// The paper's step I: 115200 and a constant wait of 5 ms.
    PaperStep1,
    /// The paper's step II: SysTick at priority 0 and this tick. \[µs\]
    PaperStep2(u32),
    /// Step II without its priority: this tick among the other interrupts. \[µs\]
    PaperTickOnly(u32),
    /// pixclock on the receiver's messages.
    Pixclock,
    /// pixclock on the receiver's time pulse.
    PixclockPps,
}

impl Method {
    /// All of them, the paper's first.
    pub const ALL: [Self; 9] = [
        Self::PaperDefaultMixed,
        Self::PaperDefault,
        Self::PaperStep1,
        Self::PaperStep2(500),
        Self::PaperStep2(200),
        Self::PaperStep2(50),
        Self::PaperTickOnly(50),
        Self::Pixclock,
        Self::PixclockPps,
    ];

    /// Its description in the report.
    #[must_use]
    pub fn title(self) -> String {
        match self {
            Self::PaperDefault => "default, both receivers at 115200".to_owned(),
            Self::PaperDefaultMixed => "default, receivers at 115200 and 38400".to_owned(),
            Self::PaperStep1 => "step I: 115200, constant wait".to_owned(),
            Self::PaperStep2(tick_us) => {
                format!("step II: SysTick first, tick of {tick_us} µs")
            }
            Self::PaperTickOnly(tick_us) => {
                format!("a tick of {tick_us} µs alone, SysTick among the others")
            }
            Self::Pixclock => "pixclock on the receiver's messages".to_owned(),
            Self::PixclockPps => "pixclock on the receiver's pulse".to_owned(),
        }
    }

    /// The mean difference over 600 s that the paper measured (its tables 2 and 3), in
    /// ms.
    #[must_use]
    pub const fn paper_ms(self) -> Option<f64> {
        match self {
            Self::PaperDefault | Self::PaperDefaultMixed => Some(21.64),
            Self::PaperStep1 => Some(6.38),
            Self::PaperStep2(500) => Some(5.37),
            Self::PaperStep2(200) => Some(6.15),
            Self::PaperStep2(50) => Some(3.44),
            Self::PaperStep2(_) | Self::PaperTickOnly(_) | Self::Pixclock | Self::PixclockPps => {
                None
            }
        }
    }

    /// The paper's figure that shows this method, if it has one.
    #[must_use]
    pub const fn paper_figure(self) -> Option<u32> {
        match self {
            Self::PaperDefault | Self::PaperDefaultMixed => Some(1),
            Self::PaperStep1 => Some(9),
            Self::PaperStep2(50) => Some(10),
            _ => None,
        }
    }

    /// Whether it is one of the paper's.
    #[must_use]
    pub const fn is_papers(self) -> bool {
        !matches!(self, Self::Pixclock | Self::PixclockPps)
    }

    /// Whether the receiver's pulse is wired.
    #[must_use]
    pub const fn has_pulse(self) -> bool {
        matches!(self, Self::PixclockPps)
    }

    /// What board `index`, counted from 0, is built with.
    #[must_use]
    pub const fn image(self, index: usize) -> Image {
        let variant = match self {
            Self::PaperDefault | Self::PaperDefaultMixed => Variant::PaperDefault,
            Self::PaperStep1 => Variant::PaperStep1,
            Self::PaperStep2(tick_us) => Variant::PaperStep2 { tick_us },
            Self::PaperTickOnly(tick_us) => Variant::PaperTickOnly { tick_us },
            Self::Pixclock | Self::PixclockPps => Variant::STANDARD,
        };
        match self {
            Self::PaperDefaultMixed if index > 0 => Image {
                gps_baud: SLOW_BAUD,
                ..Image::of(variant)
            },
            _ => Image::of(variant),
        }
    }

    /// Its name as a folder's: without the colon, which not every file system takes.
    #[must_use]
    pub fn folder(self) -> String {
        self.to_string().replace(':', "-")
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PaperDefault => f.write_str("paper-default"),
            Self::PaperDefaultMixed => f.write_str("paper-default-mixed"),
            Self::PaperStep1 => f.write_str("paper-step1"),
            Self::PaperStep2(tick_us) => write!(f, "paper-step2:{tick_us}"),
            Self::PaperTickOnly(tick_us) => write!(f, "paper-tick-only:{tick_us}"),
            Self::Pixclock => f.write_str("pixclock"),
            Self::PixclockPps => f.write_str("pixclock-pps"),
        }
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL
            .into_iter()
            .find(|method| method.to_string() == text);
        found.ok_or_else(|| {
            let names = Self::ALL.map(|method| method.to_string()).join(", ");
            format!("'{text}' is no method; allowed: {names}, all")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_method_is_found_by_its_name_and_has_a_folder_of_its_own() {
        for method in Method::ALL {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        let mut folders = Method::ALL.map(Method::folder).to_vec();
        folders.dedup();
        assert_eq!(folders.len(), Method::ALL.len());
        let error = "paper-step2:100".parse::<Method>().unwrap_err();
        assert!(
            error.contains("paper-step2:500, paper-step2:200"),
            "{error}"
        );
    }

    #[test]
    fn only_the_mixed_method_has_unequal_rates_and_only_the_last_one_a_pulse() {
        for method in Method::ALL {
            let is_mixed = method.image(0) != method.image(1);
            assert_eq!(is_mixed, method == Method::PaperDefaultMixed);
            assert_eq!(method.has_pulse(), method == Method::PixclockPps);
            // What the paper argues against it has not measured.
            let has_figure = method.is_papers() && method != Method::PaperTickOnly(50);
            assert_eq!(has_figure, method.paper_ms().is_some());
        }
    }
}
