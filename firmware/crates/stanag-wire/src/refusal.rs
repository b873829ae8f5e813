//! Why bytes are no frame, or its data no message.

use core::fmt;

/// Why bytes are no frame, or its data no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The first two bytes are neither ffff nor 0000, so it is no frame of Editions 3 and 4.
    NoWrapper,
    /// The bytes end before the frame does.
    Short,
    /// A length of 0, or above the 528 bytes that fit a datagram.
    Length(u16),
    /// An IDD version that is not read here: 40 in a frame of an edition that does not exist yet.
    Idd(u8),
    /// A checksum code that the edition does not have.
    SumCode,
    /// The sum is another one.
    Sum,
    /// The data are shorter than their presence vector says, or longer though it has no unknown bit.
    Data,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoWrapper => f.write_str("no wrapper of STANAG 4586, Edition 3 or 4"),
            Self::Short => f.write_str("the frame is cut off"),
            Self::Length(length) => write!(f, "{length} bytes of data, allowed are 1 to 528"),
            Self::Idd(idd) => write!(f, "IDD version {idd} is not spoken here"),
            Self::SumCode => f.write_str("a checksum that this edition does not have"),
            Self::Sum => f.write_str("the sum is wrong"),
            Self::Data => f.write_str("the length is not what the presence vector says"),
        }
    }
}

impl core::error::Error for Refusal {}
