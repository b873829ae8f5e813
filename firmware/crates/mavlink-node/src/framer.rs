//! Finds the wanted frames in a stream of bytes, whatever else is in it.
//!
//! *Purpose.* Takes byte by byte, and hands over each intact frame of the wanted kinds at its last
//! byte, with the stamp of its first.
//!
//! *Design.* Every magic byte may start a frame. Six bytes later (MAVLink 1; ten in MAVLink 2) the
//! header is complete. If it has a wanted [`Kind`](crate::kind::Kind) with a length that this kind
//! can have, the window is a *candidate*. All candidates are kept at once and none waits for
//! another, so a false start or a false length delays no frame. A candidate is checked at its last
//! byte, from the running checksum (see `crc.rs`) and not from its bytes.
//!
//! Found frames do not overlap: a frame that is found discards what began before its end, and of
//! two that end together the longer one counts. So frames are found in the order of their ends.
//! That is the order of their starts, unless an intact frame lies wholly inside another: then the
//! inner one is found, because it must not wait for an outer one of which nothing is proved yet.
//! The 13 bytes of a signature belong to their frame, which is handed over before they arrive.
//!
//! *Cost.* Each byte is stored and goes through the running checksum once. More is done only
//! where a header may be complete or a candidate ends, and each of these is a fixed number of
//! steps, because a checksum over any window is one. How often can that be?
//!
//! - A start is noted where a magic and a possible length follow each other: at most at every
//!   second byte.
//! - A candidate of MAVLink 1 needs a magic, a length and an id. No value can serve as two of
//!   them, so no two candidates share one of these bytes: there is at most one candidate in three
//!   bytes, `FE 0E 04` repeated. (PARAM_REQUEST_READ, with length 20 and id 20, and PARAM_SET, with
//!   23 and 23, would make it one in two bytes. They are not wanted in MAVLink 1; a table of kinds
//!   with another such pair does not compile.)
//! - A candidate of MAVLink 2 needs a magic, a length, and zeros where the next candidates would
//!   have theirs: at most one in five bytes.
//!
//! Measured with the bytes taken out of a queue, on a Cortex-M4: 43 instructions a byte of random
//! bytes, 79 a byte of the worst stream, where every second end is that of two candidates.
//!
//! *Limits.* A frame inside the payload of an unwanted one (a tunnel) is found too. Positions are
//! counted modulo 2^32.

use core::marker::PhantomData;

use timebase::{Stamp, StampedByte};

use crate::crc;
use crate::frame::{Address, CRC_LEN, HEADER_V1, HEADER_V2, MAGIC_V1, MAGIC_V2, Version};
use crate::kind::{Wanted, places};

/// The longest payload that a node wants, in bytes: COMMAND_INT.
pub const MAX_PAYLOAD: usize = 35;

/// The incompatibility flag of a signed frame; any other one is unknown here.
const SIGNED: u8 = 0x01;

/// Bytes of a signature after the frame's checksum.
const SIGNATURE_LEN: usize = 13;

/// An intact frame, its checksum held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delimited<const PAYLOAD: usize = MAX_PAYLOAD> {
    /// The stamp of its first byte.
    pub stamp: Stamp,
    /// The version that it is in.
    pub version: Version,
    /// It carries a signature, which is not checked.
    pub signed: bool,
    /// Who sent it.
    pub from: Address,
    /// Its message id.
    pub id: u8,
    /// Its payload, extended with zeros.
    pub payload: [u8; PAYLOAD],
}

/// What a framer has found so far. All wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FramingCounters {
    /// Frames that were handed over.
    pub frames: u32,
    /// Bytes that are in no such frame: foreign messages, noise, signatures, and
    /// the frame that is arriving.
    pub foreign_bytes: u32,
    /// Candidates whose checksum failed: damaged frames and false starts.
    pub crc_failures: u32,
    /// Candidates that were given up, because the line fell silent before their ends.
    pub abandoned: u32,
    /// Headers of a wanted kind with an unknown incompatibility flag; such frames must be dropped
    /// (MAVLink guide, "Packet serialization").
    pub unknown_flags: u32,
    /// Frames that carried a signature, among those handed over.
    pub signed: u32,
}

impl FramingCounters {
    /// Nothing was found.
    pub const ZERO: Self = Self {
        frames: 0,
        foreign_bytes: 0,
        crc_failures: 0,
        abandoned: 0,
        unknown_flags: 0,
        signed: 0,
    };
}

