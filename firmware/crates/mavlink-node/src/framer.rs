//! Finds the wanted frames in a stream of bytes, whatever else is in it.
//!
//! *Purpose.* Fed byte by byte; hands over each intact frame of the wanted
//! kinds at its last byte, with the stamp of its first.
//!
//! *Design.* Every magic byte may start a frame. Six bytes later (MAVLink 1; ten
//! in MAVLink 2) the header is complete, and if it names a wanted [`Kind`] with
//! a length that this kind can have, the window is a *candidate*. All candidates
//! are kept at once and nothing waits for any of them: a false start or a false
//! length holds no frame up. A candidate is checked at its last byte, from the
//! running checksum (see [`crc`]) and not from its bytes. Found frames do not
//! overlap: a frame that is found strikes out what began before its end; of two
//! that end together the longer one counts. So frames are taken in the order of
//! their ends, which is the order of their starts unless an intact frame lies
//! wholly inside another; then it is the inner one that is found, since it must
//! not wait for an outer one of which nothing is proved yet. The 13 bytes of a
//! signature belong to their frame, which is handed over before they arrive.
//!
//! *Cost.* A byte is stored and goes through the running checksum once. More is
//! done only where something is due: a header may be complete there, or a
//! candidate ends. Each is a fixed number of steps, because a checksum over any
//! window is one. How often can it be due? A start is noted when a magic and a
//! possible length follow each other, at most every second byte. A candidate of
//! MAVLink 1 has a magic, a length and an id to itself (as values they exclude
//! each other; only a MAVLink 2 length can serve as an id as well), so there is at
//! most one in three bytes: `FE 0E 04` repeated. One of MAVLink 2 needs a magic,
//! two zeros and a flag of 0 or 1 nine, eight and two bytes apart, which leaves
//! room for fewer. The tests search for streams that are worse and find none.
//!
//! *Limits.* Frames of at most [`MAX_LENGTH`] bytes. A frame inside the payload
//! of an unwanted one (a tunnel) is found too. Positions are counted modulo
//! 2^32.

use core::marker::PhantomData;

use mavlink::MessageData;
use timebase::{Stamp, StampedByte};

use crate::crc;
use crate::frame::{Address, CRC_LEN, HEADER_V1, HEADER_V2, MAGIC_V1, MAGIC_V2, Version};

/// The longest payload of a wanted kind, in bytes: COMMAND_INT.
pub const MAX_PAYLOAD: usize = 35;

/// The shortest payload that a wanted kind has in MAVLink 1, in bytes: HEARTBEAT.
const MIN_PAYLOAD_V1: usize = 9;

/// The longest frame of a wanted kind without its signature, in bytes.
pub const MAX_LENGTH: usize = HEADER_V2 + MAX_PAYLOAD + CRC_LEN;

/// The incompatibility flag of a signed frame; any other one is unknown here.
const SIGNED: u8 = 0x01;

/// Bytes of a signature after the frame's checksum.
const SIGNATURE_LEN: usize = 13;

/// A candidate whose bytes span more than this was broken off: 2^26 cycles, 0.4 s.
/// A host that sends a frame in two pieces may hold the second back for a delayed
/// acknowledgement, 40 to 200 ms on Linux.
const MAX_SPAN_CYCLES: u32 = 1 << 26;

/// How many bytes are remembered: a power of two above [`MAX_LENGTH`].
const RING: usize = 64;

const _: () = {
    assert!(RING > MAX_LENGTH && MAX_LENGTH - CRC_LEN <= crc::MAX_ZEROS);
    assert!(HEADER_V1 + MIN_PAYLOAD_V1 >= crc::MIN_ZEROS && HEADER_V2 >= crc::MIN_ZEROS);
};

/// One kind of frame that is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    id: u8,
    /// What CRC_EXTRA adds to the running checksum.
    extra: u16,
    v1_len: u8,
    v2_min_len: u8,
    v2_max_len: u8,
}

