//! The bytes of the line that may still be part of a frame, with their stamps.
//!
//! *Design.* They are in one piece, so that a frame is parsed in place. They move
//! to the front when new bytes would not fit behind them.
//!
//! *Limits.* It takes only what it has room for. It has room as long as it holds
//! less than a longest frame.

use timebase::{CORE_HZ, Stamp, StampedByte};

/// The most bytes that are held.
pub(crate) const CAPACITY: usize = 512;

/// Bytes of the line; see the [module](self).
#[derive(Clone, Debug)]
pub(crate) struct Window {
    bytes: [u8; CAPACITY],
    stamps: [Stamp; CAPACITY],
    /// The held bytes are `start..end`.
    start: usize,
    end: usize,
    /// The longest time from byte to byte that is no gap. [cycles]
    gap: u32,
    /// The last byte that was removed.
    last: Option<Stamp>,
    /// For how long the line had been busy by then; `u64::MAX` while it was never seen idle. [cycles]
    busy: u64,
}

impl Window {
    pub(crate) const fn at(baud: u32) -> Self {
        Self {
            bytes: [0; CAPACITY],
            stamps: [Stamp(0); CAPACITY],
            start: 0,
            end: 0,
            gap: gap(baud),
            last: None,
            busy: u64::MAX,
        }
    }

