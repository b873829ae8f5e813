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
//! *Cost.* A byte is stored and goes through the running checksum once. It is
//! examined further only when *due*: a header may be complete there or a
//! candidate end, each a fixed number of steps, because a checksum over any
//! window is one. A candidate owns at least its magic and its length byte, and
//! nearly always its id; candidates are therefore at most one in three bytes
//! (MAVLink 1, `FE 0E 04` repeated), and so are ends. The tests count candidates
//! and examinations on streams that were searched for the worst.
//!
//! *Limits.* Frames of at most [`MAX_LENGTH`] bytes. A frame inside the payload
//! of an unwanted one (a tunnel) is found too. Positions are counted modulo
//! 2^32.

use core::marker::PhantomData;

use mavlink::MessageData;
use timebase::{CORE_HZ, Stamp, StampedByte};

use crate::crc;
use crate::frame::{Address, CRC_LEN, HEADER_V1, HEADER_V2, MAGIC_V1, MAGIC_V2, Version};

/// The longest payload of a wanted kind, in bytes: COMMAND_INT.
pub const MAX_PAYLOAD: usize = 35;

/// The longest frame of a wanted kind without its signature, in bytes.
pub const MAX_LENGTH: usize = HEADER_V2 + MAX_PAYLOAD + CRC_LEN;

/// The incompatibility flag of a signed frame; any other one is unknown here.
const SIGNED: u8 = 0x01;

/// Bytes of a signature after the frame's checksum.
const SIGNATURE_LEN: usize = 13;

/// A candidate whose bytes span more than this was broken off: 250 ms. A host
/// that sends a frame in two pieces may hold the second back for a delayed
/// acknowledgement, 200 ms at most (RFC 1122 allows 500, Linux takes 40 to 200).
const MAX_SPAN_CYCLES: u32 = CORE_HZ / 4;

/// How many bytes are remembered: a power of two above [`MAX_LENGTH`].
const RING: usize = 64;
const _: () = assert!(RING > MAX_LENGTH && MAX_LENGTH - CRC_LEN <= crc::MAX_ZEROS);

/// One kind of frame that is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    id: u8,
    crc_extra: u8,
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
        Self {
            id: M::ID as u8,
            crc_extra: M::EXTRA_CRC,
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

/// What a framer has met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FramingCounters {
    /// Frames that were handed over.
    pub frames: u32,
    /// Bytes that are in no such frame: foreign messages, noise, signatures, and
    /// the frame that is arriving.
    pub foreign_bytes: u32,
    /// Candidates whose checksum failed: damaged frames and false starts.
    pub crc_failures: u32,
    /// Candidates that were broken off: their bytes span more than 250 ms.
    pub abandoned: u32,
    /// Headers of a wanted kind with an incompatibility flag that is not known
    /// here; such frames must be dropped.
    pub unknown_flags: u32,
    /// Frames that carried a signature, among those handed over.
    pub signed: u32,
}

/// Looks for the frames that `W` wants.
#[derive(Debug)]
pub struct Framer<W> {
    past: Ring<Past>,
    /// By start: what is known of the candidate that starts there.
    candidates: Ring<Candidate>,
    /// By end: the length of a candidate that ends there, 0 for none; the next
    /// one with the same end is named in the candidate.
    ending: Ring<u8>,
    /// Bit n: something is to be examined n bytes from now.
    due: u64,
    /// How many bytes have come: the position of the next one.
    position: u32,
    /// The first position after the last frame that was found.
    free_from: u32,
    /// The running checksum.
    crc: u16,
    framed_bytes: u32,
    counters: FramingCounters,
    wanted: PhantomData<W>,
}

/// A byte that has come, and the running checksum before it.
#[derive(Clone, Copy, Debug, Default)]
struct Past {
    stamp: Stamp,
    crc: u16,
    byte: u8,
}