impl Kind {
    /// The kind of message `M`. `v1_len`: its payload without extensions, in
    /// bytes, which is its length in MAVLink 1; `v2_min_len`: the shortest
    /// payload worth having in MAVLink 2, where trailing zeros are left out.
    pub(crate) const fn of<M: MessageData>(v1_len: u8, v2_min_len: u8) -> Self {
        assert!(M::ENCODED_LEN <= MAX_PAYLOAD && M::ID <= u8::MAX as u32);
        assert!(MIN_PAYLOAD_V1 <= v1_len as usize && v1_len as usize <= M::ENCODED_LEN);
        Self {
            id: M::ID as u8,
            extra: crc::step(0, M::EXTRA_CRC),
            v1_len,
            v2_min_len,
            v2_max_len: M::ENCODED_LEN as u8,
        }
    }

    const fn can_have(&self, version: Version, len: u8) -> bool {
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

/// An intact frame, its checksum held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delimited {
    /// The stamp of its first byte.
    pub stamp: Stamp,
    /// The version that it is in.
    pub version: Version,
    /// It carries a signature, which nobody checks.
    pub signed: bool,
    /// Who sent it.
    pub from: Address,
    /// Its message id.
    pub id: u8,
    /// Its payload, extended with zeros.
    pub payload: [u8; MAX_PAYLOAD],
}

/// What a framer has met. All wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FramingCounters {
    /// Frames that were handed over.
    pub frames: u32,
    /// Bytes that are in no such frame: foreign messages, noise, signatures, and
    /// the frame that is arriving.
    pub foreign_bytes: u32,
    /// Candidates whose checksum failed: damaged frames and false starts.
    pub crc_failures: u32,
    /// Candidates that were broken off: their bytes span more than 0.4 s.
    pub abandoned: u32,
    /// Headers of a wanted kind with an incompatibility flag that is not known
    /// here; such frames must be dropped.
    pub unknown_flags: u32,
    /// Frames that carried a signature, among those handed over.
    pub signed: u32,
}

impl FramingCounters {
    /// Nothing was met.
    pub const ZERO: Self = Self {
        frames: 0,
        foreign_bytes: 0,
        crc_failures: 0,
        abandoned: 0,
        unknown_flags: 0,
        signed: 0,
    };
}

/// Looks for the frames that `W` wants.
#[derive(Debug)]
pub struct Framer<W> {
    past: Ring<Past>,
    /// By start: what is known of the candidate that starts there.
    candidates: Ring<Candidate>,
    /// How many bytes have come: the position of the next one.
    position: u32,
    /// The first position after the last frame that was found.
    free_from: u32,
    /// The last byte, and the running checksum after it.
    last: Word,
    framed_bytes: u32,
    counters: FramingCounters,
    wanted: PhantomData<W>,
}

/// A byte that has come. What is due at a position stands there before its byte
/// comes.
#[derive(Clone, Copy, Debug)]
struct Past {
    stamp: Stamp,
    /// The byte, the running checksum before it, and what is due.
    word: Word,
}

/// A running checksum (bits 0 to 15), a byte (bits 16 to 23) and a [`Due`] (bits
/// 24 to 31): packed, since all three are stored for every byte.
#[derive(Clone, Copy, Debug)]
struct Word(u32);

impl Word {
    const fn new(crc: u16, byte: u8) -> Self {
        Self(crc as u32 | (byte as u32) << 16)
    }

    const fn crc(self) -> u16 {
        self.0 as u16
    }

    const fn byte(self) -> u8 {
        (self.0 >> 16) as u8
    }

    const fn due(self) -> Due {
        Due((self.0 >> 24) as u8)
    }

    const fn set_due(&mut self, Due(due): Due) {
        self.0 = (self.0 & 0xff_ffff) | (due as u32) << 24;
    }
}

/// What is to be examined at a byte: the length of a candidate that ends there
/// (bits 0 to 5, 0 for none), and headers that may be complete there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Due(u8);

