//! The bytes that are not decided yet, with their stamps and a running checksum.
//!
//! *Purpose.* To hold bytes back until every offset in them has been tried, at a
//! few instructions a byte whatever the bytes are.
//!
//! *Design.* UBX's checksum is Fletcher's: `A` is the sum of the bytes and `B` the
//! sum of all values that `A` took. Both are kept for a stretch that begins at the
//! oldest byte and slides: a byte that enters behind adds itself to `A` and `A` to
//! `B`; one that leaves in front had been counted once in `A` and, in a stretch of
//! `n`, `n` times in `B`. So the longest frame's checksum follows the search from
//! candidate to candidate, and each byte enters and leaves once, however many
//! headers stand in the noise. The sums are 32 bits wide and may wrap: a checksum
//! is their lowest eight.
//!
//! The bytes lie in one piece, so that a frame is read where it lies. They move to
//! the front when a longest frame would no longer fit behind the first of them,
//! which is at most once in [`CAPACITY`] − [`LONGEST`] bytes.
//!
//! *Limits.* It takes what there is room for. There is room as long as less than
//! a longest frame is held.

use timebase::{Stamp, StampedByte};

use crate::kind::{LONGEST, SYNC_1, SYNC_2};

const CAPACITY: usize = 256;

/// How much of a frame its checksum stands behind, sync included.
const CHECKSUM_LEN: usize = 2;

/// Bytes of the line; see the [module](self).
#[derive(Clone, Debug)]
pub(crate) struct Window {
    bytes: [u8; CAPACITY],
    stamps: [Stamp; CAPACITY],
    /// The held bytes are `start..end`.
    start: usize,
    end: usize,
    /// The sums are those of `start..summed`.
    summed: usize,
    sum: u32,
    sum_of_sums: u32,
}

impl Window {
    pub(crate) const fn new() -> Self {
        Self {
            bytes: [0; CAPACITY],
            stamps: [Stamp(0); CAPACITY],
            start: 0,
            end: 0,
            summed: 0,
            sum: 0,
            sum_of_sums: 0,
        }
    }

    #[inline]
    pub(crate) const fn len(&self) -> usize {
        self.end.wrapping_sub(self.start)
    }

    /// The held bytes, oldest first.
    #[inline]
    pub(crate) fn held(&self) -> &[u8] {
        self.bytes.get(self.start..self.end).unwrap_or_default()
    }

    /// When the oldest held byte arrived.
    #[inline]
    pub(crate) fn first_stamp(&self) -> Stamp {
        self.stamps.get(self.start).copied().unwrap_or_default()
    }

    /// When the newest held byte arrived; `None` if nothing is held.
    #[inline]
    pub(crate) fn last_stamp(&self) -> Option<Stamp> {
        let held = self.stamps.get(self.start..self.end)?;
        held.last().copied()
    }

    /// Takes bytes from `next`, as many as there is room for; `true` if `next`
    /// ran dry.
    #[inline]
    pub(crate) fn fill(&mut self, mut next: impl FnMut() -> Option<StampedByte>) -> bool {
        let (Some(bytes), Some(stamps)) = (
            self.bytes.get_mut(self.end..),
            self.stamps.get_mut(self.end..),
        ) else {
            return false;
        };
        let mut end = self.end;
        let mut dry = false;
        for (byte, stamp) in bytes.iter_mut().zip(stamps) {
            let Some(taken) = next() else {
                dry = true;
                break;
            };
            *byte = taken.byte;
            *stamp = taken.stamp;
            end = end.wrapping_add(1);
        }
        self.end = end;
        dry
    }

    /// Gives up the `length` oldest bytes, at most all.
    pub(crate) fn give_up(&mut self, length: usize) {
        let start = self.start.wrapping_add(length);
        if start >= self.end {
            (self.start, self.end) = (0, 0);
            self.forget_sums();
            return;
        }
        if start < self.summed {
            let mut counted = self.summed.wrapping_sub(self.start) as u32;
            let (mut sum, mut sum_of_sums) = (self.sum, self.sum_of_sums);
            for byte in self.bytes.get(self.start..start).unwrap_or_default() {
                let byte = u32::from(*byte);
                sum = sum.wrapping_sub(byte);
                sum_of_sums = sum_of_sums.wrapping_sub(byte.wrapping_mul(counted));
                counted = counted.wrapping_sub(1);
            }
            (self.sum, self.sum_of_sums) = (sum, sum_of_sums);
            self.start = start;
        } else {
            self.start = start;
            self.forget_sums();
        }
        if start > CAPACITY - LONGEST {
            self.move_to_front();
        }
    }

    const fn forget_sums(&mut self) {
        self.summed = self.start;
        (self.sum, self.sum_of_sums) = (0, 0);
    }

    #[cold]
    fn move_to_front(&mut self) {
        self.bytes.copy_within(self.start..self.end, 0);
        self.stamps.copy_within(self.start..self.end, 0);
        self.summed = self.summed.wrapping_sub(self.start);
        self.end = self.len();
        self.start = 0;
    }

    /// Whether the checksum of a longest frame at the front holds, all of which
    /// has to be held. Sums what no earlier candidate has summed.
    pub(crate) fn longest_frame_holds(&mut self) -> bool {
        const SUMMED: u32 = (LONGEST - CHECKSUM_LEN) as u32;
        const SYNC_SUM: u32 = SYNC_1 as u32 + SYNC_2 as u32;
        const SYNC_SUM_OF_SUMS: u32 = SUMMED * SYNC_1 as u32 + (SUMMED - 1) * SYNC_2 as u32;

        let until = self.start.wrapping_add(LONGEST - CHECKSUM_LEN);
        let Some(rest) = self.bytes.get(self.summed..until) else {
            return false;
        };
        let (sum, sum_of_sums) = add_up((self.sum, self.sum_of_sums), rest);
        self.summed = until;
        (self.sum, self.sum_of_sums) = (sum, sum_of_sums);
        let Some([a, b]) = self.bytes.get(until..).and_then(<[u8]>::first_chunk) else {
            return false;
        };
        let summed = (
            sum.wrapping_sub(SYNC_SUM) as u8,
            sum_of_sums.wrapping_sub(SYNC_SUM_OF_SUMS) as u8,
        );
        summed == (*a, *b)
    }

    /// Whether the checksum of a frame of `LENGTH` bytes at the front holds. Sums
    /// it anew: for short frames.
    pub(crate) fn short_frame_holds<const LENGTH: usize>(&self) -> bool {
        let frame = self.held().first_chunk::<LENGTH>();
        let Some([_, _, rest @ .., a, b]) = frame.map(<[u8; LENGTH]>::as_slice) else {
            return false;
        };
        let (sum, sum_of_sums) = add_up((0, 0), rest);
        (sum as u8, sum_of_sums as u8) == (*a, *b)
    }
}

/// `sums` with `bytes` behind, by words: on this core a byte out of a register
/// costs nothing extra, one out of memory an instruction.
#[inline]
fn add_up(sums: (u32, u32), bytes: &[u8]) -> (u32, u32) {
    let (mut sum, mut sum_of_sums) = sums;
    let mut add = |byte: u32| {
        sum = sum.wrapping_add(byte & 0xff);
        sum_of_sums = sum_of_sums.wrapping_add(sum);
    };
    let (words, rest) = bytes.as_chunks();
    for word in words {
        let word = u32::from_le_bytes(*word);
        add(word);
        add(word >> 8);
        add(word >> 16);
        add(word >> 24);
    }
    for byte in rest {
        add((*byte).into());
    }
    (sum, sum_of_sums)
}