/// Looks for the frames that `W` wants, with payloads of up to `PAYLOAD` bytes. `RING` is the
/// number of positions that have a cell, a power of two: room for the bytes of the longest frame
/// that is arriving, and for the ends of candidates that begin in it.
#[derive(Debug)]
pub struct Framer<W, const PAYLOAD: usize = MAX_PAYLOAD, const RING: usize = 128> {
    cells: Ring<Cell, RING>,
    /// By start of a candidate: another one with the same end.
    displaced: Ring<Candidate, RING>,
    /// The number of bytes that have come: the position of the next one.
    position: u32,
    /// The running checksum after the last byte.
    crc: u16,
    /// The last byte.
    last: u8,
    /// The first position after the last frame that was found.
    free_from: u32,
    /// The position at which what had begun was last given up.
    given_up_at: u32,
    framed_bytes: u32,
    counters: FramingCounters,
    wanted: PhantomData<W>,
}

/// One position of the stream.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// The stamp of the byte. Before it has come: the [`Candidate`] that ends there, if `word` has
    /// [`Word::END`].
    first: u32,
    /// The byte and the running checksum before it. Before it has come: what is
    /// to be done there.
    word: Word,
}

/// A running checksum (bits 0 to 15), a byte (bits 16 to 23) and what is due (bits 24 to 31):
/// packed, because all three are stored for every byte.
#[derive(Clone, Copy, Debug)]
struct Word(u32);

impl Word {
    /// A candidate ends at this byte.
    const END: u32 = 1 << 24;
    /// The header of a MAVLink 1 frame may be complete at this byte.
    const HEADER_V1: u32 = 1 << 25;
    /// The header of a MAVLink 2 frame may be complete at this byte.
    const HEADER_V2: u32 = 1 << 26;

    const fn new(crc: u16, byte: u8) -> Self {
        Self(crc as u32 | (byte as u32) << 16)
    }

    const fn crc(self) -> u16 {
        self.0 as u16
    }

    const fn byte(self) -> u8 {
        (self.0 >> 16) as u8
    }

    const fn is_due(self, what: u32) -> bool {
        self.0 & what != 0
    }
}

/// A window whose header is that of a wanted frame: the [`remainder`] that it needs at its last
/// byte (bits 0 to 15), its length (bits 16 to 23), and whether it displaced another candidate with
/// the same end (bit 24).
#[derive(Clone, Copy, Debug)]
struct Candidate(u32);

impl Candidate {
    const DISPLACED_ANOTHER: u32 = 1 << 24;

    const fn length(self) -> u8 {
        (self.0 >> 16) as u8
    }

    const fn remainder(self) -> u16 {
        self.0 as u16
    }

    const fn displaced_another(self) -> bool {
        self.0 & Self::DISPLACED_ANOTHER != 0
    }

    /// The only one with its end, and not intact: the common case in noise.
    const fn is_alone_and_not(self, remainder: u16) -> bool {
        !self.displaced_another() && self.remainder() != remainder
    }
}

/// What is left of a stream at the end of a frame: the running checksum before the frame's own
/// checksum, moved over one byte more, less the frame's own. `crc` is the running checksum between
/// the two bytes of `own`.
const fn remainder(crc: u16, own: [u8; 2]) -> u16 {
    crc ^ crc::step(0, own[0]) ^ u16::from_le_bytes(own)
}

impl<W: Wanted, const PAYLOAD: usize, const RING: usize> Default for Framer<W, PAYLOAD, RING> {
    fn default() -> Self {
        Self::new()
    }
}

impl<W: Wanted, const PAYLOAD: usize, const RING: usize> Framer<W, PAYLOAD, RING> {
    /// The longest frame of a wanted kind without its signature, in bytes.
    const MAX_LENGTH: usize = HEADER_V2 + PAYLOAD + CRC_LEN;

    const PLACES: [u8; 256] = {
        assert!(RING.is_power_of_two() && RING >= 2 * Self::MAX_LENGTH);
        places(W::KINDS, PAYLOAD)
    };

    /// A framer that has received nothing.
    #[must_use]
    pub const fn new() -> Self {
        let cell = Cell {
            first: 0,
            word: Word(0),
        };
        Self {
            cells: Ring([cell; RING]),
            displaced: Ring([Candidate(0); RING]),
            position: 0,
            free_from: 0,
            crc: crc::INIT,
            last: 0,
            given_up_at: 0,
            framed_bytes: 0,
            counters: FramingCounters::ZERO,
            wanted: PhantomData,
        }
    }

