//! Finds the wanted frames in a stream of bytes, whatever else is in it.
//!
//! *Purpose.* Takes byte by byte, and hands over each intact frame of the wanted kinds at its last
//! byte, with the stamp of its first.
//!
//! *Design.* Every magic byte may start a frame. Six bytes later (MAVLink 1; ten in MAVLink 2) the
//! header is complete. If it has a wanted [`Kind`](crate::kind::Kind) with a length that this kind
//! can have, the window is a *candidate*. Candidates are kept side by side and none waits for
//! another, so a false start or a false length delays no frame. A candidate is checked at its last
//! byte, from the running checksum (see `crc.rs`) and not from its bytes.
//!
//! Found frames do not overlap: a frame that is found discards what began before its end, and of
//! two that end together the longer one counts. So frames are found in the order of their ends.
//! That is the order of their starts, unless an intact frame lies wholly inside another: then the
//! inner one is found, because it must not wait for an outer one of which nothing is proved yet.
//! The 13 bytes of a signature belong to their frame, which is handed over before they arrive.
//!
//! A frame that *changes* something is a matter of more caution: it may stand in a message to
//! somebody else, as a tunnel carries them. Of these kinds a frame is found only where a reader
//! would find it that takes one frame after the other: that reader skips what a header claims,
//! unless the header is of a wanted kind and its checksum does not hold. Of a kind that is not
//! wanted nothing can be checked, and its claim stands.
//!
//! A payload may be longer than is known here. Its end can be hundreds of bytes away, so such a
//! candidate stands in a short list, which noise can fill: then a long frame is missed, and never
//! one of a length that is known.
//!
//! *Cost.* Each byte is stored and goes through the running checksum once. More is done only
//! where a header may be complete or a candidate ends, and each of these is a fixed number of
//! steps, because a checksum over any window is one. How often can that be?
//!
//! - A start is noted at each magic byte.
//! - A candidate of MAVLink 1 needs a magic, a length and an id. One byte can be both of the last two:
//!   PARAM_REQUEST_READ has 20 bytes and the id 20, and `FE 14` repeated would be one in two bytes. But
//!   then the component is a magic, too, as no component is: such a header makes no candidate. So
//!   there is at most one in three bytes, `FE 0E 04` repeated.
//! - A candidate of MAVLink 2 needs a magic, a length, and zeros where the next candidates would
//!   have theirs: at most one in five bytes.
//! - The reader that takes one frame after the other passes each header once, and not those of frames
//!   that are known to be damaged.
//!
//! `cargo xtask bench` measures streams made to cost most.
//!
//! *Limits.* A PING inside the payload of an unwanted frame (a tunnel) is found. Positions are
//! counted modulo 2^32.

mod cell;
mod long_ones;
mod reader;
mod ring;

use core::marker::PhantomData;

use timebase::{Stamp, StampedByte};

use self::cell::{Candidate, Cell, Word, remainder};
use self::long_ones::{LongOnes, Window};
use self::ring::Ring;
use crate::crc;
use crate::frame::{Address, CRC_LEN, HEADER_V1, HEADER_V2, MAGIC_V1, MAGIC_V2, Version};
use crate::kind::{Shape, Wanted, any_is_guarded, is_guarded, shapes};

/// The longest payload that a node wants, in bytes: COMMAND_INT.
pub const MAX_PAYLOAD: usize = 35;

/// The incompatibility flag of a signed frame; any other one is unknown here.
const SIGNED: u8 = 0x01;

/// Bytes of a signature after the frame's checksum.
const SIGNATURE_LEN: usize = 13;

/// The longest frame that there can be, in bytes, with its signature.
const LONGEST: usize = HEADER_V2 + u8::MAX as usize + CRC_LEN + SIGNATURE_LEN;

/// Positions of the stream that have a cell: the reader of one frame after the other is no farther
/// behind than that, and ends are noted ahead.
const RING: usize = 512;

/// That reader goes on each time so many bytes have come.
const READ_EVERY: u32 = 64;

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
    /// Its payload, extended with zeros; of a longer one the beginning.
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
    /// Intact frames that would have changed something, inside of what an earlier header claims:
    /// not handed over.
    pub claimed: u32,
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
        claimed: 0,
    };
}

