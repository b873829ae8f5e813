//! The status over MAVLink: LOG_DATA of log 2, piece by piece.
//!
//! *Purpose.* A board without a probe says over its line what it writes into its log: `key=value` and a
//! blank, again and again. A client asks for log 2 from its beginning, as it does for a file, and so
//! any ground station that downloads logs by number can read it.
//!
//! *Design.* There is no copy of the text. For each piece the board goes through its words
//! ([`StatusLine`]), and those are written that have not been sent; what is behind the piece's end
//! waits for the next one. So a word is whole and of one moment, and the words are of moments that lie
//! apart as the pieces do.
//!
//! *Limits.* Log 2 is not listed, and can be read from its beginning only.

use mavlink::dialects::common::LOG_DATA_DATA;
use timebase::divide;

use crate::frame::{Frame, Sender, Version};
use crate::log_transfer::LOG_DATA_LEN;

/// The number under which the status can be read as a log.
pub(crate) const STATUS_ID: u16 = 2;

/// A piece, and behind it the longest word, in bytes: what is longer is cut.
const ROOM: usize = LOG_DATA_LEN + 70;

/// Digits of the largest number.
const DIGITS: usize = 20;

/// Where a node finds the status of its board.
pub trait StatusLine {
    /// Writes all words, always the same ones in the same order. A counter of 0 is written too: the
    /// writer leaves it out.
    fn write_status(&self, line: &mut StatusWriter<'_>);
}

/// What is still to be sent.
#[derive(Debug)]
pub(crate) struct StatusTransfer {
    version: Version,
    is_wanted: bool,
    /// Words that were written for earlier pieces.
    words: u16,
    /// Where the next piece begins in the text, in bytes.
    offset: u32,
    text: [u8; ROOM],
    len: usize,
}

/// Takes the words of a status.
#[derive(Debug)]
pub struct StatusWriter<'a> {
    transfer: &'a mut StatusTransfer,
    seen: u16,
}

impl StatusWriter<'_> {
    /// A word; an empty one is left out. Blanks in it become `_`, since a blank ends it.
    pub fn word(&mut self, key: &str, value: &str) {
        if self.takes_next() && !value.is_empty() {
            self.begin(key);
            let without_blanks = |byte| if byte == b' ' { b'_' } else { byte };
            self.transfer.push(value.bytes().map(without_blanks));
            self.transfer.push(*b" ");
        }
    }

    /// A number, in its decimal digits.
    pub fn number(&mut self, key: &str, value: i64) {
        let sign = if value < 0 { b'-' } else { 0 };
        self.signed(key, sign, value.unsigned_abs());
    }

    /// A number without a sign.
    pub fn unsigned(&mut self, key: &str, value: u64) {
        self.signed(key, 0, value);
    }

    /// A counter: left out while it is 0. The name of what it is of stands before the key, as in
    /// `mav2_overrun`, unless it is empty.
    #[inline(never)]
    pub fn count_of(&mut self, name: &str, key: &str, count: u32) {
        if self.takes_next() && count != 0 {
            if !name.is_empty() {
                self.transfer.push(name.bytes());
                self.transfer.push(*b"_");
            }
            self.write(key, &[(0, count.into(), 1)], 0);
        }
    }

    fn signed(&mut self, key: &str, sign: u8, size: u64) {
        self.padded(key, &[(sign, size, 1)], 0);
    }

    /// Numbers in one word, as a date has them: before each a byte, or 0 for none, its value, and the
    /// digits that it has at least; and a byte behind the last one, or 0.
    pub fn padded(&mut self, key: &str, parts: &[(u8, u64, usize)], end: u8) {
        if self.takes_next() {
            self.write(key, parts, end);
        }
    }

    fn write(&mut self, key: &str, parts: &[(u8, u64, usize)], end: u8) {
        self.begin(key);
        let is_there = |byte: &u8| *byte != 0;
        for &(before, number, width) in parts {
            self.transfer.push(Some(before).filter(is_there));
            self.transfer.digits(number, width);
        }
        self.transfer.push(Some(end).filter(is_there));
        self.transfer.push(*b" ");
    }

    /// Whether the word that comes now has its turn in this piece; it counts as written then.
    fn takes_next(&mut self) -> bool {
        let is_next = self.seen == self.transfer.words && self.transfer.len < LOG_DATA_LEN;
        self.seen = self.seen.wrapping_add(1);
        if is_next {
            self.transfer.words = self.seen;
        }
        is_next
    }

    fn begin(&mut self, key: &str) {
        self.transfer.push(key.bytes());
        self.transfer.push(*b"=");
    }
}

impl StatusTransfer {
    pub(crate) const NONE: Self = Self {
        version: Version::V1,
        is_wanted: false,
        words: 0,
        offset: 0,
        text: [0; ROOM],
        len: 0,
    };

    /// From the beginning, whatever was asked for before.
    pub(crate) fn want(&mut self, version: Version) {
        *self = Self {
            version,
            is_wanted: true,
            ..Self::NONE
        };
        self.push("status ".bytes());
    }

    pub(crate) const fn is_done(&self) -> bool {
        !self.is_wanted
    }

    pub(crate) fn poll(&mut self, sender: &mut Sender, board: &impl StatusLine) -> Option<Frame> {
        if !self.is_wanted {
            return None;
        }
        board.write_status(&mut StatusWriter {
            transfer: self,
            seen: 0,
        });
        let mut data = [0; LOG_DATA_LEN];
        let count = self.len.min(LOG_DATA_LEN);
        for (place, &byte) in data.iter_mut().zip(self.text.iter().take(count)) {
            *place = byte;
        }
        // A piece that is not full is the last one.
        self.is_wanted = count == LOG_DATA_LEN;
        self.text.copy_within(count.., 0);
        self.len -= count;
        let piece = LOG_DATA_DATA {
            ofs: self.offset,
            id: STATUS_ID,
            count: count as u8,
            data,
        };
        self.offset = self.offset.wrapping_add(count as u32);
        Some(sender.message(self.version, &piece))
    }

    fn push(&mut self, bytes: impl IntoIterator<Item = u8>) {
        for byte in bytes {
            if let Some(place) = self.text.get_mut(self.len) {
                *place = byte;
                self.len += 1;
            }
        }
    }

    /// A number with at least `width` digits.
    fn digits(&mut self, number: u64, width: usize) {
        let mut digits = [b'0'; DIGITS];
        let mut rest = number;
        let mut first = DIGITS;
        for (at, digit) in digits.iter_mut().enumerate().rev() {
            if rest == 0 && DIGITS - first >= width {
                break;
            }
            let tens = divide::<10>(rest);
            *digit = b'0' + (rest - tens * 10) as u8;
            rest = tens;
            first = at;
        }
        self.push(digits.into_iter().skip(first));
    }
}
