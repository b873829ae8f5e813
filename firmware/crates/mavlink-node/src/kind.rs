//! The kinds of frames that a framer looks for.
//!
//! *Design.* A kind is an id, its CRC_EXTRA and the lengths that its payload can have. A header
//! that has the id but not the length is noise.

use mavlink::MessageData;

use crate::crc;
use crate::frame::{HEADER_V1, HEADER_V2, Version};

/// The shortest payload that a wanted kind has in MAVLink 1, in bytes:
/// PARAM_REQUEST_LIST, LOG_ERASE and LOG_REQUEST_END.
const MIN_PAYLOAD_V1: usize = 2;

const _: () = assert!(HEADER_V1 + MIN_PAYLOAD_V1 >= crc::MIN_ZEROS && HEADER_V2 >= crc::MIN_ZEROS);

/// A kind of frame that is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    id: u8,
    /// What CRC_EXTRA adds to the running checksum.
    pub(crate) extra: u16,
    /// [`Self::NEVER`] for a kind that is wanted in MAVLink 2 only.
    v1_len: u8,
    v2_min_len: u8,
    v2_max_len: u8,
}

impl Kind {
    /// Greater than the length of any payload here.
    const NEVER: u8 = u8::MAX;

    /// The kind of message `M`.
    ///
    /// `v1_len` is the length of its payload in MAVLink 1, which is without extensions.
    /// `v2_min_len` is the shortest useful payload in MAVLink 2, where trailing zeros are left
    /// out. Both in bytes.
    pub(crate) const fn of<M: MessageData>(v1_len: u8, v2_min_len: u8) -> Self {
        assert!(M::ENCODED_LEN < Self::NEVER as usize && M::ID <= u8::MAX as u32);
        assert!(MIN_PAYLOAD_V1 <= v1_len as usize && v1_len as usize <= M::ENCODED_LEN);
        assert!(1 <= v2_min_len && v2_min_len as usize <= M::ENCODED_LEN);
        Self {
            id: M::ID as u8,
            extra: crc::step(0, M::EXTRA_CRC),
            v1_len,
            v2_min_len,
            v2_max_len: M::ENCODED_LEN as u8,
        }
    }

    /// The same kind, not wanted in MAVLink 1.
    pub(crate) const fn not_in_v1(self) -> Self {
        Self {
            v1_len: Self::NEVER,
            ..self
        }
    }

    const fn is_in_v1(self) -> bool {
        self.v1_len != Self::NEVER
    }

    #[inline]
    pub(crate) const fn can_have(&self, version: Version, len: u8) -> bool {
        match version {
            Version::V1 => len == self.v1_len,
            Version::V2 => self.v2_min_len <= len && len <= self.v2_max_len,
        }
    }
}

/// Which kinds a framer looks for.
pub trait Wanted {
    /// The kinds, each id once.
    const KINDS: &'static [Kind];
}

/// For each id its place in `kinds`, or `u8::MAX` if it is not wanted. So a kind is found in the
/// same few steps, whatever the number of kinds.
#[expect(
    clippy::indexing_slicing,
    reason = "made at compile time, where a panic is an error"
)]
pub(crate) const fn places(kinds: &[Kind], longest: usize) -> [u8; 256] {
    assert!(kinds.len() < 256);
    let mut places = [u8::MAX; 256];
    let mut place = 0;
    while place < kinds.len() {
        let Kind { id, v2_max_len, .. } = kinds[place];
        assert!(places[id as usize] == u8::MAX && v2_max_len as usize <= longest);
        places[id as usize] = place as u8;
        let mut other = 0;
        while other < kinds.len() {
            // See the framer's *Cost*.
            assert!(
                !kinds[place].is_in_v1()
                    || kinds[place].v1_len != kinds[other].id
                    || !kinds[other].is_in_v1()
            );
            other += 1;
        }
        place += 1;
    }
    places
}