/// Looks for the frames that `W` wants, of whose payloads up to `PAYLOAD` bytes are known. `ENDS` is a
/// power of two, and at least the longest of them with its header and checksum.
#[derive(Debug)]
pub struct Framer<W, const PAYLOAD: usize = MAX_PAYLOAD, const ENDS: usize = 64> {
    cells: Ring<Cell, RING>,
    /// A bit for each of these positions: a magic byte whose frame is not known to be damaged.
    starts: Ring<u32, { RING / 32 }>,
    /// By start of a candidate: another one with the same end.
    displaced: Ring<Candidate, ENDS>,
    /// The number of bytes that have come: the position of the next one.
    position: u32,
    /// The running checksum after the last byte.
    crc: u16,
    /// The last byte.
    last: u8,
    long_ones: LongOnes,
    /// The position of the next byte that is more than a byte: with it a long candidate ends, or
    /// before it the reader goes on.
    event: u32,
    /// Where the reader of one frame after the other stands.
    read_to: u32,
    /// The first position after the last frame that was found.
    free_from: u32,
    /// The position at which what had begun was last given up.
    given_up_at: u32,
    framed_bytes: u32,
    counters: FramingCounters,
    wanted: PhantomData<W>,
}

impl<W: Wanted, const PAYLOAD: usize, const ENDS: usize> Default for Framer<W, PAYLOAD, ENDS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<W: Wanted, const PAYLOAD: usize, const ENDS: usize> Framer<W, PAYLOAD, ENDS> {
    /// The longest frame of a length that is known, without its signature, in bytes.
    const MAX_LENGTH: usize = HEADER_V2 + PAYLOAD + CRC_LEN;

    const SHAPES: [Shape; 256] = {
        // Bytes are kept until the reader has passed them, and ends are noted ahead.
        let kept = LONGEST + READ_EVERY as usize + HEADER_V2;
        assert!(RING.is_power_of_two() && RING >= kept + Self::MAX_LENGTH);
        assert!(ENDS.is_power_of_two() && ENDS >= Self::MAX_LENGTH);
        shapes(W::KINDS)
    };

    const GUARDS: bool = any_is_guarded(W::KINDS);

