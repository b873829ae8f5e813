//! Ids back from the words that they are shown in.

use crate::bus_type::BusType;
use crate::device_type::DeviceType;
use crate::id::DeviceId;

/// The ids that `text` means, which is as `Display` writes them, in whichever case: none when it is
/// not, several when the name belongs to several device types.
///
/// What stands in brackets behind the name is for people and not read.
pub fn in_words(text: &str) -> impl Iterator<Item = DeviceId> {
    let mut parts = text.split(',').map(str::trim);
    let parts = (parts.next(), parts.next(), parts.next(), parts.next());
    let found = match parts {
        (Some(name), Some(place), Some(bus), None) => bus_in_words(bus).and_then(|(kind, bus)| {
            let address = byte(after(place, kind.address_words())?)?;
            Some((name, kind, bus, address))
        }),
        _ => None,
    };
    found.into_iter().flat_map(|(name, kind, bus, address)| {
        types_in_words(name).filter_map(move |it| DeviceId::new(kind, bus, address, it))
    })
}

/// The device types of that name.
fn types_in_words(name: &str) -> impl Iterator<Item = DeviceType> {
    let name = name.split(" (").next().unwrap_or(name).trim();
    let unknown = after(name, "unknown device type").and_then(byte);
    (0..=u8::MAX).map(DeviceType).filter(move |&it| {
        it.is_called(name)
            || unknown == Some(it.0)
            || it == DeviceType::NONE && name.eq_ignore_ascii_case("no device type of PX4's")
    })
}

/// The bus type and the number of the bus.
fn bus_in_words(text: &str) -> Option<(BusType, u8)> {
    BusType::ALL
        .into_iter()
        .find_map(|kind| Some((kind, byte(after(text, kind.bus_words())?)?)))
}

/// What stands in `text` behind `words` and a space.
fn after<'a>(text: &'a str, words: &str) -> Option<&'a str> {
    let (head, rest) = text.split_at_checked(words.len())?;
    let rest = rest.strip_prefix(' ')?;
    head.eq_ignore_ascii_case(words).then_some(rest.trim())
}

/// A number of 8 bits, decimal or hexadecimal.
fn byte(text: &str) -> Option<u8> {
    let number = text.parse().map(DeviceId::number).ok()?;
    number.try_into().ok()
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn every_id_is_among_those_that_its_words_mean() {
        for device_type in (0..=u8::MAX).map(DeviceType) {
            for bus_type in BusType::ALL {
                for (bus, address) in [(0, 0), (1, 0x1E), (31, 255)] {
                    let id = DeviceId::new(bus_type, bus, address, device_type).unwrap();
                    let words = id.to_string();
                    assert!(in_words(&words).any(|it| it == id), "{words}");
                }
            }
        }
    }

    #[test]
    fn a_name_of_several_types_means_several_ids() {
        let found: Vec<_> = in_words("MPU9250, device 4, SPI bus 1").collect();
        let types: Vec<_> = found.iter().map(|it| it.device_type().0).collect();
        assert_eq!(types, [0x04, 0x16, 0x24]);
        assert_eq!(found[0].number(), 263_178);
    }

    #[test]
    fn what_is_not_as_shown_means_nothing() {
        for wrong in [
            "",
            "HMC5883",
            "HMC5883, address 0x1E",
            "HMC5883, address 0x1E, I2C bus 32",
            "HMC5883, address 0x1E, I2C bus 256",
            "HMC5883, address 0x100, I2C bus 1",
            "HMC5883, device 5, I2C bus 1",
            "HMC5883, address 0x1E, I2C bus 1, 2",
            "HMC5883, ädress 1, I2C bus 1",
            "HMC, address 0x1E, I2C bus 1",
        ] {
            assert_eq!(in_words(wrong).next(), None, "{wrong}");
        }
    }
}
