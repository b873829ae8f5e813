//! What is no device id.

use core::fmt;

/// Why a text or number is no device id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotAnId {
    /// It is no whole number from 0 up, neither decimal nor hexadecimal.
    NotANumber,
    /// It is one, but an id has 24 bits. Anything above 64 bits is held as `u64::MAX`.
    MoreThan24Bits(u64),
}

impl fmt::Display for NotAnId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotANumber => f.write_str("no whole number from 0 to 16777215"),
            Self::MoreThan24Bits(number) => {
                let bits = u64::BITS - number.leading_zeros();
                write!(f, "a number of {bits} bits, and a device id has 24")
            }
        }
    }
}

impl core::error::Error for NotAnId {}