    /// A framer that has received nothing.
    #[must_use]
    pub const fn new() -> Self {
        let cell = Cell {
            first: 0,
            word: Word(0),
        };
        Self {
            cells: Ring([cell; RING]),
            starts: Ring([0; RING / 32]),
            displaced: Ring([Candidate(0); ENDS]),
            position: 0,
            long_ones: LongOnes::NONE,
            event: READ_EVERY,
            read_to: 0,
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
    #[inline(always)]
    #[must_use]
    pub fn push(&mut self, byte: StampedByte) -> u16 {
        let is_event = self.position == self.event;
        let (before, own) = (self.crc, [self.last, byte.byte]);
        if is_event {
            self.begin_event();
        }
        let length = self.push_alone(byte);
        if is_event {
            return self.end_event(length, remainder(before, own));
        }
        length
    }

    /// Before a byte with which a long candidate may end, or before which the reader goes on.
    #[inline(never)]
    fn begin_event(&mut self) {
        if self.position.is_multiple_of(READ_EVERY) {
            // All that has ended is decided.
            if Self::GUARDS {
                self.read_on(self.position.wrapping_sub(HEADER_V2 as u32));
            }
            for block in [0, 32] {
                *self.starts.at_mut((self.position + block) / 32) = 0;
            }
        }
    }

    /// After it. The length of the longest frame that ends with it, of which `length` is one that was
    /// found.
    #[inline(never)]
    fn end_event(&mut self, length: u16, remainder: u16) -> u16 {
        let long = self.long_intact(remainder);
        self.note_event();
        length.max(long)
    }

    /// Finds the next event.
    fn note_event(&mut self) {
        let until_reading = self.position.wrapping_neg() % READ_EVERY;
        let until_end = self.long_ones.until_end(self.position);
        // The byte with which one ends is the one before its end.
        let until = until_end.map_or(until_reading, |end| {
            until_reading.min(end.saturating_sub(1))
        });
        self.event = self.position.wrapping_add(until);
    }

    #[inline(always)]
    fn push_alone(&mut self, StampedByte { stamp, byte }: StampedByte) -> u16 {
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
        if last >= MAGIC_V2 {
            self.note_start(last);
        }
        if due.word.0 < Word::END {
            return 0;
        }
        if due.word.is_due(Word::END) {
            let (candidate, remainder) = (Candidate(due.first), remainder(before, [last, byte]));
            if candidate.is_alone_and_not(remainder) {
                self.counters.crc_failures = self.counters.crc_failures.wrapping_add(1);
                self.forget_start(self.position.wrapping_sub(candidate.length().into()));
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

    /// A magic byte and a length have come: marks the position at which the header will be
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

    /// The reader has to look at `start`.
    #[inline]
    fn keep_start(&mut self, start: u32) {
        *self.starts.at_mut(start / 32) |= 1 << (start % 32);
    }

    /// The frame at `start` is damaged.
    #[inline]
    fn forget_start(&mut self, start: u32) {
        *self.starts.at_mut(start / 32) &= !(1 << (start % 32));
    }

    /// The length of the longest intact candidate that ends with the last byte, 0
    /// for none.
    #[inline(never)]
    fn longest_intact(&mut self, mut candidate: Candidate, remainder: u16) -> u16 {
        let mut longest = 0;
        loop {
            let length = u16::from(candidate.length());
            let start = self.position.wrapping_sub(u32::from(length));
            if candidate.remainder() != remainder {
                self.counters.crc_failures = self.counters.crc_failures.wrapping_add(1);
                self.forget_start(start);
            } else if self.is_found(start) {
                longest = length.max(longest);
            }
            if !candidate.displaced_another() {
                return longest;
            }
            candidate = *self.displaced.at(start);
        }
    }

    /// The same of the candidates with longer payloads than are known.
    fn long_intact(&mut self, remainder: u16) -> u16 {
        let mut longest = 0;
        while let Some(Window { start, length }) = self.long_ones.pop(self.position) {
            let extra = self.shape_at(start).map_or(0, Shape::extra);
            let covered = usize::from(length) - CRC_LEN;
            let crc = self.cells.at(start.wrapping_add(1)).word.crc();
            if crc::many_zeros(covered, crc ^ crc::INIT) ^ extra != remainder {
                self.counters.crc_failures = self.counters.crc_failures.wrapping_add(1);
                self.forget_start(start);
            } else if self.is_found(start) {
                longest = length.max(longest);
            }
        }
        longest
    }

    /// Whether the frame at `start`, whose checksum holds, is one to hand over.
    fn is_found(&mut self, start: u32) -> bool {
        self.cells.at_mut(start).word.0 |= Word::INTACT;
        if self.is_taken(start) {
            return false;
        }
        let is_claimed =
            Self::GUARDS && is_guarded(W::KINDS, self.id_at(start)) && self.read_on(start);
        if is_claimed {
            self.counters.claimed = self.counters.claimed.wrapping_add(1);
        }
        !is_claimed
    }

    /// The shape of the complete header at `start`, if it is of a wanted kind with a length that this
    /// can have.
    fn shape_at(&self, start: u32) -> Option<Shape> {
        let at = |nth: u32| self.byte(start.wrapping_add(nth));
        let version = match at(0) {
            MAGIC_V1 => Version::V1,
            _ if at(8) == 0 && at(9) == 0 => Version::V2,
            _ => return None,
        };
        let id = self.id_at(start);
        let shape = Self::shape(id);
        let is_ambiguous = version == Version::V1 && self.is_ambiguous(start, at(1), id);
        (shape.can_have(version, at(1)) && !is_ambiguous).then_some(shape)
    }

    /// Whether a header of MAVLink 1 that has its length for its id has a magic for its component.
    #[inline]
    const fn is_ambiguous(&self, start: u32, len: u8, id: u8) -> bool {
        len == id && matches!(self.byte(start.wrapping_add(4)), MAGIC_V1 | MAGIC_V2)
    }

    /// The lowest byte of the id in the header at `start`.
    const fn id_at(&self, start: u32) -> u8 {
        let is_v1 = self.byte(start) == MAGIC_V1;
        self.byte(start.wrapping_add(if is_v1 { 5 } else { 7 }))
    }

    /// The shape of the kind with that id.
    #[inline]
    #[expect(
        clippy::indexing_slicing,
        reason = "there is one for each value of a byte"
    )]
    fn shape(id: u8) -> Shape {
        let shapes = const { &Self::SHAPES };
        shapes[usize::from(id)]
    }

    /// The last byte is the id of what may be a MAVLink 1 header.
    #[inline(always)]
    fn consider_v1(&mut self) {
        let start = self.position.wrapping_sub(HEADER_V1 as u32);
        self.keep_start(start);
        self.consider(Version::V1, HEADER_V1, start, self.last);
    }

    /// The last byte is the last one of the id of what may be a MAVLink 2 header. The upper two are
    /// zero in every wanted one.
    #[inline(never)]
    fn consider_v2(&mut self) {
        let start = self.position.wrapping_sub(HEADER_V2 as u32);
        let has_known_flags = self.byte(start.wrapping_add(2)) & !SIGNED == 0;
        if has_known_flags {
            self.keep_start(start);
        }
        if self.last != 0 {
            return;
        }
        let [id, middle] = [3, 2].map(|n| self.byte(self.position.wrapping_sub(n)));
        if middle == 0 {
            self.consider(Version::V2, HEADER_V2, start, id);
        }
    }

    /// Makes a candidate of the complete header at `start`, if it is wanted.
    #[inline(always)]
    fn consider(&mut self, version: Version, header_len: usize, start: u32, id: u8) {
        let second = self.cells.at(start.wrapping_add(1)).word;
        let len = second.byte();
        let shape = Self::shape(id);
        if !shape.can_have(version, len) {
            return;
        }
        if version == Version::V2 && self.byte(start.wrapping_add(2)) & !SIGNED != 0 {
            self.counters.unknown_flags = self.counters.unknown_flags.wrapping_add(1);
            return;
        }
        if version == Version::V1 && self.is_ambiguous(start, len, id) {
            return;
        }
        let is_long = match version {
            Version::V1 => len != shape.v1_len(),
            Version::V2 => len > PAYLOAD as u8,
        };
        if is_long {
            return self.await_long_one(start, header_len, len);
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
        let remainder = zeros(length - CRC_LEN, second.crc() ^ crc::INIT) ^ shape.extra();

        let mut candidate = u32::from(remainder) | (length as u32) << 16;
        let end = self.cells.at_mut(start.wrapping_add(length as u32 - 1));
        if end.word.is_due(Word::END) {
            candidate |= Candidate::DISPLACED_ANOTHER;
            *self.displaced.at_mut(start) = Candidate(end.first);
        }
        end.first = candidate;
        end.word.0 |= Word::END;
    }

    /// Awaits a candidate with a longer payload than is known.
    #[inline(never)]
    fn await_long_one(&mut self, start: u32, header_len: usize, len: u8) {
        let length = (header_len + CRC_LEN) as u16 + u16::from(len);
        let window = Window { start, length };
        if self.long_ones.push(window) {
            // An event that is now is found anew behind this byte.
            let [until_end, until_event] = [window.end().wrapping_sub(1), self.event]
                .map(|position| position.wrapping_sub(self.position));
            self.event = self.position.wrapping_add(until_end.min(until_event));
        }
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
        self.read_to = self.position;
        let long_ones = core::mem::replace(&mut self.long_ones, LongOnes::NONE);
        self.counters.abandoned = self.counters.abandoned.wrapping_add(long_ones.count as u32);
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
        ahead != 0 && ahead <= LONGEST as u32
    }

    /// The frame of `length` bytes that ends with the last byte.
    pub fn take(&mut self, length: u16) -> Delimited<PAYLOAD> {
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
