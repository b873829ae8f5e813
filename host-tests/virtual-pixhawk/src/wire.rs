//! The far end of one of the board's serial lines.
//!
//! *Purpose.* [`Wire`] brings a [`Talker`], which lives in true time, to a serial
//! port of the emulator, which asks for a word whenever its receiver is free.
//!
//! *Design.* What the talker sends waits as words with the moment of their start
//! bit. The emulator asks only at its stops, so the run's driver calls
//! [`Wire::prepare`] at each of them and stops at [`Wire::next_stop`]. Where the two
//! ends disagree about the speed, [`waveform`](crate::waveform) makes what the
//! board's receiver would make of it. Framing errors are a setting of the port that
//! holds for the word that ends next; so a word whose flag differs from the setting
//! is held back until `prepare` has found what the setting has to be.
//!
//! *Limits.* The port takes ten of *its own* bit times for a word, where a real one
//! finds each start bit anew: in a burst without gaps the words of a talker that is
//! 0.114 % faster (115200 against 115068 Bd) come 0.1 µs later each. The first of a
//! burst is exact. A word with a framing error arrives with other bits flipped, too.
//! A change of the board's speed in the middle of a burst garbles from the next
//! burst on.

use std::collections::VecDeque;
use std::fmt;

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;
use world::{Sent, Talker, WorldNanos};

use crate::waveform::{self, Word};

/// How far two UARTs may be apart and still understand each other, in 1/1000:
/// half a bit in the tenth bit, with some room.
const TOLERANCE_PER_MILLE: u32 = 25;
/// The speeds that serial ports are set to; a board's own, which its divider makes
/// a little wrong, is taken for the one that is meant.
const STANDARD_BAUDS: [u32; 9] = [
    4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600,
];

/// A byte that the board sent, and when its stop bit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceivedByte {
    /// When the last bit had arrived.
    pub at: WorldNanos,
    /// The byte.
    pub byte: u8,
}

/// How the board has set up its port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PortSetting {
    /// Bits a second, as its divider makes them.
    pub(crate) baud: u32,
    /// Its receiver is on.
    pub(crate) listening: bool,
}

/// The far end of a line, as the emulator's port has it.
pub(crate) struct Wire {
    talker: Box<dyn Talker + Send>,
    port: PortSetting,
    waiting: VecDeque<Word>,
    /// What the port's framing errors are set to.
    framing: bool,
    /// The port asked for a word that was due and held back.
    held_back: bool,
    received: Vec<ReceivedByte>,
}

impl fmt::Debug for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Wire")
            .field("port", &self.port)
            .field("waiting", &self.waiting.len())
            .finish_non_exhaustive()
    }
}

/// What the run's driver has to do after [`Wire::prepare`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Prepared {
    /// What the port's framing errors have to be.
    pub(crate) framing: bool,
    /// There is a word for the port at this very stop, so it has to be asked again.
    pub(crate) ask_now: bool,
}

impl Wire {
    pub(crate) fn new(talker: Box<dyn Talker + Send>) -> Self {
        Self {
            talker,
            port: PortSetting {
                baud: 0,
                listening: false,
            },
            waiting: VecDeque::new(),
            framing: false,
            held_back: false,
            received: Vec::new(),
        }
    }

    /// Brings the far end to `now`, with the board's port as it is.
    pub(crate) fn prepare(&mut self, now: WorldNanos, port: PortSetting) -> Prepared {
        let was_off = !std::mem::replace(&mut self.port, port).listening;
        let mut ask_now = false;
        while let Some(due) = self.talker.next_event().filter(|&due| due <= now) {
            while let Some(transmission) = self.talker.poll(now) {
                let listens_at = self.understands(transmission.baud);
                self.waiting
                    .extend(waveform::words(&transmission, listens_at));
                ask_now = true;
            }
            if self.talker.next_event() == Some(due) {
                break;
            }
        }
        // Each start of a word is a stop, so those from before this one are lost.
        if was_off || !port.listening {
            let arrives_now = |word: &Word| word.start == now && port.listening;
            let missed = |word: &mut Word| word.start <= now && !arrives_now(word);
            while self.waiting.pop_front_if(missed).is_some() {}
        }
        if std::mem::take(&mut self.held_back) {
            self.framing = self.waiting.front().is_some_and(|word| word.framing);
            ask_now = true;
        }
        Prepared {
            framing: self.framing,
            ask_now: ask_now && port.listening,
        }
    }

