//! Reads as somebody does who takes one frame after the other: what a header claims is skipped.

use super::cell::Word;
use super::{Framer, SIGNATURE_LEN, SIGNED};
use crate::frame::{CRC_LEN, HEADER_V1, HEADER_V2, MAGIC_V1, MAGIC_V2};
use crate::kind::Wanted;

/// What a reader of one frame after the other finds at a position.
enum Claim {
    /// No header, or one whose checksum is known to fail.
    None,
    /// A frame of this length, with its signature: intact, or of a kind that cannot be checked.
    Stands(u32),
    /// A frame that has not ended.
    Open,
}

impl<W: Wanted, const PAYLOAD: usize, const ENDS: usize> Framer<W, PAYLOAD, ENDS> {
    /// Goes on as a reader that takes one frame after the other, up to `to`, where it is decided
    /// what it takes. Whether `to` is inside of what a header before it claims. Headers that begin
    /// before `to` have to be complete.
    #[inline(never)]
    pub(super) fn read_on(&mut self, to: u32) -> bool {
        loop {
            let left = to.wrapping_sub(self.read_to).cast_signed();
            if left <= 0 {
                return left < 0;
            }
            let (block, place) = (self.read_to / 32, self.read_to % 32);
            let ahead = match self.starts.at(block) >> place {
                0 => 32 - place,
                starts => starts.trailing_zeros(),
            };
            if ahead >= left.unsigned_abs() {
                self.read_to = to;
                return false;
            }
            self.read_to = self.read_to.wrapping_add(ahead);
            if place + ahead == 32 {
                continue;
            }
            match self.claim(self.read_to) {
                Claim::None => self.read_to = self.read_to.wrapping_add(1),
                Claim::Stands(length) => self.read_to = self.read_to.wrapping_add(length),
                // It ends behind the last byte, and so behind `to`.
                Claim::Open => return true,
            }
        }
    }

    fn claim(&self, start: u32) -> Claim {
        let first = self.cells.at(start).word;
        let at = |nth: u32| self.byte(start.wrapping_add(nth));
        let (header_len, is_signed) = match first.byte() {
            MAGIC_V1 => (HEADER_V1, false),
            // Frames with other flags have to be dropped, and who knows what their length means.
            MAGIC_V2 if at(2) & !SIGNED == 0 => (HEADER_V2, at(2) == SIGNED),
            _ => return Claim::None,
        };
        let length = (header_len + CRC_LEN) as u32 + u32::from(at(1));
        let signature_len = if is_signed { SIGNATURE_LEN as u32 } else { 0 };
        if first.is_due(Word::INTACT) || self.shape_at(start).is_none() {
            return Claim::Stands(length + signature_len);
        }
        let end = start.wrapping_add(length);
        if end.wrapping_sub(self.position).cast_signed() > 0 {
            Claim::Open
        } else {
            Claim::None
        }
    }
}
