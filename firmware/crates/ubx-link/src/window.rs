//! The bytes that are not decided yet, with their stamps.
//!
//! *Purpose.* To hold bytes back until every offset in them has been tried.
//!
//! *Design.* They lie in one piece, so that a frame is read where it lies. They
//! move to the front when a longest frame would no longer fit behind the first of
//! them, which is at most once in [`CAPACITY`] − [`LONGEST`] bytes.
//!
//! *Limits.* It takes what there is room for. There is room as long as less than
//! a longest frame is held.

use timebase::{Stamp, StampedByte};

use crate::kind::LONGEST;

const CAPACITY: usize = 512;

/// Bytes of the line; see the [module](self).
#[derive(Clone, Debug)]
pub(crate) struct Window {
    bytes: [u8; CAPACITY],
    stamps: [Stamp; CAPACITY],
    /// The held bytes are `start..end`.
    start: usize,
    end: usize,
}

impl Window {
    pub(crate) const fn new() -> Self {
        Self {
            bytes: [0; CAPACITY],
            stamps: [Stamp(0); CAPACITY],
            start: 0,
            end: 0,
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

    /// Takes bytes from `next`, as many as there is room for; `true` if `next`
    /// ran dry.
    #[inline]
    pub(crate) fn fill(&mut self, mut next: impl FnMut() -> Option<StampedByte>) -> bool {
        let mut end = self.end;
        let mut dry = false;
        while let (Some(byte), Some(stamp)) = (self.bytes.get_mut(end), self.stamps.get_mut(end)) {
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
    #[inline]
    pub(crate) fn give_up(&mut self, length: usize) {
        self.start = self.start.wrapping_add(length);
        if self.start >= self.end {
            (self.start, self.end) = (0, 0);
        } else if self.start > CAPACITY - LONGEST {
            self.move_to_front();
        }
    }

    #[cold]
    fn move_to_front(&mut self) {
        self.bytes.copy_within(self.start..self.end, 0);
        self.stamps.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_room_as_long_as_less_than_a_longest_frame_is_held() {
        let mut counter = 0_u32;
        let mut next = || {
            counter += 1;
            Some(StampedByte {
                stamp: Stamp(counter),
                byte: counter as u8,
            })
        };
        let mut window = Window::new();
        let mut oldest = 1;
        for round in 0..2_000 {
            let left = round % LONGEST;
            assert!(!window.fill(&mut next));
            assert!(window.len() >= LONGEST);
            let gone = window.len() - left;
            window.give_up(gone);
            oldest += gone as u32;
            assert_eq!(window.len(), left);
            // What is left is still what came, stamp and byte.
            for (index, byte) in window.held().iter().enumerate() {
                let expected = oldest + index as u32;
                assert_eq!(window.stamp(index), Some(Stamp(expected)));
                assert_eq!(*byte, expected as u8);
            }
        }
    }
}
