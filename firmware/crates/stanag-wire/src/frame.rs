//! Frames: 16 bytes of wrapper, the data, a sum.

use crate::node_id::NodeId;
use crate::refusal::Refusal;

/// The longest data: with wrapper and sum they fill the 548 bytes of a datagram that nothing divides.
pub const MAX_DATA: usize = 528;
/// The longest frame.
pub const MAX_FRAME: usize = WRAPPER + MAX_DATA + 4;

/// What stands before the data. \[bytes\]
pub(crate) const WRAPPER: usize = 16;
/// "−1, not used": what a frame begins with. Edition 4 has 0 there.
const SEQUENCE: [u8; 2] = [0xFF, 0xFF];
const SEQUENCE_4: [u8; 2] = [0, 0];
/// Bits of Message Properties.
const ACKNOWLEDGE: u16 = 1 << 15;
const IDD_AT: u16 = 8;
const SUM_AT: u16 = 6;

/// What stands behind the data: how long the sum of all bytes before it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sum {
    /// There is none.
    None,
    /// 2 bytes.
    Bytes2,
    /// 4 bytes.
    Bytes4,
    /// No sum but the CRC-32 of ITU-T V.42, 4 bytes: implementations of Edition 4 have it.
    Crc32,
}

impl Sum {
    /// Its length in bytes.
    #[must_use]
    pub const fn length(self) -> usize {
        match self {
            Self::None => 0,
            Self::Bytes2 => 2,
            Self::Bytes4 | Self::Crc32 => 4,
        }
    }

    /// Its value. The sum of 544 bytes needs no more than 18 bits.
    fn of(self, bytes: &[u8]) -> u32 {
        match self {
            Self::None | Self::Bytes2 | Self::Bytes4 => bytes.iter().copied().map(u32::from).sum(),
            Self::Crc32 => crc_32(bytes),
        }
    }

    const fn code(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Bytes2 => 1,
            Self::Bytes4 => 2,
            Self::Crc32 => 3,
        }
    }
}

/// What a wrapper says, beside the length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Who speaks.
    pub source: NodeId,
    /// Who is spoken to.
    pub destination: NodeId,
    /// The number of the message.
    pub message: u16,
    /// Whether #17000 shall be sent for it.
    pub wants_acknowledgement: bool,
    /// The version of the interface's definition: [`Header::EDITION_3`] or [`Header::EDITION_4`].
    pub idd: u8,
    /// The sum behind the data.
    pub sum: Sum,
}

impl Header {
    /// Edition 3's IDD version.
    pub const EDITION_3: u8 = 30;
    /// The IDD version that implementations of Edition 4 send.
    pub const EDITION_4: u8 = 32;

    /// Writes a frame to the beginning of `out`, and returns its length. `None` when the data are
    /// empty or too long, or `out` too short.
    #[must_use]
    pub fn write(&self, data: &[u8], out: &mut [u8]) -> Option<usize> {
        if data.is_empty() || data.len() > MAX_DATA {
            return None;
        }
        let acknowledge = if self.wants_acknowledgement {
            ACKNOWLEDGE
        } else {
            0
        };
        let properties =
            acknowledge | u16::from(self.idd & 0x7F) << IDD_AT | self.sum.code() << SUM_AT;
        let length = u16::try_from(data.len()).ok()?;
        let body = WRAPPER + data.len();
        let whole = out.get_mut(..body + self.sum.length())?;
        let mut rest = &mut *whole;
        for part in [
            &SEQUENCE[..],
            &length.to_be_bytes(),
            &self.source.0.to_be_bytes(),
            &self.destination.0.to_be_bytes(),
            &self.message.to_be_bytes(),
            &properties.to_be_bytes(),
            data,
        ] {
            let (here, after) = rest.split_at_mut_checked(part.len())?;
            here.copy_from_slice(part);
            rest = after;
        }
        let (body, end) = whole.split_at_mut_checked(body)?;
        let sum = self.sum.of(body).to_be_bytes();
        end.copy_from_slice(sum.get(sum.len() - end.len()..)?);
        Some(whole.len())
    }
}

/// A frame that was read: what could be checked is right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Its wrapper.
    pub header: Header,
    /// Its data, presence vector included.
    pub data: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Reads the frame at the beginning of `bytes`, and returns it with what is behind it: several may
    /// follow each other in one datagram.
    ///
    /// # Errors
    ///
    /// Says what is wrong with it. `Short` alone can become right by more bytes.
    pub fn read(bytes: &'a [u8]) -> Result<(Self, &'a [u8]), Refusal> {
        let (wrapper, _) = bytes.split_first_chunk::<WRAPPER>().ok_or(Refusal::Short)?;
        let [s0, s1, l0, l1, a, b, c, d, e, f, g, h, m0, m1, p0, p1] = *wrapper;
        let properties = u16::from_be_bytes([p0, p1]);
        let idd = p0 & 0x7F;
        if ![SEQUENCE, SEQUENCE_4].contains(&[s0, s1]) {
            return Err(Refusal::NoWrapper);
        }
        let length = u16::from_be_bytes([l0, l1]);
        if !(1..=MAX_DATA).contains(&usize::from(length)) {
            return Err(Refusal::Length(length));
        }
        let sum = match (idd, properties >> SUM_AT & 0b11) {
            (Header::EDITION_3 | Header::EDITION_4, 0) => Sum::None,
            (Header::EDITION_3, 1) => Sum::Bytes2,
            (Header::EDITION_3, 2) => Sum::Bytes4,
            (Header::EDITION_4, 3) => Sum::Crc32,
            (Header::EDITION_3 | Header::EDITION_4, _) => return Err(Refusal::SumCode),
            _ => return Err(Refusal::Idd(idd)),
        };
        let body_length = WRAPPER + usize::from(length);
        let (body, rest) = bytes.split_at_checked(body_length).ok_or(Refusal::Short)?;
        let (end, rest) = rest.split_at_checked(sum.length()).ok_or(Refusal::Short)?;
        let expected = sum.of(body).to_be_bytes();
        if !expected.ends_with(end) {
            return Err(Refusal::Sum);
        }
        let header = Header {
            source: NodeId(u32::from_be_bytes([a, b, c, d])),
            destination: NodeId(u32::from_be_bytes([e, f, g, h])),
            message: u16::from_be_bytes([m0, m1]),
            wants_acknowledgement: properties & ACKNOWLEDGE != 0,
            idd,
            sum,
        };
        let data = body.get(WRAPPER..).unwrap_or_default();
        Ok((Self { header, data }, rest))
    }
}

/// The polynomial of ITU-T V.42, lowest bit first.
const V_42: u32 = 0xEDB8_8320;

/// Bit by bit: nobody asks for it often.
fn crc_32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| match crc & 1 {
            0 => crc >> 1,
            _ => crc >> 1 ^ V_42,
        })
    })
}
