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
    /// The last byte that was removed, and for how long the line had been busy by then. [cycles]
    last: Option<Stamp>,
    busy: u64,
}

impl Window {
    pub(crate) const fn new() -> Self {
        Self {
            bytes: [0; CAPACITY],
            stamps: [Stamp(0); CAPACITY],
            start: 0,
            end: 0,
            last: None,
            busy: 0,
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

    /// For how long the line had been busy without a gap when the oldest byte came. [cycles]
    #[inline]
    pub(crate) fn busy(&self) -> u64 {
        match (self.stamp(0), self.last) {
            (Some(stamp), Some(last)) if self.len() > 0 => busy_after(self.busy, last, stamp),
            _ => 0,
        }
    }

    /// Removes the `length` oldest bytes, or all.
    #[inline]
    pub(crate) fn give_up(&mut self, length: usize) {
        let until = self.start.saturating_add(length).min(self.end);
        for stamp in self.stamps.get(self.start..until).unwrap_or_default() {
            if let Some(last) = self.last.replace(*stamp) {
                self.busy = busy_after(self.busy, last, *stamp);
            }
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

/// A pause from byte to byte that is longer than this is a gap: two byte times at 115200 baud, and
/// the one that the byte itself takes. At a lower rate every byte seems to follow one: nothing is
/// claimed of a line that is not yet configured. [cycles]
const GAP: u32 = CORE_HZ / 11_520 * 3;

/// For how long the line has been busy at a byte, from what it was at the byte before.
#[inline]
fn busy_after(busy: u64, last: Stamp, stamp: Stamp) -> u64 {
    let since = stamp.0.wrapping_sub(last.0);
    if since > GAP {
        0
    } else {
        busy.saturating_add(since.into())
    }
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
    fn there_is_room_as_long_as_less_than_a_longest_frame_is_held() {
        let mut counter = 0_u32;
        let mut window = Window::new();
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
