//! The kinds of frames that a framer looks for.
//!
//! *Design.* A kind is an id, its CRC_EXTRA and the least lengths that its payload can have. A header
//! that has the id but a shorter payload is no frame of it.

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
    v1_len: u16,
    v2_min_len: u8,
    /// It is obeyed only outside of what an earlier header claims.
    pub(crate) is_guarded: bool,
}

impl Kind {
    /// Greater than the length of any payload.
    const NEVER: u16 = 1 << 8;

    /// The kind of message `M`.
    ///
    /// `v1_len` is the length of its payload in MAVLink 1, which is without extensions.
    /// `v2_min_len` is the shortest useful payload in MAVLink 2, where trailing zeros are left
    /// out. Both in bytes. Longer payloads are those of a later definition; what is known of them is
    /// their beginning.
    pub(crate) const fn of<M: MessageData>(v1_len: u8, v2_min_len: u8) -> Self {
        assert!(M::ENCODED_LEN < Self::NEVER as usize && M::ID <= u8::MAX as u32);
        assert!(MIN_PAYLOAD_V1 <= v1_len as usize && v1_len as usize <= M::ENCODED_LEN);
        assert!(1 <= v2_min_len && v2_min_len as usize <= M::ENCODED_LEN);
        Self {
            id: M::ID as u8,
            extra: crc::step(0, M::EXTRA_CRC),
            v1_len: v1_len as u16,
            v2_min_len,
            is_guarded: false,
        }
    }

    /// The same kind, not wanted in MAVLink 1.
    pub(crate) const fn not_in_v1(self) -> Self {
        Self {
            v1_len: Self::NEVER,
            ..self
        }
    }

    /// The same kind, which changes something.
    pub(crate) const fn guarded(self) -> Self {
        Self {
            is_guarded: true,
            ..self
        }
    }

    #[inline]
    pub(crate) const fn can_have(&self, version: Version, len: u8) -> bool {
        match version {
            Version::V1 => len as u16 >= self.v1_len,
            Version::V2 => len >= self.v2_min_len,
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
pub(crate) const fn places(kinds: &[Kind]) -> [u8; 256] {
    assert!(kinds.len() < 256);
    let mut places = [u8::MAX; 256];
    let mut place = 0;
    while place < kinds.len() {
        let id = kinds[place].id as usize;
        assert!(places[id] == u8::MAX);
        places[id] = place as u8;
        place += 1;
    }
    places
}

/// Whether one of them is obeyed only outside of what an earlier header claims.
#[expect(
    clippy::indexing_slicing,
    reason = "made at compile time, where a panic is an error"
)]
pub(crate) const fn any_is_guarded(kinds: &[Kind]) -> bool {
    let mut place = 0;
    while place < kinds.len() {
        if kinds[place].is_guarded {
            return true;
        }
        place += 1;
    }
    false
}
