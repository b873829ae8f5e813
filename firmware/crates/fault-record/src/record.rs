//! A fault in words that outlive a reset.
//!
//! | word | holds |
//! |---|---|
//! | 0 | [`MAGIC`], and the lowest bit of the upper half: the record was reported |
//! | 1 | the reason, and in its second byte the kind of place |
//! | 2, 3 | the place: an address, and a number |
//! | 4 to 13 | [`Registers`] in their order |
//! | 14, 15 | the history |
//! | 16 | up time |
//! | 17 | CRC-32 of all the others and of the image's number |

use crate::history::History;
use crate::reason::Reason;

/// Words of a record.
pub const WORDS: usize = 18;

const MAGIC: u32 = 0x0000_C10C;
const REPORTED: u32 = 1 << 16;

/// Where it happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// It is not known.
    Unknown,
    /// The instruction at this address.
    Instruction(u32),
    /// A line of the program's source.
    Source {
        /// Where the file's name is, in the image.
        file: u32,
        /// Its length in bytes.
        len: u16,
        /// The line.
        line: u16,
    },
    /// The stack was full, and with it went the place.
    StackOverflow,
}

/// The core's registers as a fault found them; 0 where they are not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Registers {
    /// r0 to r3.
    pub r: [u32; 4],
    /// r12.
    pub r12: u32,
    /// The link register: who called.
    pub lr: u32,
    /// The stack pointer.
    pub sp: u32,
    /// The program status, with the number of the exception that ran.
    pub xpsr: u32,
    /// The configurable fault status.
    pub cfsr: u32,
    /// The address whose access failed.
    pub address: u32,
}

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Why the run ended.
    pub reason: Reason,
    /// Where.
    pub place: Place,
    /// The core's registers.
    pub registers: Registers,
    /// How long the run had lasted. \[ms\]
    pub up_ms: u32,
    /// The restarts before.
    pub history: History,
    /// Whether the run after it has reported it.
    pub is_reported: bool,
}

impl Record {
    /// The record as words, for the image with the number `image`.
    #[must_use]
    pub fn to_words(&self, image: u32) -> [u32; WORDS] {
        let (kind, address, number) = match self.place {
            Place::Unknown => (0, 0, 0),
            Place::Instruction(address) => (1, address, 0),
            Place::Source { file, len, line } => (2, file, u32::from(len) << 16 | u32::from(line)),
            Place::StackOverflow => (3, 0, 0),
        };
        let Registers {
            r: [r0, r1, r2, r3],
            r12,
            lr,
            sp,
            xpsr,
            cfsr,
            address: failed,
        } = self.registers;
        let [last, before] = self.history.ages_ms;
        let reported = if self.is_reported { REPORTED } else { 0 };
        let mut words = [
            MAGIC | reported,
            self.reason.to_word() | kind << 8,
            address,
            number,
            r0,
            r1,
            r2,
            r3,
            r12,
            lr,
            sp,
            xpsr,
            cfsr,
            failed,
            last,
            before,
            self.up_ms,
            0,
        ];
        let crc = checksum(&words, image);
        if let Some(place) = words.last_mut() {
            *place = crc;
        }
        words
    }

    /// The record in `words`, if the image with the number `image` has written one there.
    #[must_use]
    pub fn from_words(words: &[u32; WORDS], image: u32) -> Option<Self> {
        let &[
            head,
            reason,
            address,
            number,
            r0,
            r1,
            r2,
            r3,
            r12,
            lr,
            sp,
            xpsr,
            cfsr,
            failed,
            last,
            before,
            up_ms,
            crc,
        ] = words;
        if head & !REPORTED != MAGIC || crc != checksum(words, image) {
            return None;
        }
        let place = match reason >> 8 & 0xFF {
            0 => Place::Unknown,
            1 => Place::Instruction(address),
            2 => Place::Source {
                file: address,
                len: (number >> 16) as u16,
                line: number as u16,
            },
            3 => Place::StackOverflow,
            _ => return None,
        };
        Some(Self {
            reason: Reason::from_word(reason)?,
            place,
            registers: Registers {
                r: [r0, r1, r2, r3],
                r12,
                lr,
                sp,
                xpsr,
                cfsr,
                address: failed,
            },
            up_ms,
            history: History {
                ages_ms: [last, before],
            },
            is_reported: head & REPORTED != 0,
        })
    }
}

/// CRC-32 (reflected 0xEDB8_8320) of the image's number and of all words but the last, which holds it.
fn checksum(words: &[u32; WORDS], image: u32) -> u32 {
    let [kept @ .., _] = words;
    let mut crc = u32::MAX;
    for word in core::iter::once(&image).chain(kept) {
        crc ^= word;
        for _ in 0..u32::BITS {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 };
        }
    }
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Hang;

    const IMAGE: u32 = 0x0801_9ABC;

    fn records() -> impl Iterator<Item = Record> {
        let reasons = [
            Reason::Panic,
            Reason::HardFault,
            Reason::Unexpected(16 + 67),
            Reason::Crystal,
            Reason::Task(Hang::Gnss),
            Reason::Task(Hang::Mavlink),
            Reason::Watchdog,
        ];
        let places = [
            Place::Unknown,
            Place::Instruction(0x0800_4123),
            Place::Source {
                file: 0x0801_8000,
                len: 300,
                line: 65_535,
            },
            Place::StackOverflow,
        ];
        reasons.into_iter().flat_map(move |reason| {
            places.map(|place| Record {
                reason,
                place,
                registers: Registers {
                    r: [1, 2, 3, u32::MAX],
                    r12: 5,
                    lr: 6,
                    sp: 7,
                    xpsr: 8,
                    cfsr: 9,
                    address: 10,
                },
                up_ms: 123_456,
                history: History {
                    ages_ms: [77, u32::MAX],
                },
                is_reported: reason == Reason::Panic,
            })
        })
    }

    #[test]
    fn what_was_written_is_read_by_the_same_image_alone() {
        for record in records() {
            let words = record.to_words(IMAGE);
            assert_eq!(Record::from_words(&words, IMAGE), Some(record));
            assert_eq!(Record::from_words(&words, IMAGE + 4), None);
        }
    }

    #[test]
    fn one_changed_bit_anywhere_is_no_record() {
        for record in records() {
            let words = record.to_words(IMAGE);
            for bit in 0..WORDS * 32 {
                let mut changed = words;
                changed[bit / 32] ^= 1 << (bit % 32);
                assert_eq!(Record::from_words(&changed, IMAGE), None, "bit {bit}");
            }
        }
    }

    #[test]
    fn words_as_power_on_leaves_them_are_no_record() {
        for image in [0, IMAGE, u32::MAX] {
            for fill in [0, u32::MAX, 0xCCCC_CCCC, MAGIC] {
                assert_eq!(Record::from_words(&[fill; WORDS], image), None);
            }
        }
    }
}