#[derive(Clone, Copy, Debug, Default)]
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
        Self {
            past: Ring(
                [Past {
                    stamp: Stamp(0),
                    crc: 0,
                    byte: 0,
                }; RING],
            ),
            candidates: Ring(
                [Candidate {
                    remainder: 0,
                    next: 0,
                }; RING],
            ),
            ending: Ring([0; RING]),
            due: 0,
            position: 0,
            free_from: 0,
            crc: crc::INIT,
            framed_bytes: 0,
            counters: FramingCounters {
                frames: 0,
                foreign_bytes: 0,
                crc_failures: 0,
                abandoned: 0,
                unknown_flags: 0,
                signed: 0,
            },
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

    /// Takes a byte; `true` when [`Self::examine`] must be called before the
    /// next one.
    #[inline]
    #[must_use]
    pub fn push(&mut self, StampedByte { stamp, byte }: StampedByte) -> bool {
        *self.past.at_mut(self.position) = Past {
            stamp,
            crc: self.crc,
            byte,
        };
        self.position = self.position.wrapping_add(1);
        self.crc = crc::step(self.crc, byte);
        self.due >>= 1;
        match byte {
            MAGIC_V1 => self.due |= 1 << (HEADER_V1 - 1),
            MAGIC_V2 => self.due |= 1 << (HEADER_V2 - 1),
            _ => {}
        }
        self.due & 1 != 0
    }

    /// Looks at what is due at the last byte: a frame that is complete, headers
    /// that are.
    pub fn examine(&mut self) -> Option<Delimited> {
        let at = self.position.wrapping_sub(1);
        let length = self.longest_intact(at);
        if length != 0 {
            return Some(self.hand_over(at, length));
        }
        self.consider_v1(at);
        self.consider_v2(at);
        None
    }

    /// The length of the longest intact candidate that ends at `at`, 0 for none.
    fn longest_intact(&mut self, at: u32) -> u8 {
        let mut length = core::mem::take(self.ending.at_mut(at));
        let mut longest = 0;
        while length != 0 {
            let start = at.wrapping_add(1).wrapping_sub(u32::from(length));
            let candidate = *self.candidates.at(start);
            if !self.is_taken(start) {
                let span = self
                    .past
                    .at(at)
                    .stamp
                    .0
                    .wrapping_sub(self.past.at(start).stamp.0);
                if span > MAX_SPAN_CYCLES {
                    self.counters.abandoned = self.counters.abandoned.wrapping_add(1);
                } else if candidate.remainder == self.remainder(at) {
                    longest = length.max(longest);
                } else {
                    self.counters.crc_failures = self.counters.crc_failures.wrapping_add(1);
                }
            }
            length = candidate.next;
        }
        longest
    }

    /// What the stream says at the end of a frame: the running checksum moved
    /// over one byte more, less the checksum that was sent.
    fn remainder(&self, at: u32) -> u16 {
        let last = self.past.at(at);
        let first = self.past.at(at.wrapping_sub(1));
        crc::step(first.crc, 0) ^ u16::from_le_bytes([first.byte, last.byte])
    }

    /// `at` may be the id of a MAVLink 1 header.
    fn consider_v1(&mut self, at: u32) {
        let start = at.wrapping_sub(HEADER_V1 as u32 - 1);
        if self.past.at(start).byte == MAGIC_V1 {
            self.consider(Version::V1, HEADER_V1, start, self.past.at(at).byte);
        }
    }

    /// `at` may be the last byte of the id of a MAVLink 2 header. The upper two
    /// are zero in every wanted one.
    fn consider_v2(&mut self, at: u32) {
        let start = at.wrapping_sub(HEADER_V2 as u32 - 1);
        if self.past.at(start).byte == MAGIC_V2
            && self.past.at(at).byte == 0
            && self.past.at(at.wrapping_sub(1)).byte == 0
        {
            self.consider(
                Version::V2,
                HEADER_V2,
                start,
                self.past.at(at.wrapping_sub(2)).byte,
            );
        }
    }

    /// Makes a candidate of the complete header at `start`, if it is wanted.
    fn consider(&mut self, version: Version, header: usize, start: u32, id: u8) {
        let len = self.past.at(start.wrapping_add(1)).byte;
        let Some(kind) = W::KINDS.iter().find(|kind| kind.id == id) else {
            return;
        };
        if !kind.can_have(version, len) || self.is_taken(start) {
            return;
        }
        if version == Version::V2 && self.past.at(start.wrapping_add(2)).byte & !SIGNED != 0 {
            self.counters.unknown_flags = self.counters.unknown_flags.wrapping_add(1);
            return;
        }
        // The magic is not in the checksum. What the sender's register holds
        // after the payload and the extra byte is known but for the payload:
        // that is what the remainder will have to be.
        let before = self.past.at(start.wrapping_add(1)).crc;
        let length = header + usize::from(len) + CRC_LEN;
        let remainder =
            crc::zeros(length - CRC_LEN, before ^ crc::INIT) ^ crc::step(0, kind.crc_extra);

        let end = start.wrapping_add(length as u32 - 1);
        let next = core::mem::replace(self.ending.at_mut(end), length as u8);
        *self.candidates.at_mut(start) = Candidate { remainder, next };
        self.due |= 1 << (length - header);
    }

    /// Whether `start` lies in a frame that was found, or in its signature.
    const fn is_taken(&self, start: u32) -> bool {
        let ahead = self.free_from.wrapping_sub(start);
        ahead != 0 && ahead <= (MAX_LENGTH + SIGNATURE_LEN) as u32
    }

    fn hand_over(&mut self, at: u32, length: u8) -> Delimited {
        let after = at.wrapping_add(1);
        let start = after.wrapping_sub(u32::from(length));
        let header = |nth: u32| self.past.at(start.wrapping_add(nth)).byte;
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
            *byte = self.past.at(first.wrapping_add(nth)).byte;
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