    /// At which speed the board samples what is sent at `baud`.
    fn understands(&self, baud: u32) -> u32 {
        if self.port.baud.abs_diff(baud) <= baud / 1_000 * TOLERANCE_PER_MILLE {
            baud
        } else {
            self.port.baud
        }
    }

    /// The speed that the board's divider stands for.
    fn meant_baud(&self) -> u32 {
        STANDARD_BAUDS
            .into_iter()
            .find(|&standard| self.understands(standard) == standard)
            .unwrap_or(self.port.baud)
    }

    /// The first moment after `now` at which the far end has something to do.
    pub(crate) fn next_stop(&self, now: WorldNanos) -> Option<WorldNanos> {
        let word = self.waiting.front().map(|word| word.start);
        [word, self.talker.next_event()]
            .into_iter()
            .flatten()
            .filter(|&at| at > now)
            .min()
    }

    /// Every byte that the board has sent, and takes them out.
    pub(crate) fn take_received(&mut self) -> Vec<ReceivedByte> {
        std::mem::take(&mut self.received)
    }

    /// Every NAV-PVT that has left, as the talker knows it.
    pub(crate) fn truth(&self) -> Vec<Sent> {
        self.talker.truth().to_vec()
    }
}

impl Store for Wire {}

impl Peer for Wire {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        let at = WorldNanos(context.now().0);
        let [byte, _] = word.to_le_bytes();
        self.received.push(ReceivedByte { at, byte });
        self.talker.handle_bytes(at, self.meant_baud(), &[byte]);
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        let front = self.waiting.front()?;
        if front.start.0 > now.0 {
            return None;
        }
        if front.framing != self.framing {
            self.held_back = true;
            return None;
        }
        self.waiting.pop_front().map(|word| u16::from(word.byte))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::Script;
    use world::Transmission;

    const LISTENING: PortSetting = PortSetting {
        baud: 115_068,
        listening: true,
    };

    fn wire(start: u64, bytes: &[u8], baud: u32) -> Wire {
        Wire::new(Box::new(Script::new([Transmission {
            start: WorldNanos(start),
            bytes: bytes.to_vec(),
            baud,
        }])))
    }

    #[test]
    fn a_word_is_there_from_its_start_bit_on_and_not_before() {
        let mut wire = wire(1_000, b"ab", 115_200);
        assert_eq!(wire.next_stop(WorldNanos(0)), Some(WorldNanos(1_000)));
        assert!(!wire.prepare(WorldNanos(999), LISTENING).ask_now);
        assert_eq!(wire.transmit(VirtualNanos(999)), None);
        assert!(wire.prepare(WorldNanos(1_000), LISTENING).ask_now);
        assert_eq!(wire.transmit(VirtualNanos(1_000)), Some(u16::from(b'a')));
        assert_eq!(wire.transmit(VirtualNanos(1_000)), None);
        assert_eq!(wire.next_stop(WorldNanos(1_000)), Some(WorldNanos(87_805)));
        assert_eq!(wire.transmit(VirtualNanos(87_904)), Some(u16::from(b'b')));
    }

    #[test]
    fn what_was_sent_while_the_port_was_off_is_lost() {
        let mut wire = wire(1_000, b"ab", 115_200);
        let deaf = PortSetting {
            listening: false,
            ..LISTENING
        };
        assert!(!wire.prepare(WorldNanos(1_000), deaf).ask_now);
        wire.prepare(WorldNanos(50_000), deaf);
        wire.prepare(WorldNanos(90_000), LISTENING);
        assert_eq!(wire.transmit(VirtualNanos(90_000)), None);
    }

    #[test]
    fn a_word_with_a_framing_error_waits_for_the_port_to_be_set_to_it() {
        let mut wire = wire(0, &[0xff], 9_600);
        assert!(!wire.prepare(WorldNanos(0), LISTENING).framing);
        assert_eq!(wire.transmit(VirtualNanos(0)), None);
        let prepared = wire.prepare(WorldNanos(0), LISTENING);
        assert!(prepared.framing && prepared.ask_now);
        assert_eq!(wire.transmit(VirtualNanos(0)), Some(0));
    }

    #[test]
    fn the_speed_that_a_divider_nearly_makes_is_the_one_that_is_meant() {
        let mut wire = wire(0, &[], 115_200);
        for (baud, meant) in [(115_068, 115_200), (112_000, 112_000), (9_600, 9_600)] {
            wire.port = PortSetting {
                baud,
                listening: true,
            };
            assert_eq!(wire.meant_baud(), meant);
        }
    }
}
