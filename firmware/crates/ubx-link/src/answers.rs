//! The answers that are only of interest while a receiver is being found: MON-VER and CFG-PRT.
//!
//! *Purpose.* What the receiver is, and which protocols its port has.
//!
//! *Design.* A reader of its own beside [`Link`](crate::Link), because a MON-VER is three times as long as the
//! longest frame of the clock, and nothing may wait behind a header that only claims to be one. It
//! takes byte by byte and holds one field of a MON-VER. It is asleep unless an answer is wanted.
//!
//! *Limits.* After a false header it takes the bytes that this claims before it looks for the next: an
//! answer among them is lost, and is asked for again.

use crate::fletcher::Fletcher;
use crate::identity::Identity;
use crate::kind::{HEADER_LEN, SYNC_1, SYNC_2};

/// Payload of a CFG-PRT, in bytes (u-blox M8 receiver description).
const PORT_LEN: usize = 20;
/// The longest field of a MON-VER, in bytes (the same): the software's version and each extension.
const FIELD_LEN: usize = 30;
/// The hardware's version, in bytes.
const HARDWARE_LEN: usize = 10;
/// The payload of a MON-VER without extensions, in bytes.
const VERSION_LEN: usize = FIELD_LEN + HARDWARE_LEN;
/// The most extensions that are waited for; known receivers have up to ten.
const EXTENSIONS: usize = 20;

/// The protocols of a port as CFG-PRT has them: the masks of what it receives and of what it sends.
pub(crate) type Protocols = [u8; 4];

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// MON-VER: [`Answers::identity`] has it.
    Version,
    /// CFG-PRT.
    Port(Protocols),
}

/// The reader; see the [module](self).
#[derive(Clone, Debug)]
pub(crate) struct Answers {
    is_wanted: bool,
    /// Bytes of the frame that are there.
    at: usize,
    /// Bytes of the frame, as its header says.
    length: usize,
    is_version: bool,
    sum: Fletcher,
    /// Which field of a MON-VER comes.
    nth: usize,
    field: [u8; FIELD_LEN],
    /// Bytes of the field that are there.
    held: usize,
    identity: Identity,
}

impl Answers {
    pub(crate) const fn new() -> Self {
        Self {
            is_wanted: false,
            at: 0,
            length: 0,
            is_version: false,
            sum: Fletcher::START,
            nth: 0,
            field: [0; FIELD_LEN],
            held: 0,
            identity: Identity::NONE,
        }
    }

    /// Whether bytes are of interest.
    #[inline]
    pub(crate) const fn is_wanted(&self) -> bool {
        self.is_wanted
    }

    /// What the last [`Answer::Version`] said.
    pub(crate) const fn identity(&self) -> &Identity {
        &self.identity
    }

    /// An answer may come from now on, or does not matter any more.
    pub(crate) const fn handle_wanted(&mut self, wanted: bool) {
        self.is_wanted = wanted;
        self.at = 0;
    }

    /// Takes a byte of the line; an answer, if it was its last.
    #[inline(never)]
    pub(crate) fn push(&mut self, byte: u8) -> Option<Answer> {
        let at = self.at;
        self.at = at.wrapping_add(1);
        let fits = match at {
            0 => byte == SYNC_1,
            1 => byte == SYNC_2,
            2 => {
                self.is_version = byte == 0x0a;
                self.sum = Fletcher::START;
                self.is_version || byte == 0x06
            }
            3 => byte == if self.is_version { 0x04 } else { 0x00 },
            4 => {
                self.length = byte.into();
                true
            }
            5 => self.begin_payload(byte),
            _ => {
                let end = self.length.wrapping_add(HEADER_LEN);
                if at < end {
                    self.take(byte);
                    true
                } else {
                    let [a, b] = self.sum.since(Fletcher::START, 0);
                    if at > end {
                        self.at = 0;
                        return (byte == b).then(|| self.answer());
                    }
                    byte == a
                }
            }
        };
        if !fits {
            self.at = usize::from(byte == SYNC_1);
        } else if at >= 2 && at < self.length.wrapping_add(HEADER_LEN) {
            self.sum = self.sum.then(byte.into());
        }
        None
    }