    /// What has been found so far.
    #[must_use]
    pub const fn counters(&self) -> FramingCounters {
        FramingCounters {
            foreign_bytes: self.position.wrapping_sub(self.framed_bytes),
            ..self.counters
        }
    }

    /// Takes a byte. Returns the length of the frame that ends with it, for [`Self::take`]; 0 if
    /// none does.
    #[inline]
    #[must_use]
    pub fn push(&mut self, StampedByte { stamp, byte }: StampedByte) -> u8 {
        let (before, last) = (self.crc, self.last);
        let cell = self.cells.at_mut(self.position);
        let due = *cell;
        *cell = Cell {
            first: stamp.0,
            word: Word::new(before, byte),
        };
        self.crc = crc::step(before, byte);
        self.last = byte;
        self.position = self.position.wrapping_add(1);
        if last >= MAGIC_V2 && byte <= PAYLOAD as u8 {
            self.note_start(last);
        }
        if due.word.0 < Word::END {
            return 0;
        }
        if due.word.is_due(Word::END) {
            let (candidate, remainder) = (Candidate(due.first), remainder(before, [last, byte]));
            if candidate.is_alone_and_not(remainder) {
                self.counters.crc_failures = self.counters.crc_failures.wrapping_add(1);
            } else {
                let length = self.longest_intact(candidate, remainder);
                if length != 0 {
                    return length;
                }
            }
        }
        if due.word.is_due(Word::HEADER_V1) {
            self.consider_v1();
        }
        if due.word.is_due(Word::HEADER_V2) {
            self.consider_v2();
        }
        0
    }

    /// A magic byte and a possible length have come: marks the position at which the header will be
    /// complete.
    #[inline]
    fn note_start(&mut self, magic: u8) {
        let (header_len, due) = match magic {
            MAGIC_V1 => (HEADER_V1, Word::HEADER_V1),
            MAGIC_V2 => (HEADER_V2, Word::HEADER_V2),
            _ => return,
        };
        let ahead = header_len as u32 - 3;
        self.cells.at_mut(self.position.wrapping_add(ahead)).word.0 |= due;
    }

    /// The length of the longest intact candidate that ends with the last byte, 0
    /// for none.
    #[inline(never)]
    fn longest_intact(&mut self, mut candidate: Candidate, remainder: u16) -> u8 {
        let mut longest = 0;
        loop {
            let length = candidate.length();
            let start = self.position.wrapping_sub(u32::from(length));
            if candidate.remainder() != remainder {
                self.counters.crc_failures = self.counters.crc_failures.wrapping_add(1);
            } else if !self.is_taken(start) {
                longest = length.max(longest);
            }
            if !candidate.displaced_another() {
                return longest;
            }
            candidate = *self.displaced.at(start);
        }
    }

    /// The last byte is the id of what may be a MAVLink 1 header.
    #[inline(always)]
    fn consider_v1(&mut self) {
        let start = self.position.wrapping_sub(HEADER_V1 as u32);
        self.consider(Version::V1, HEADER_V1, start, self.last);
    }

    /// The last byte is the last one of the id of what may be a MAVLink 2 header.
    /// The upper two are zero in every wanted one.
    #[inline(never)]
    fn consider_v2(&mut self) {
        let start = self.position.wrapping_sub(HEADER_V2 as u32);
        let [id, middle] = [3, 2].map(|n| self.byte(self.position.wrapping_sub(n)));
        if self.last == 0 && middle == 0 {
            self.consider(Version::V2, HEADER_V2, start, id);
        }
    }

