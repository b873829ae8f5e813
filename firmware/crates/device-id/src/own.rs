//! The devices of pixclock's board.
//!
//! *Design.* A receiver has PX4's id: its line and its generation. What PX4 has no bus type for (the card, USB) has
//! bus type 0, a number of ours for an address, and [`DeviceType::NONE`].

use crate::bus_type::BusType;
use crate::device_type::DeviceType;
use crate::id::{DeviceId, MAX_BUS};

impl DeviceId {
    /// The memory card. Ours.
    pub const CARD: Self = Self::own(1);
    /// USB. Ours.
    pub const USB: Self = Self::own(2);

    const fn own(address: u8) -> Self {
        Self::of_parts(BusType::Unknown, 0, address, DeviceType::NONE)
    }

    /// A receiver at the serial line that PX4 calls `ttyS` and this number, modulo 32.
    #[must_use]
    pub const fn receiver(line: u8, device_type: DeviceType) -> Self {
        Self::of_parts(BusType::Serial, line & MAX_BUS, 0, device_type)
    }
}

/// How a device is: what its parameter has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// 0: nothing has come from it, or it was not used yet.
    Unknown,
    /// 1: it works.
    Works,
    /// 2: it does not, or cannot be used.
    Fails,
}

impl Condition {
    /// Its number.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// What a number means.
    #[must_use]
    pub const fn of_number(number: u8) -> Option<Self> {
        match number {
            0 => Some(Self::Unknown),
            1 => Some(Self::Works),
            2 => Some(Self::Fails),
            _ => None,
        }
    }

    /// In a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Unknown => "not seen",
            Self::Works => "works",
            Self::Fails => "fails",
        }
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;

    use super::*;

    #[test]
    fn what_px4_has_no_bus_for_is_of_bus_type_0_and_no_type_of_its() {
        for (id, number) in [(DeviceId::CARD, 0xFF_01_00), (DeviceId::USB, 0xFF_02_00)] {
            assert_eq!(id.number(), number);
            assert_eq!(id.bus_type(), BusType::Unknown);
            assert_eq!(id.device_type(), DeviceType::NONE);
        }
    }

    #[test]
    fn a_receiver_is_at_its_line() {
        let id = DeviceId::receiver(3, DeviceType(0xA8));
        assert_eq!(id.number(), 0xA8_00_1D);
        assert_eq!(id.to_string(), "u-blox 8, address 0x00, serial port 3");
    }

    #[test]
    fn conditions_are_their_numbers() {
        for number in 0..3 {
            let condition = Condition::of_number(number).unwrap();
            assert_eq!(condition.number(), number);
        }
        assert_eq!(Condition::of_number(3), None);
    }
}