    /// The header is whole with the upper half of its length; whether it can be an answer's.
    fn begin_payload(&mut self, high: u8) -> bool {
        self.length = self.length.wrapping_add(usize::from(high) << 8);
        (self.nth, self.held) = (0, 0);
        self.identity = Identity::NONE;
        if self.is_version {
            let extensions = self.length.checked_sub(VERSION_LEN);
            extensions.is_some_and(|length| {
                length.is_multiple_of(FIELD_LEN) && length <= EXTENSIONS * FIELD_LEN
            })
        } else {
            self.length == PORT_LEN
        }
    }

    /// Takes a byte of the payload.
    fn take(&mut self, byte: u8) {
        if let Some(place) = self.field.get_mut(self.held) {
            *place = byte;
        }
        self.held = self.held.wrapping_add(1);
        let whole = if self.nth == 1 {
            HARDWARE_LEN
        } else {
            FIELD_LEN
        };
        if self.is_version && self.held >= whole {
            let field = self.field.get(..whole).unwrap_or_default();
            self.identity.handle_field(self.nth, field);
            (self.nth, self.held) = (self.nth.wrapping_add(1), 0);
        }
    }

    fn answer(&self) -> Answer {
        if self.is_version {
            return Answer::Version;
        }
        let masks = self.field.get(12..).and_then(<[u8]>::first_chunk);
        Answer::Port(masks.copied().unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use crate::frame_buffer::sum;

    fn frame(class: u8, id: u8, payload: &[u8]) -> Vec<u8> {
        let [low, high] = (payload.len() as u16).to_le_bytes();
        let mut frame = std::vec![SYNC_1, SYNC_2, class, id, low, high];
        frame.extend(payload);
        frame.extend([0, 0]);
        sum(&mut frame);
        frame
    }

    fn version(extensions: &[&str]) -> Vec<u8> {
        let mut payload = Vec::new();
        for (text, length) in [("EXT CORE 1.00", FIELD_LEN), ("00190000", HARDWARE_LEN)]
            .into_iter()
            .chain(extensions.iter().map(|text| (*text, FIELD_LEN)))
        {
            let end = payload.len() + length;
            payload.extend(text.bytes());
            payload.resize(end, 0);
        }
        frame(0x0a, 0x04, &payload)
    }

    fn read(bytes: &[u8]) -> (Vec<Answer>, Identity) {
        let mut answers = Answers::new();
        answers.handle_wanted(true);
        let found = bytes.iter().filter_map(|byte| answers.push(*byte));
        (found.collect(), *answers.identity())
    }

    #[test]
    fn answers_are_found_among_noise() {
        let mut port = [0; PORT_LEN];
        port[12..16].copy_from_slice(&[7, 0, 3, 0]);
        let mut line = b"$GNRMC,,V*00\r\n\xb5\xb5\x62\x0a\x05".to_vec();
        line.extend(frame(0x06, 0x00, &port));
        line.push(SYNC_1);
        line.extend(version(&["PROTVER=27.31", "MOD=ZED-F9P"]));
        let (answers, identity) = read(&line);
        assert_eq!(answers, [Answer::Port([7, 0, 3, 0]), Answer::Version]);
        assert_eq!((identity.model(), identity.protocol()), ("ZED-F9P", 2_731));
    }

    #[test]
    fn what_is_damaged_or_of_another_length_is_none() {
        let whole = version(&["PROTVER=18.00"]);
        assert_eq!(read(&whole).0.len(), 1);
        for nth in 2..whole.len() {
            let mut damaged = whole.clone();
            damaged[nth] ^= 0x10;
            assert_eq!(read(&damaged).0, [], "{nth}");
        }
        assert_eq!(read(&frame(0x0a, 0x04, &[0; VERSION_LEN + 1])).0, []);
        assert_eq!(read(&frame(0x06, 0x00, &[0; PORT_LEN - 1])).0, []);
        assert_eq!(read(&frame(0x0a, 0x04, &[0; 5_000])).0, []);
    }
}