    /// Makes a candidate of the complete header at `start`, if it is wanted.
    #[inline(always)]
    fn consider(&mut self, version: Version, header_len: usize, start: u32, id: u8) {
        let second = self.cells.at(start.wrapping_add(1)).word;
        let len = second.byte();
        let places = const { &Self::PLACES };
        let Some(kind) = places
            .get(usize::from(id))
            .and_then(|&place| W::KINDS.get(usize::from(place)))
        else {
            return;
        };
        if !kind.can_have(version, len) {
            return;
        }
        if version == Version::V2 && self.byte(start.wrapping_add(2)) & !SIGNED != 0 {
            self.counters.unknown_flags = self.counters.unknown_flags.wrapping_add(1);
            return;
        }
        // The magic is not in the checksum. The sender's register after the payload and the
        // extra byte is known except for the payload's own part: that is the remainder that this
        // candidate needs.
        let length = header_len + usize::from(len) + CRC_LEN;
        let zeros = const {
            if Self::MAX_LENGTH - CRC_LEN <= crc::MAX_ZEROS {
                crc::zeros
            } else {
                crc::many_zeros
            }
        };
        let remainder = zeros(length - CRC_LEN, second.crc() ^ crc::INIT) ^ kind.extra;

        let mut candidate = u32::from(remainder) | (length as u32) << 16;
        let end = self.cells.at_mut(start.wrapping_add(length as u32 - 1));
        if end.word.is_due(Word::END) {
            candidate |= Candidate::DISPLACED_ANOTHER;
            *self.displaced.at_mut(start) = Candidate(end.first);
        }
        end.first = candidate;
        end.word.0 |= Word::END;
    }

    /// When the last byte arrived; `None` if nothing can have begun, because no byte has come
    /// since [`Self::give_up`].
    #[must_use]
    pub const fn newest(&self) -> Option<Stamp> {
        if self.position == self.given_up_at {
            return None;
        }
        Some(Stamp(self.cells.at(self.position.wrapping_sub(1)).first))
    }

    /// Gives up what has begun. To be called when the line has been silent: a frame that
    /// went on later than a stamp lasts would carry a wrong time.
    pub fn give_up(&mut self) {
        self.given_up_at = self.position;
        for ahead in 0..Self::MAX_LENGTH as u32 {
            let word = &mut self.cells.at_mut(self.position.wrapping_add(ahead)).word;
            if word.is_due(Word::END) {
                self.counters.abandoned = self.counters.abandoned.wrapping_add(1);
            }
            *word = Word(0);
        }
        self.last = 0;
    }

    /// Whether `start` lies in a frame that was found, or in its signature.
    const fn is_taken(&self, start: u32) -> bool {
        let ahead = self.free_from.wrapping_sub(start);
        ahead != 0 && ahead <= (Self::MAX_LENGTH + SIGNATURE_LEN) as u32
    }

    /// The frame of `length` bytes that ends with the last byte.
    pub fn take(&mut self, length: u8) -> Delimited<PAYLOAD> {
        let after = self.position;
        let start = after.wrapping_sub(u32::from(length));
        let header = |nth: u32| self.byte(start.wrapping_add(nth));
        let (version, signed, system, id, header_len) = if header(0) == MAGIC_V1 {
            (Version::V1, false, 3, header(5), HEADER_V1)
        } else {
            (
                Version::V2,
                header(2) & SIGNED != 0,
                5,
                header(7),
                HEADER_V2,
            )
        };
        let from = Address {
            system: header(system),
            component: header(system + 1),
        };
        let mut payload = [0; PAYLOAD];
        let first = start.wrapping_add(header_len as u32);
        let payload_len = usize::from(length).saturating_sub(header_len + CRC_LEN);
        for (nth, byte) in (0..).zip(payload.iter_mut().take(payload_len)) {
            *byte = self.byte(first.wrapping_add(nth));
        }
        let stamp = Stamp(self.cells.at(start).first);

        self.free_from = after.wrapping_add(if signed { SIGNATURE_LEN as u32 } else { 0 });
        self.framed_bytes = self.framed_bytes.wrapping_add(u32::from(length));
        self.counters.frames = self.counters.frames.wrapping_add(1);
        self.counters.signed = self.counters.signed.wrapping_add(u32::from(signed));
        Delimited {
            stamp,
            version,
            signed,
            from,
            id,
            payload,
        }
    }

    const fn byte(&self, position: u32) -> u8 {
        self.cells.at(position).word.byte()
    }
}

/// An array that is indexed by position in the stream.
#[derive(Debug)]
struct Ring<T, const RING: usize>([T; RING]);

#[expect(
    clippy::indexing_slicing,
    reason = "a remainder by the length is below the length"
)]
impl<T, const RING: usize> Ring<T, RING> {
    #[inline]
    const fn at(&self, position: u32) -> &T {
        &self.0[position as usize % RING]
    }

    #[inline]
    const fn at_mut(&mut self, position: u32) -> &mut T {
        &mut self.0[position as usize % RING]
    }
}
