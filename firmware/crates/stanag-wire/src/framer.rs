//! Finds the wanted frames in the bytes of a serial line, whatever else is on it.
//!
//! *Purpose.* Takes byte by byte, and hands over each frame that can be believed at its last byte, with the
//! stamp of its first.
//!
//! *Design.* The sum is weak, so a frame counts only if everything agrees that can be checked: ffff, a
//! [wanted](Wanted) message, IDD 30, a destination that is ours or all, a checksum code that is assigned
//! and not 00, the length that the presence vector says, and the sum. A header that fulfils this makes a
//! *candidate*. Candidates are kept side by side and none waits for another, so that no false length
//! holds up a good frame. Each is checked at its last byte by the difference of two running sums.
//!
//! Found frames do not overlap: one that is found discards what began before its end, and of two that end
//! together the longer counts.
//!
//! *Cost.* A byte is stored with the running sum, and compared with what Message Properties may be. Those
//! stand behind a wanted type, at most once in four bytes; the whole header agrees at most once in ten
//! bytes, because a second one would have to share its destination, its type or its properties with the
//! first. So no more than five candidates wait at a time. `cargo xtask bench` measures noise that was made
//! to cost most.
//!
//! *Limits.* A presence vector with bits that the table does not have is not believed: nothing confirms
//! its length. Frames of Edition 4, whose sum is not known, are not found. Positions are counted modulo
//! 2^32.

use core::marker::PhantomData;

use timebase::{Stamp, StampedByte};

use crate::fields::Layout;
use crate::frame::{Header, WRAPPER};
use crate::node_id::NodeId;

/// Positions that are kept: a power of two, and at least the longest wanted frame.
const RING: usize = 64;
/// Candidates that wait at a time. As the longest frame has 64 bytes and headers are 10 apart, there are
/// never more than five.
const CANDIDATES: usize = 6;
/// Message Properties of Edition 3, without the bit that asks for an acknowledgement and the sum's code.
const EDITION_3: u32 = (Header::EDITION_3 as u32) << 8;
/// The other bits.
const PROPERTIES: u32 = 0x7F3F;
/// Where the first sum of a cell stands: above its byte.
const SUM_AT: u32 = 8;

/// Which messages a framer looks for.
pub trait Wanted {
    /// The fields of a message that is wanted.
    fn layout(message: u16) -> Option<&'static Layout>;
}

/// What a framer has found so far. All wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FramerCounters {
    /// Frames that were handed over.
    pub frames: u32,
    /// Bytes that are in no such frame.
    pub foreign_bytes: u32,
    /// Headers that agree, with another sum behind their data.
    pub sum_failures: u32,
    /// Headers and sums that agree, with another length than the presence vector says.
    pub length_failures: u32,
    /// Headers that agree, with checksum code 00 or 11: not believed on a serial line.
    pub without_sum: u32,
    /// Candidates that were given up, because the line fell silent before their ends.
    pub abandoned: u32,
}

/// One position of the stream: the byte's stamp, and the sum of all bytes before it above the byte.
#[derive(Clone, Copy, Debug)]
struct Cell {
    stamp: Stamp,
    word: u32,
}

impl Cell {
    const NOTHING: Self = Self {
        stamp: Stamp(0),
        word: 0,
    };

    const fn byte(self) -> u8 {
        self.word as u8
    }

    /// Modulo 2^24; a frame's is below 2^14.
    const fn sum_before(self) -> u32 {
        self.word >> SUM_AT
    }
}

/// A frame whose header agrees.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    end: u32,
    length: u8,
}

/// Looks for the frames that `W` wants and that are for us or for all.
#[derive(Debug)]
pub struct Framer<W> {
    us: u32,
    cells: [Cell; RING],
    /// The number of bytes that have come: the position of the next one.
    position: u32,
    /// The sum of all bytes, modulo 2^24 in a cell.
    sum: u32,
    /// The last four bytes.
    last: u32,
    /// A bit for each of the next positions: a candidate's last byte. Bit 0 is the byte that came.
    due: u64,
    candidates: [Candidate; CANDIDATES],
    waiting: usize,
    /// The first position that is in no found frame and was not given up.
    free_from: u32,
    counters: FramerCounters,
    framed_bytes: u32,
    wanted: PhantomData<W>,
}

impl<W: Wanted> Framer<W> {
    /// A framer that has received nothing, for the node `us`.
    #[must_use]
    pub const fn new(us: NodeId) -> Self {
        Self {
            us: us.0,
            cells: [Cell::NOTHING; RING],
            position: 0,
            sum: 0,
            last: 0,
            due: 0,
            candidates: [Candidate { end: 0, length: 0 }; CANDIDATES],
            waiting: 0,
            free_from: 0,
            counters: FramerCounters {
                frames: 0,
                foreign_bytes: 0,
                sum_failures: 0,
                length_failures: 0,
                without_sum: 0,
                abandoned: 0,
            },
            framed_bytes: 0,
            wanted: PhantomData,
        }
    }

    /// What was found so far.
    #[must_use]
    pub const fn counters(&self) -> FramerCounters {
        FramerCounters {
            foreign_bytes: self.position.wrapping_sub(self.framed_bytes),
            ..self.counters
        }
    }

