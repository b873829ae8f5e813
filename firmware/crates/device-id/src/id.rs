//! The 24 bits: bus type 3, bus 5, address 8, device type 8, from the lowest.

use core::fmt;

use crate::bus_type::BusType;
use crate::device_type::DeviceType;
use crate::error::NotAnId;

/// The greatest number of a bus.
pub(crate) const MAX_BUS: u8 = 31;

/// Where the fields above the bus type begin.
const BUS_AT: u32 = 3;
const ADDRESS_AT: u32 = 8;
const DEVICE_TYPE_AT: u32 = 16;

/// The id of a device, 24 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DeviceId(u32);

impl DeviceId {
    /// The greatest number that is an id.
    pub const MAX: u32 = 0xFF_FFFF;

    /// The id of these parts. `None` for a `bus` above 31.
    #[must_use]
    pub const fn new(
        bus_type: BusType,
        bus: u8,
        address: u8,
        device_type: DeviceType,
    ) -> Option<Self> {
        if bus > MAX_BUS {
            return None;
        }
        Some(Self::of_parts(bus_type, bus, address, device_type))
    }

    /// The same of a `bus` up to [`MAX_BUS`].
    pub(crate) const fn of_parts(
        bus_type: BusType,
        bus: u8,
        address: u8,
        device_type: DeviceType,
    ) -> Self {
        let [bus, address, device_type] = [bus as u32, address as u32, device_type.0 as u32];
        Self(
            bus_type.number() as u32
                | bus << BUS_AT
                | address << ADDRESS_AT
                | device_type << DEVICE_TYPE_AT,
        )
    }

    /// The id of that number.
    ///
    /// # Errors
    ///
    /// When it has more than 24 bits.
    pub const fn from_number(number: u64) -> Result<Self, NotAnId> {
        if number > Self::MAX as u64 {
            return Err(NotAnId::MoreThan24Bits(number));
        }
        Ok(Self(number as u32))
    }

    /// The number that PX4's parameters have.
    #[must_use]
    pub const fn number(self) -> u32 {
        self.0
    }

    /// What it is connected by.
    #[must_use]
    pub const fn bus_type(self) -> BusType {
        BusType::in_bits(self.0)
    }

    /// Which of the buses of that type, 0 to 31.
    #[must_use]
    pub const fn bus(self) -> u8 {
        self.byte(BUS_AT) & MAX_BUS
    }

    /// Where on the bus: the I2C address, the SPI select, the CAN node.
    #[must_use]
    pub const fn address(self) -> u8 {
        self.byte(ADDRESS_AT)
    }

    /// What it is.
    #[must_use]
    pub const fn device_type(self) -> DeviceType {
        DeviceType(self.byte(DEVICE_TYPE_AT))
    }

    const fn byte(self, at: u32) -> u8 {
        (self.0 >> at & 0xFF) as u8
    }
}

/// In words: `HMC5883, address 0x1E, I2C bus 1`.
impl fmt::Display for DeviceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bus_type = self.bus_type();
        write!(f, "{}, {} ", self.device_type(), bus_type.address_words())?;
        match bus_type {
            BusType::Spi | BusType::Can => write!(f, "{}", self.address())?,
            _ => write!(f, "0x{:02X}", self.address())?,
        }
        write!(f, ", {} {}", bus_type.bus_words(), self.bus())
    }
}

/// As bits, with a gap between fields: device type, address, bus, bus type.
impl fmt::Binary for DeviceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (device_type, bus_type) = (self.device_type().0, self.bus_type().number());
        let (address, bus) = (self.address(), self.bus());
        write!(
            f,
            "{device_type:08b} {address:08b} {bus:05b} {bus_type:03b}"
        )
    }
}

#[cfg(test)]
mod tests {
    use std::format;
    use std::string::ToString as _;

    use super::*;

    /// The examples of PX4's guide.
    #[test]
    fn the_guides_examples() {
        for (number, bus_type, bus, address, device_type, words, bits) in [
            (
                73_225,
                BusType::I2c,
                1,
                0x1E,
                0x01,
                "HMC5883, address 0x1E, I2C bus 1",
                "00000001 00011110 00001 001",
            ),
            (
                66_826,
                BusType::Spi,
                1,
                5,
                0x01,
                "HMC5883, device 5, SPI bus 1",
                "00000001 00000101 00001 010",
            ),
            (
                263_178,
                BusType::Spi,
                1,
                4,
                0x04,
                "MPU9250 (AK8963 in today's PX4), device 4, SPI bus 1",
                "00000100 00000100 00001 010",
            ),
        ] {
            let id = DeviceId::from_number(number).unwrap();
            let parts = (id.bus_type(), id.bus(), id.address(), id.device_type().0);
            assert_eq!(parts, (bus_type, bus, address, device_type));
            let again = DeviceId::new(bus_type, bus, address, DeviceType(device_type));
            assert_eq!(again, Some(id));
            assert_eq!(id.to_string(), words);
            assert_eq!(format!("{id:b}"), bits);
        }
    }

    #[test]
    fn parts_make_the_number_that_they_were_taken_from() {
        for number in 0..=DeviceId::MAX {
            let id = DeviceId::from_number(number.into()).unwrap();
            let again = DeviceId::new(id.bus_type(), id.bus(), id.address(), id.device_type());
            assert_eq!(again.map(DeviceId::number), Some(number));
        }
    }

    #[test]
    fn what_has_no_room_is_refused() {
        let too_much = NotAnId::MoreThan24Bits(0x100_0000);
        assert_eq!(DeviceId::from_number(0x100_0000), Err(too_much));
        assert_eq!(DeviceId::new(BusType::I2c, 32, 0, DeviceType(1)), None);
    }

    #[test]
    fn an_unknown_type_is_an_id_all_the_same() {
        let id = DeviceId::new(BusType::Serial, 4, 0, DeviceType(0x10)).unwrap();
        let words = "unknown device type 0x10, address 0x00, serial port 4";
        assert_eq!(id.to_string(), words);
        let ours = DeviceId::new(BusType::Unknown, 0, 1, DeviceType::NONE).unwrap();
        let words = "no device type of PX4's, address 0x01, unknown bus 0";
        assert_eq!(ours.to_string(), words);
    }
}
