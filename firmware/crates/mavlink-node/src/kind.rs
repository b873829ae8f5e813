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
    shape: Shape,
    is_guarded: bool,
}

/// What the header of a kind has to have, in one word: what CRC_EXTRA adds to the running checksum
/// (bits 0 to 15), the length of its payload in MAVLink 1 (bits 16 to 23) and the least one in MAVLink 2
/// (bits 24 to 31), which is 0 for a kind that is not wanted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape(u32);

impl Shape {
    const NONE: Self = Self(0);
    /// The length in MAVLink 1 of a kind that is not wanted there.
    const NEVER: u8 = u8::MAX;

    pub(crate) const fn extra(self) -> u16 {
        self.0 as u16
    }

    /// The length in MAVLink 1 without extensions.
    #[inline]
    pub(crate) const fn v1_len(self) -> u8 {
        (self.0 >> 16) as u8
    }

    #[inline]
    pub(crate) const fn can_have(self, version: Version, len: u8) -> bool {
        let v2_min_len = (self.0 >> 24) as u8;
        match version {
            Version::V1 => v2_min_len != 0 && self.v1_len() <= len && self.v1_len() != Self::NEVER,
            Version::V2 => v2_min_len != 0 && v2_min_len <= len,
        }
    }
}

impl Kind {
    /// The kind of message `M`.
    ///
    /// `v1_len` is the length of its payload in MAVLink 1, which is without extensions.
    /// `v2_min_len` is the shortest useful payload in MAVLink 2, where trailing zeros are left
    /// out. Both in bytes. Longer payloads are those of a later definition; what is known of them is
    /// their beginning.
    pub(crate) const fn of<M: MessageData>(v1_len: u8, v2_min_len: u8) -> Self {
        assert!(M::ENCODED_LEN < Shape::NEVER as usize && M::ID <= u8::MAX as u32);
        assert!(MIN_PAYLOAD_V1 <= v1_len as usize && v1_len as usize <= M::ENCODED_LEN);
        assert!(1 <= v2_min_len && v2_min_len as usize <= M::ENCODED_LEN);
        let extra = crc::step(0, M::EXTRA_CRC) as u32;
        Self {
            id: M::ID as u8,
            shape: Shape(extra | (v1_len as u32) << 16 | (v2_min_len as u32) << 24),
            is_guarded: false,
        }
    }

    /// The same kind, not wanted in MAVLink 1.
    pub(crate) const fn not_in_v1(self) -> Self {
        Self {
            shape: Shape(self.shape.0 | (Shape::NEVER as u32) << 16),
            ..self
        }
    }

    /// The same kind, which changes something: it is obeyed only outside of what an earlier header
    /// claims.
    pub(crate) const fn guarded(self) -> Self {
        Self {
            is_guarded: true,
            ..self
        }
    }
}

/// Which kinds a framer looks for.
pub trait Wanted {
    /// The kinds, each id once.
    const KINDS: &'static [Kind];
}

/// For each id its shape. So a kind is found in the same few steps, whatever the number of kinds.
#[expect(
    clippy::indexing_slicing,
    reason = "made at compile time, where a panic is an error"
)]
pub(crate) const fn shapes(kinds: &[Kind]) -> [Shape; 256] {
    let mut shapes = [Shape::NONE; 256];
    let mut place = 0;
    while place < kinds.len() {
        let Kind { id, shape, .. } = kinds[place];
        assert!(shapes[id as usize].0 == 0);
        shapes[id as usize] = shape;
        place += 1;
    }
    shapes
}

/// Whether the kind with that id is guarded.
pub(crate) fn is_guarded(kinds: &[Kind], id: u8) -> bool {
    kinds.iter().any(|kind| kind.id == id && kind.is_guarded)
}

/// Whether any kind is guarded.
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
