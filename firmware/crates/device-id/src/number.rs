//! Ids as people and logs write them: `73225`, `73225.0`, `0x11E09`.

use core::str::FromStr;

use crate::error::NotAnId;
use crate::id::DeviceId;

impl FromStr for DeviceId {
    type Err = NotAnId;

    /// Reads a decimal number, with `.0` behind it as PX4's logs have it, or a hexadecimal one
    /// behind `0x`.
    fn from_str(text: &str) -> Result<Self, NotAnId> {
        let hexadecimal = text.strip_prefix("0x").or(text.strip_prefix("0X"));
        let (digits, radix) = match (hexadecimal, text.split_once('.')) {
            (Some(digits), _) => (digits, 16),
            (None, Some((whole, zeros))) if is_zeros(zeros) => (whole, 10),
            (None, _) => (text, 10),
        };
        // `from_str_radix` allows a sign.
        if digits.is_empty() || !digits.chars().all(|digit| digit.is_digit(radix)) {
            return Err(NotAnId::NotANumber);
        }
        // Of digits alone, the one thing that can be wrong is that they are too many.
        let number = u64::from_str_radix(digits, radix).unwrap_or(u64::MAX);
        Self::from_number(number)
    }
}

/// Whether these are zeros, and at least one.
fn is_zeros(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte == b'0')
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;

    use super::*;

    #[test]
    fn decimal_with_point_and_hexadecimal_are_read() {
        for text in ["73225", "73225.0", "73225.000000", "0x11E09", "0X011e09"] {
            assert_eq!(text.parse().map(DeviceId::number), Ok(73_225), "{text}");
        }
        assert_eq!("16777215".parse().map(DeviceId::number), Ok(DeviceId::MAX));
        assert_eq!("0".parse().map(DeviceId::number), Ok(0));
    }

    #[test]
    fn what_is_no_number_and_what_is_too_large_are_distinguished() {
        for wrong in [
            "", "0x", "-1", "+1", "1.5", "1.", "0x1.0", "HMC5883", "1e3", "٣",
        ] {
            assert_eq!(
                wrong.parse::<DeviceId>(),
                Err(NotAnId::NotANumber),
                "{wrong}"
            );
        }
        for (large, number) in [
            ("16777216", 0x100_0000),
            ("0x1000000.", 0),
            ("4294967296.0", 1 << 32),
            ("99999999999999999999", u64::MAX),
        ] {
            let expected = match number {
                0 => NotAnId::NotANumber,
                _ => NotAnId::MoreThan24Bits(number),
            };
            assert_eq!(large.parse::<DeviceId>(), Err(expected), "{large}");
        }
        let refusal = NotAnId::MoreThan24Bits(16_777_216).to_string();
        assert_eq!(refusal, "a number of 25 bits, and a device id has 24");
    }
}