impl Due {
    const LENGTH: u8 = RING as u8 - 1;
    const HEADER_V1: u8 = 0x40;
    const HEADER_V2: u8 = 0x80;

    /// Nothing is: the byte needs no more attention.
    #[inline]
    #[must_use]
    pub const fn is_nothing(self) -> bool {
        self.0 == 0
    }
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// What [`Framer::remainder`] must be at its last byte.
    remainder: u16,
    /// The length of another candidate with the same end, 0 for none.
    next: u8,
}

impl<W: Wanted> Default for Framer<W> {
    fn default() -> Self {
        Self::new()
    }
}

impl<W: Wanted> Framer<W> {
    /// A framer that has heard nothing.
    #[must_use]
    pub const fn new() -> Self {
        let past = Past {
            stamp: Stamp(0),
            word: Word(0),
        };
        let candidate = Candidate {
            remainder: 0,
            next: 0,
        };
        Self {
            past: Ring([past; RING]),
            candidates: Ring([candidate; RING]),
            position: 0,
            free_from: 0,
            last: Word::new(crc::INIT, 0),
            framed_bytes: 0,
            counters: FramingCounters::ZERO,
            wanted: PhantomData,
        }
    }

    /// What has been met so far.
    #[must_use]
    pub const fn counters(&self) -> FramingCounters {
        FramingCounters {
            foreign_bytes: self.position.wrapping_sub(self.framed_bytes),
            ..self.counters
        }
    }

    /// Takes a byte. When something is due, [`Self::examine`] must be called before
    /// the next one.
    #[inline]
    #[must_use]
    pub fn push(&mut self, StampedByte { stamp, byte }: StampedByte) -> Due {
        let before = self.last;
        let past = self.past.at_mut(self.position);
        let due = past.word.due();
        *past = Past {
            stamp,
            word: Word::new(before.crc(), byte),
        };
        self.last = Word::new(crc::step(before.crc(), byte), byte);
        self.position = self.position.wrapping_add(1);
        if before.byte() >= MAGIC_V2 && byte <= MAX_PAYLOAD as u8 {
            self.note_start(before.byte());
        }
        due
    }

    /// A magic byte and a possible length have come: when the header will be
    /// complete, it is to be examined.
    #[inline]
    fn note_start(&mut self, magic: u8) {
        let (ahead, header) = match magic {
            MAGIC_V1 => (HEADER_V1 as u32 - 3, Due::HEADER_V1),
            MAGIC_V2 => (HEADER_V2 as u32 - 3, Due::HEADER_V2),
            _ => return,
        };
        let word = &mut self.past.at_mut(self.position.wrapping_add(ahead)).word;
        word.set_due(Due(word.due().0 | header));
    }

    /// Looks at what is due at the last byte: a frame that is complete, headers
    /// that are.
    pub fn examine(&mut self, Due(due): Due) -> Option<Delimited> {
        let at = self.position.wrapping_sub(1);
        let length = due & Due::LENGTH;
        if length != 0 {
            let length = self.longest_intact(at, length);
            if length != 0 {
                return Some(self.hand_over(at, length));
            }
        }
        if due & Due::HEADER_V1 != 0 {
            self.consider_v1(at);
        }
        if due & Due::HEADER_V2 != 0 {
            self.consider_v2(at);
        }
        None
    }

    /// The length of the longest intact candidate that ends at `at`, 0 for none.
    fn longest_intact(&mut self, at: u32, mut length: u8) -> u8 {
        let remainder = self.remainder(at);
        let stamp = self.past.at(at).stamp;
        let mut longest = 0;
        while length != 0 {
            let start = at.wrapping_add(1).wrapping_sub(u32::from(length));
            let candidate = *self.candidates.at(start);
            if stamp.0.wrapping_sub(self.past.at(start).stamp.0) > MAX_SPAN_CYCLES {
                self.counters.abandoned = self.counters.abandoned.wrapping_add(1);
            } else if candidate.remainder != remainder {
                self.counters.crc_failures = self.counters.crc_failures.wrapping_add(1);
            } else if !self.is_taken(start) {
                longest = length.max(longest);
            }
            length = candidate.next;
        }
        longest
    }

