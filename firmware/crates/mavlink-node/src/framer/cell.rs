//! What is kept of each position of the stream, packed: it is stored for every byte.

use crate::crc;

/// One position of the stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// The stamp of the byte. Before it has come: the [`Candidate`] that ends there, if `word` has
    /// [`Word::END`].
    pub(super) first: u32,
    /// The byte and the running checksum before it. Before it has come: what is
    /// to be done there.
    pub(super) word: Word,
}

/// A running checksum (bits 0 to 15), a byte (bits 16 to 23) and what is due (bits 24 to 31):
/// packed, because all three are stored for every byte.
#[derive(Clone, Copy, Debug)]
pub(super) struct Word(pub(super) u32);

impl Word {
    /// A candidate ends at this byte.
    pub(super) const END: u32 = 1 << 24;
    /// The header of a MAVLink 1 frame may be complete at this byte.
    pub(super) const HEADER_V1: u32 = 1 << 25;
    /// The header of a MAVLink 2 frame may be complete at this byte.
    pub(super) const HEADER_V2: u32 = 1 << 26;
    /// A frame whose checksum holds has begun at this byte, which has come.
    pub(super) const INTACT: u32 = 1 << 31;

    pub(super) const fn new(crc: u16, byte: u8) -> Self {
        Self(crc as u32 | (byte as u32) << 16)
    }

    pub(super) const fn crc(self) -> u16 {
        self.0 as u16
    }

    pub(super) const fn byte(self) -> u8 {
        (self.0 >> 16) as u8
    }

    pub(super) const fn is_due(self, what: u32) -> bool {
        self.0 & what != 0
    }
}

/// A window whose header is that of a wanted frame: the [`remainder`] that it needs at its last
/// byte (bits 0 to 15), its length (bits 16 to 23), and whether it displaced another candidate with
/// the same end (bit 24).
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate(pub(super) u32);

impl Candidate {
    pub(super) const DISPLACED_ANOTHER: u32 = 1 << 24;

    pub(super) const fn length(self) -> u8 {
        (self.0 >> 16) as u8
    }

    pub(super) const fn remainder(self) -> u16 {
        self.0 as u16
    }

    pub(super) const fn displaced_another(self) -> bool {
        self.0 & Self::DISPLACED_ANOTHER != 0
    }

    /// The only one with its end, and not intact: the common case in noise.
    pub(super) const fn is_alone_and_not(self, remainder: u16) -> bool {
        !self.displaced_another() && self.remainder() != remainder
    }
}

/// What is left of a stream at the end of a frame: the running checksum before the frame's own
/// checksum, moved over one byte more, less the frame's own. `crc` is the running checksum between
/// the two bytes of `own`.
pub(super) const fn remainder(crc: u16, own: [u8; 2]) -> u16 {
    crc ^ crc::step(0, own[0]) ^ u16::from_le_bytes(own)
}
