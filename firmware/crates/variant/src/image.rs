//! A variant on a receiver's line: what the image of one board is built with.

use core::fmt;

use crate::load::Load;
use crate::variant::{DEFAULT_BAUD, Variant};

/// What the image of one board is built with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Image {
    /// How it keeps the clock, and its tick.
    pub variant: Variant,
    /// The rate of the receiver's line, one of [`Variant::gps_bauds`]. \[Bd\]
    pub gps_baud: u32,
    /// What else keeps its core busy.
    pub load: Option<Load>,
}

impl Image {
    /// The baud rate unless another one is asked for. \[Bd\]
    pub const GPS_BAUD: u32 = DEFAULT_BAUD;

    /// What is flashed unless another image is asked for.
    pub const STANDARD: Self = Self::of(Variant::STANDARD);

    /// That variant at 115200 Bd.
    #[must_use]
    pub const fn of(variant: Variant) -> Self {
        Self {
            variant,
            gps_baud: Self::GPS_BAUD,
            load: None,
        }
    }

    /// The image of a board with these values of `PC_VARIANT`, `PC_TICK_US` and `PC_GPS_BAUD`; no
    /// parameter says what else it does, so it is that without a load.
    #[must_use]
    pub fn from_parameters(variant: u32, tick_us: u32, gps_baud: u32) -> Option<Self> {
        let variant = Variant::numbered(variant, tick_us)?;
        let is_allowed = variant.gps_bauds().contains(&gps_baud);
        is_allowed.then_some(Self {
            gps_baud,
            ..Self::of(variant)
        })
    }
}

/// As in `paper-step2 with a tick of 50 µs, the receiver at 115200 Bd, the load px4`.
impl fmt::Display for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, tick_us) = (self.variant.name(), self.variant.tick_us());
        write!(
            f,
            "{name} with a tick of {tick_us} µs, the receiver at {} Bd",
            self.gps_baud
        )?;
        match self.load {
            Some(load) => write!(f, ", the load {load}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_that_no_image_has_are_no_image() {
        assert_eq!(
            Image::from_parameters(0, 50, 115_200),
            Some(Image::STANDARD)
        );
        for (variant, tick_us, gps_baud) in [(5, 50, 115_200), (0, 100, 115_200), (0, 50, 38_400)] {
            assert_eq!(Image::from_parameters(variant, tick_us, gps_baud), None);
        }
    }
}