    /// The bytes to come are sent at another rate. Whether the line is idle is not known until it
    /// was seen so at that.
    pub(crate) const fn handle_baud(&mut self, baud: u32) {
        self.gap = gap(baud);
        (self.last, self.busy) = (None, u64::MAX);
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

    /// When the held byte `index` arrived.
    #[inline]
    pub(crate) fn stamp(&self, index: usize) -> Option<Stamp> {
        self.stamps.get(self.start.wrapping_add(index)).copied()
    }

    /// Takes the first of `bytes`, as many as it has room for, and returns how many: at least
    /// `CAPACITY` less what is held.
    #[inline]
    pub(crate) fn fill(&mut self, bytes: &[StampedByte]) -> usize {
        if self.end.saturating_add(bytes.len()) > CAPACITY {
            self.move_to_front();
        }
        let free = (
            self.bytes.get_mut(self.end..),
            self.stamps.get_mut(self.end..),
        );
        let (Some(free_bytes), Some(free_stamps)) = free else {
            return 0;
        };
        let taken = bytes.len().min(free_bytes.len());
        for ((byte, stamp), from) in free_bytes.iter_mut().zip(free_stamps).zip(bytes) {
            *byte = from.byte;
            *stamp = from.stamp;
        }
        self.end = self.end.wrapping_add(taken);
        taken
    }

    /// For how long the line had been busy without a gap when the oldest byte came; `u64::MAX`
    /// where it was never seen idle. [cycles]
    #[inline]
    pub(crate) fn busy(&self) -> u64 {
        match (self.stamp(0), self.last) {
            (Some(stamp), Some(last)) => {
                let since = stamp.0.wrapping_sub(last.0);
                if since > self.gap {
                    0
                } else {
                    self.busy.saturating_add(since.into())
                }
            }
            _ => self.busy,
        }
    }

    /// Removes the `length` oldest bytes, or all.
    #[inline]
    pub(crate) fn give_up(&mut self, length: usize) {
        let until = self.start.saturating_add(length).min(self.end);
        let gone = self.stamps.get(self.start..until).unwrap_or_default();
        if let Some((first, rest)) = gone.split_first() {
            let mut busy = self.busy();
            let mut begin = *first;
            let last = *rest.last().unwrap_or(first);
            // Bytes that took no longer than they had to have no gap between them.
            let least = (rest.len() as u32).wrapping_mul(self.gap / 3);
            if last.0.wrapping_sub(first.0) > least.saturating_add(self.gap / 3) {
                (busy, begin) = newest_run(rest, (busy, begin), self.gap);
            }
            self.busy = busy.saturating_add(last.0.wrapping_sub(begin.0).into());
            self.last = Some(last);
        }
        self.start = self.start.wrapping_add(length);
        if self.start >= self.end {
            (self.start, self.end) = (0, 0);
        }
    }

    #[cold]
    fn move_to_front(&mut self) {
        move_to_front(&mut self.bytes, self.start, self.end);
        move_to_front(&mut self.stamps, self.start, self.end);
        (self.start, self.end) = (0, self.len());
    }
}

/// For how long the line had been busy at the first byte behind the last gap, and that byte; of the
/// bytes `rest` behind the one that `run` begins with.
#[inline(never)]
fn newest_run(rest: &[Stamp], run: (u64, Stamp), gap: u32) -> (u64, Stamp) {
    let mut newest = run;
    let mut last = run.1;
    for stamp in rest {
        if stamp.0.wrapping_sub(last.0) > gap {
            newest = (0, *stamp);
        }
        last = *stamp;
    }
    newest
}

/// The longest time from byte to byte on a line that is busy: two byte times, and the one that the
/// byte itself takes. [cycles]
const fn gap(baud: u32) -> u32 {
    let Some(byte) = (CORE_HZ * 10).checked_div(baud) else {
        return 0;
    };
    byte * 3
}

/// Moves `start..end` of `items` to their front, in strides that do not overlap:
/// `copy_within` would add 1.4 KB of code to the image.
fn move_to_front<T: Copy>(items: &mut [T], start: usize, end: usize) {
    let stride = start.max(1);
    let Some(held) = items.get_mut(..end) else {
        return;
    };
    let mut to = 0;
    while let Some((front, rest)) = held
        .get_mut(to..)
        .and_then(|h| h.split_at_mut_checked(stride))
    {
        let length = front.len().min(rest.len());
        if let (Some(front), Some(rest)) = (front.get_mut(..length), rest.get(..length)) {
            front.copy_from_slice(rest);
        }
        to = to.wrapping_add(length.max(1));
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use crate::kind::LONGEST;

    #[test]
    fn a_line_is_busy_from_the_first_byte_behind_a_gap_on() {
        const BYTE: u32 = CORE_HZ / 11_520;
        const GAP: u32 = 3 * BYTE + 1;
        let mut at = 0_u32;
        let mut stamps = |after: u32, times: usize| -> Vec<StampedByte> {
            let next = || {
                at = at.wrapping_add(after);
                let stamp = Stamp(at);
                StampedByte { stamp, byte: 0 }
            };
            core::iter::repeat_with(next).take(times).collect()
        };
        let mut window = Window::at(115_200);
        // It was never seen idle; three byte times are no gap.
        window.fill(&stamps(GAP - 1, 5));
        window.give_up(4);
        assert_eq!(window.busy(), u64::MAX);
        // Of three runs the last one counts, and the byte behind it is a part of it.
        window.fill(&stamps(GAP, 1));
        window.fill(&stamps(BYTE, 9));
        window.fill(&stamps(GAP, 1));
        window.fill(&stamps(BYTE, 9));
        window.fill(&stamps(BYTE, 1));
        window.give_up(21);
        assert_eq!(window.busy(), u64::from(BYTE) * 10);
        // A full line, beyond the end of the stamps' word.
        let mut busy = window.busy();
        for pieces in 1..2_000_u32 {
            let length = 1 + pieces as usize % 400;
            window.fill(&stamps(GAP - 1, length));
            window.give_up(length);
            busy += length as u64 * u64::from(GAP - 1);
            assert_eq!(window.busy(), busy);
        }
        assert!(busy > 1 << u32::BITS);
        window.fill(&stamps(GAP, 1));
        window.give_up(1);
        assert_eq!(window.busy(), 0);
        // At another rate nothing is known before the next gap, which is longer.
        window.handle_baud(38_400);
        window.fill(&stamps(9 * BYTE, 2));
        window.give_up(2);
        assert_eq!(window.busy(), u64::MAX);
        window.fill(&stamps(9 * BYTE + 4, 1));
        window.give_up(1);
        assert_eq!(window.busy(), 0);
    }

    #[test]
    fn there_is_room_as_long_as_less_than_a_longest_frame_is_held() {
        let mut counter = 0_u32;
        let mut window = Window::at(115_200);
        let mut oldest = 1;
        for round in 0..2_000 {
            let left = round % LONGEST;
            let bytes: Vec<_> = (0..CAPACITY - LONGEST)
                .map(|_| {
                    counter += 1;
                    StampedByte {
                        stamp: Stamp(counter),
                        byte: counter as u8,
                    }
                })
                .collect();
            assert_eq!(window.fill(&bytes), bytes.len());
            let gone = window.len() - left;
            window.give_up(gone);
            oldest += gone as u32;
            assert_eq!(window.len(), left);
            // The rest is still what came, stamp and byte.
            for (index, byte) in window.held().iter().enumerate() {
                let expected = oldest + index as u32;
                assert_eq!(window.stamp(index), Some(Stamp(expected)));
                assert_eq!(*byte, expected as u8);
            }
        }
    }
}