    /// Takes a byte, and returns the length of the frame that it ends, for [`Self::take`]; 0 for none.
    #[inline]
    pub fn push(&mut self, StampedByte { stamp, byte }: StampedByte) -> usize {
        let value = u32::from(byte);
        let word = self.sum << SUM_AT | value;
        if let Some(cell) = self.cells.get_mut(self.position as usize % RING) {
            *cell = Cell { stamp, word };
        }
        self.sum = self.sum.wrapping_add(value);
        self.last = self.last << 8 | value;
        self.position = self.position.wrapping_add(1);
        self.due >>= 1;
        if self.last & PROPERTIES == EDITION_3 {
            self.handle_properties();
        }
        if self.due & 1 == 0 {
            return 0;
        }
        self.handle_ends()
    }

    /// Copies the frame of that length which the last byte ended to `out`, and returns the stamp of its
    /// first byte.
    pub fn take(&self, length: usize, out: &mut [u8]) -> Stamp {
        let start = self.position.wrapping_sub(length as u32);
        for (place, position) in out.iter_mut().take(length).zip(0..) {
            *place = self.cell(start.wrapping_add(position)).byte();
        }
        self.cell(start).stamp
    }

    /// The stamp of the last byte; `None` when what has come is in no frame that could still end.
    #[must_use]
    pub fn newest(&self) -> Option<Stamp> {
        let newest = self.position.wrapping_sub(1);
        (self.position != self.free_from).then(|| self.cell(newest).stamp)
    }

    /// Gives up what has begun: the line was silent for so long that no frame goes on.
    pub fn give_up(&mut self) {
        let waiting = self.waiting as u32;
        self.counters.abandoned = self.counters.abandoned.wrapping_add(waiting);
        self.discard();
    }

    fn discard(&mut self) {
        self.due = 0;
        self.waiting = 0;
        self.free_from = self.position;
    }

    fn cell(&self, position: u32) -> Cell {
        let cell = self.cells.get(position as usize % RING);
        cell.copied().unwrap_or(Cell::NOTHING)
    }

    fn word(&self, position: u32) -> u32 {
        let bytes = [0, 1, 2, 3].map(|n| self.cell(position.wrapping_add(n)).byte());
        u32::from_be_bytes(bytes)
    }

    /// The last two bytes may be Message Properties: is what stands before them a header?
    #[inline(never)]
    fn handle_properties(&mut self) {
        let start = self.position.wrapping_sub(WRAPPER as u32);
        let head = self.word(start);
        // What noise has least often is looked at first.
        if head >> 16 != 0xFFFF {
            return;
        }
        let Some(layout) = W::layout((self.last >> 16) as u16) else {
            return;
        };
        let is_free = self.position.wrapping_sub(self.free_from) >= WRAPPER as u32;
        let destination = self.word(start.wrapping_add(8));
        let is_for_us = destination == self.us || destination == NodeId::BROADCAST.0;
        let length = (head & 0xFFFF) as usize;
        let least = usize::from(layout.vector);
        let is_possible = (least..=layout.longest()).contains(&length);
        if !is_free || !is_for_us || !is_possible {
            return;
        }
        let sum = match self.last >> 6 & 0b11 {
            1 => 2,
            2 => 4,
            _ => {
                self.counters.without_sum = self.counters.without_sum.wrapping_add(1);
                return;
            }
        };
        let behind = length + sum;
        let length = WRAPPER + behind;
        let place = self.candidates.get_mut(self.waiting);
        if let (Some(place), true) = (place, length <= RING) {
            *place = Candidate {
                end: self.position.wrapping_add(behind as u32),
                length: length as u8,
            };
            self.waiting += 1;
            self.due |= 1 << behind;
        }
    }

    /// Candidates end with the last byte: the longest that holds is found.
    #[inline(never)]
    fn handle_ends(&mut self) -> usize {
        let mut found = 0;
        let mut place = 0;
        while let Some(&candidate) = self.candidates.get(place)
            && place < self.waiting
        {
            if candidate.end != self.position {
                place += 1;
                continue;
            }
            let length = usize::from(candidate.length);
            if self.is_intact(length) {
                found = found.max(length);
            }
            self.waiting -= 1;
            if let Some(&last) = self.candidates.get(self.waiting)
                && let Some(here) = self.candidates.get_mut(place)
            {
                *here = last;
            }
        }
        if found > 0 {
            self.counters.frames = self.counters.frames.wrapping_add(1);
            self.framed_bytes = self.framed_bytes.wrapping_add(found as u32);
            self.discard();
        }
        found
    }

    /// Whether sum and presence vector of the frame of that length, which has just ended, agree with it.
    fn is_intact(&mut self, length: usize) -> bool {
        let start = self.position.wrapping_sub(length as u32);
        let at = |offset: usize| start.wrapping_add(offset as u32);
        let behind = |offset: usize, width: usize| {
            let bytes = (0..width).map(|n| self.cell(at(offset + n)).byte());
            bytes.fold(0, |value, byte| value << 8 | u32::from(byte))
        };
        let [kind, properties] = [behind(12, 2), behind(14, 2)];
        let width = if properties >> 6 & 0b11 == 1 { 2 } else { 4 };
        let data = usize::from(self.cell(at(3)).byte());
        let sums = [at(WRAPPER + data), start].map(|it| self.cell(it).sum_before());
        let sum = sums[0].wrapping_sub(sums[1]) & 0x00FF_FFFF;
        if behind(WRAPPER + data, width) != sum {
            self.counters.sum_failures = self.counters.sum_failures.wrapping_add(1);
            return false;
        }
        let says = W::layout(kind as u16).and_then(|layout| {
            let vector = behind(WRAPPER, usize::from(layout.vector).min(4));
            layout.length_of(vector.into())
        });
        if says != Some(data) {
            self.counters.length_failures = self.counters.length_failures.wrapping_add(1);
            return false;
        }
        true
    }
}
