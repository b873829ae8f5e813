//! What a device is connected by.

/// What a device is connected by: 3 bits, numbered as in PX4's `Device.hpp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusType {
    /// 0: PX4 does not say, or has no number for it.
    Unknown,
    /// 1.
    I2c,
    /// 2.
    Spi,
    /// 3: UAVCAN, now DroneCAN.
    Can,
    /// 4: nowhere; a simulation.
    Simulation,
    /// 5.
    Serial,
    /// 6: another system, by MAVLink.
    Mavlink,
    /// 7: PX4 gives this number to nothing.
    Unassigned,
}

impl BusType {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Unknown,
        Self::I2c,
        Self::Spi,
        Self::Can,
        Self::Simulation,
        Self::Serial,
        Self::Mavlink,
        Self::Unassigned,
    ];

    /// Its number, 0 to 7.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Self::Unknown => 0,
            Self::I2c => 1,
            Self::Spi => 2,
            Self::Can => 3,
            Self::Simulation => 4,
            Self::Serial => 5,
            Self::Mavlink => 6,
            Self::Unassigned => 7,
        }
    }

    /// The bus type in the lowest 3 bits of `bits`.
    #[must_use]
    pub(crate) const fn in_bits(bits: u32) -> Self {
        let [
            unknown,
            i2c,
            spi,
            can,
            simulation,
            serial,
            mavlink,
            unassigned,
        ] = Self::ALL;
        match bits & 0b111 {
            0 => unknown,
            1 => i2c,
            2 => spi,
            3 => can,
            4 => simulation,
            5 => serial,
            6 => mavlink,
            _ => unassigned,
        }
    }

    /// What stands before the number of the bus when an id is shown.
    #[must_use]
    pub const fn bus_words(self) -> &'static str {
        match self {
            Self::Unknown => "unknown bus",
            Self::I2c => "I2C bus",
            Self::Spi => "SPI bus",
            Self::Can => "DroneCAN bus",
            Self::Simulation => "simulation",
            Self::Serial => "serial port",
            Self::Mavlink => "MAVLink channel",
            Self::Unassigned => "bus of type 7",
        }
    }

    /// What stands before the address when an id is shown.
    #[must_use]
    pub const fn address_words(self) -> &'static str {
        match self {
            Self::Spi => "device",
            Self::Can => "node",
            _ => "address",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_the_place_in_the_list() {
        for (number, bus_type) in BusType::ALL.into_iter().enumerate() {
            assert_eq!(usize::from(bus_type.number()), number);
            assert_eq!(BusType::in_bits(0xF8 | number as u32), bus_type);
        }
    }
}