    /// What the stream says at the end of a frame: the running checksum moved
    /// over one byte more, less the checksum that was sent.
    fn remainder(&self, at: u32) -> u16 {
        let last = self.past.at(at).word;
        let first = self.past.at(at.wrapping_sub(1)).word;
        crc::step(first.crc(), 0) ^ u16::from_le_bytes([first.byte(), last.byte()])
    }

    /// `at` is the id of what may be a MAVLink 1 header.
    #[inline]
    fn consider_v1(&mut self, at: u32) {
        let start = at.wrapping_sub(HEADER_V1 as u32 - 1);
        self.consider(Version::V1, HEADER_V1, start, self.byte(at));
    }

    /// `at` is the last byte of the id of what may be a MAVLink 2 header. The upper
    /// two are zero in every wanted one.
    #[inline]
    fn consider_v2(&mut self, at: u32) {
        let [id, middle, high] = [2, 1, 0].map(|n| self.byte(at.wrapping_sub(n)));
        if high == 0 && middle == 0 {
            let start = at.wrapping_sub(HEADER_V2 as u32 - 1);
            self.consider(Version::V2, HEADER_V2, start, id);
        }
    }

    /// Makes a candidate of the complete header at `start`, if it is wanted.
    #[inline]
    fn consider(&mut self, version: Version, header: usize, start: u32, id: u8) {
        let second = self.past.at(start.wrapping_add(1)).word;
        let len = second.byte();
        let Some(kind) = W::KINDS
            .iter()
            .find(|kind| kind.id == id && kind.can_have(version, len))
        else {
            return;
        };
        if version == Version::V2 && self.byte(start.wrapping_add(2)) & !SIGNED != 0 {
            self.counters.unknown_flags = self.counters.unknown_flags.wrapping_add(1);
            return;
        }
        // The magic is not in the checksum. What the sender's register holds
        // after the payload and the extra byte is known but for the payload:
        // that is what the remainder will have to be.
        let length = header + usize::from(len) + CRC_LEN;
        let remainder = crc::zeros(length - CRC_LEN, second.crc() ^ crc::INIT) ^ kind.extra;

        let end = start.wrapping_add(length as u32 - 1);
        let end = &mut self.past.at_mut(end).word;
        let Due(due) = end.due();
        end.set_due(Due((due & !Due::LENGTH) | length as u8));
        *self.candidates.at_mut(start) = Candidate {
            remainder,
            next: due & Due::LENGTH,
        };
    }

    /// Whether `start` lies in a frame that was found, or in its signature.
    const fn is_taken(&self, start: u32) -> bool {
        let ahead = self.free_from.wrapping_sub(start);
        ahead != 0 && ahead <= (MAX_LENGTH + SIGNATURE_LEN) as u32
    }

    fn hand_over(&mut self, at: u32, length: u8) -> Delimited {
        let after = at.wrapping_add(1);
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
        let mut payload = [0; MAX_PAYLOAD];
        let first = start.wrapping_add(header_len as u32);
        let payload_len = usize::from(length).saturating_sub(header_len + CRC_LEN);
        for (nth, byte) in (0..).zip(payload.iter_mut().take(payload_len)) {
            *byte = self.byte(first.wrapping_add(nth));
        }
        let stamp = self.past.at(start).stamp;

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
        self.past.at(position).word.byte()
    }
}

/// An array that is indexed by position in the stream.
#[derive(Debug)]
struct Ring<T>([T; RING]);

#[expect(
    clippy::indexing_slicing,
    reason = "a remainder by the length is below the length"
)]
impl<T> Ring<T> {
    #[inline]
    const fn at(&self, position: u32) -> &T {
        &self.0[position as usize % RING]
    }

    #[inline]
    const fn at_mut(&mut self, position: u32) -> &mut T {
        &mut self.0[position as usize % RING]
    }
}
