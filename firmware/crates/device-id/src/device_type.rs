//! What a device is.

use core::fmt;

use crate::names::{GUIDE, Name, TODAY, find};

/// What a device is: 8 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DeviceType(pub u8);

impl DeviceType {
    /// What no list of PX4's has a number for: its source calls it unused. pixclock's own devices
    /// without one (the card, USB) have it together with bus type 0.
    pub const NONE: Self = Self(0xFF);

    /// The types that have a name, in the order of their numbers.
    pub fn named() -> impl Iterator<Item = Self> {
        (0..=u8::MAX)
            .map(Self)
            .filter(|it| it.in_guide().or(it.today()).is_some())
    }

    /// What PX4's guide calls it.
    #[must_use]
    pub fn in_guide(self) -> Option<Name> {
        find(GUIDE, self.0)
    }

    /// What today's PX4 calls it.
    #[must_use]
    pub fn today(self) -> Option<Name> {
        find(TODAY, self.0)
    }

    /// Whether one of the two lists calls it `name`, in whichever case.
    #[must_use]
    pub fn is_called(self, name: &str) -> bool {
        [self.in_guide(), self.today()]
            .into_iter()
            .flatten()
            .any(|it| it.name.eq_ignore_ascii_case(name))
    }
}

/// The guide's name, today's beside it where it is another one; without a name, the number.
impl fmt::Display for DeviceType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.in_guide(), self.today()) {
            (Some(guide), Some(today)) if guide.name != today.name => {
                write!(f, "{} ({} in today's PX4)", guide.name, today.name)
            }
            (Some(it), _) | (None, Some(it)) => f.write_str(it.name),
            (None, None) if *self == Self::NONE => f.write_str("no device type of PX4's"),
            (None, None) => write!(f, "unknown device type 0x{:02X}", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;

    use super::*;

    #[test]
    fn both_names_are_shown_where_they_differ() {
        for (number, shown) in [
            (0x01, "HMC5883"),
            (0x02, "LSM303D"),
            (0x04, "MPU9250 (AK8963 in today's PX4)"),
            (0x12, "BMA180 (LSM6DSV in today's PX4)"),
            (0x21, "MPU6000"),
            (0xA5, "u-blox"),
            (0xA8, "u-blox 8"),
            (0x10, "unknown device type 0x10"),
            (0xFF, "no device type of PX4's"),
        ] {
            assert_eq!(DeviceType(number).to_string(), shown);
        }
    }

    #[test]
    fn a_name_is_found_in_either_list_and_case() {
        let called = |name| DeviceType::named().filter(move |it| it.is_called(name));
        let numbers = |name| called(name).map(|it| it.0).collect::<std::vec::Vec<_>>();
        assert_eq!(numbers("mpu9250"), [0x04, 0x16, 0x24]);
        assert_eq!(numbers("AK8963"), [0x04]);
        assert_eq!(numbers("LL40LS"), [0x32, 0x70]);
        assert_eq!(numbers("nothing"), []);
    }
}
