//! A frame to send, and the sequence numbers of a sender.
//!
//! *Purpose.* Turns a payload into the bytes of a MAVLink 1 or 2 frame.
//!
//! *Design.* MAVLink 1: `FE len seq sys comp id payload crc`. MAVLink 2: `FD len
//! incompat compat seq sys comp id×3 payload crc`, trailing zeros of the payload
//! left out except for the first byte (MAVLink guide, "Packet serialization"). The
//! header is written in front of the payload, which `mavlink` puts in its place.
//!
//! *Limits.* Nothing is signed. The longest message here is LOG_DATA.

use core::ops::Deref;

use mavlink::{MavlinkVersion, MessageData};

use crate::crc;

/// First byte of a MAVLink 1 frame.
pub(crate) const MAGIC_V1: u8 = 0xfe;
/// First byte of a MAVLink 2 frame.
pub(crate) const MAGIC_V2: u8 = 0xfd;
/// Bytes before the payload, MAVLink 1.
pub(crate) const HEADER_V1: usize = 6;
/// Bytes before the payload, MAVLink 2.
pub(crate) const HEADER_V2: usize = 10;
/// Bytes of the checksum after the payload.
pub(crate) const CRC_LEN: usize = 2;

/// The longest payload that is sent, in bytes: LOG_DATA.
const MAX_PAYLOAD: usize = 97;

/// The version of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Version {
    /// MAVLink 1.
    V1,
    /// MAVLink 2.
    V2,
}

impl Version {
    const fn header_len(self) -> usize {
        match self {
            Self::V1 => HEADER_V1,
            Self::V2 => HEADER_V2,
        }
    }
}

impl From<Version> for MavlinkVersion {
    fn from(version: Version) -> Self {
        match version {
            Version::V1 => Self::V1,
            Version::V2 => Self::V2,
        }
    }
}

/// The sender of a frame, or its receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Address {
    /// System, 1 to 255; 0 as a target means all systems.
    pub system: u8,
    /// Component; 0 as a target means all components.
    pub component: u8,
}

/// The bytes of one frame, ready to be sent.
#[derive(Clone, Copy)]
pub struct Frame {
    bytes: [u8; Self::CAPACITY],
    len: u8,
}

impl Frame {
    /// The longest frame that this crate sends, in bytes.
    pub const CAPACITY: usize = HEADER_V2 + MAX_PAYLOAD + CRC_LEN;
}

impl Deref for Frame {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or_default()
    }
}

impl core::fmt::Debug for Frame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:02x?}", &**self)
    }
}

/// One end of a line: its address and the number of its next frame.
#[derive(Debug)]
pub(crate) struct Sender {
    address: Address,
    sequence: u8,
}

impl Sender {
    pub(crate) const fn new(address: Address) -> Self {
        Self {
            address,
            sequence: 0,
        }
    }

    pub(crate) const fn address(&self) -> Address {
        self.address
    }

    /// The next frame, with `message` as its payload.
    pub(crate) fn message<M: MessageData>(&mut self, version: Version, message: &M) -> Frame {
        const { assert!(M::ENCODED_LEN <= MAX_PAYLOAD) };
        self.frame(version, M::ID, M::EXTRA_CRC, |payload| {
            message.ser(version.into(), payload)
        })
    }

    /// The next frame, of a payload that is made by hand, with its extensions; without them it has
    /// `v1_len` bytes. Trailing zeros are left out in MAVLink 2.
    #[inline(never)]
    pub(crate) fn bytes(
        &mut self,
        version: Version,
        (id, crc_extra): (u32, u8),
        bytes: &[u8],
        v1_len: usize,
    ) -> Frame {
        self.frame(version, id, crc_extra, |payload| {
            for (place, byte) in payload.iter_mut().zip(bytes) {
                *place = *byte;
            }
            match version {
                Version::V1 => v1_len,
                Version::V2 => bytes
                    .iter()
                    .rposition(|&byte| byte != 0)
                    .map_or(1, |last| last + 1),
            }
        })
    }

    /// The next frame; `fill` writes the payload and returns its length. An id above 255 is for
    /// MAVLink 2.
    #[inline]
    pub(crate) fn frame(
        &mut self,
        version: Version,
        id: u32,
        crc_extra: u8,
        fill: impl FnOnce(&mut [u8; MAX_PAYLOAD]) -> usize,
    ) -> Frame {
        let mut frame = Frame {
            bytes: [0; Frame::CAPACITY],
            len: 0,
        };
        let header_len = version.header_len();
        if let Some(payload) = frame.bytes.get_mut(header_len..)
            && let Some(payload) = payload.first_chunk_mut()
        {
            let payload_len = fill(payload).min(MAX_PAYLOAD);
            self.seal(&mut frame, version, id, crc_extra, payload_len);
        }
        frame
    }

    /// Writes the header before the payload of `frame` and the checksum behind it. Not inlined, or
    /// each kind of message would have its own copy.
    #[inline(never)]
    fn seal(
        &mut self,
        frame: &mut Frame,
        version: Version,
        id: u32,
        crc_extra: u8,
        payload_len: usize,
    ) {
        let [low, middle, high, _] = id.to_le_bytes();
        let Address { system, component } = self.address;
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);

        let length = payload_len as u8;
        match version {
            Version::V1 => {
                if let Some(header) = frame.bytes.first_chunk_mut::<HEADER_V1>() {
                    *header = [MAGIC_V1, length, sequence, system, component, low];
                }
            }
            Version::V2 => {
                if let Some(header) = frame.bytes.first_chunk_mut::<HEADER_V2>() {
                    *header = [
                        MAGIC_V2, length, 0, 0, sequence, system, component, low, middle, high,
                    ];
                }
            }
        }

        let end = version.header_len() + payload_len;
        let covered = frame.bytes.get(1..end).unwrap_or_default();
        let sum = crc::step(crc::over(crc::INIT, covered), crc_extra);
        if let Some(place) = frame.bytes.get_mut(end..end + CRC_LEN) {
            place.copy_from_slice(&sum.to_le_bytes());
        }
        frame.len = (end + CRC_LEN) as u8;
    }
}
