//! What a UART makes of bytes that were sent at another speed.
//!
//! *Purpose.* The garbage, with its framing errors, that a firmware sees while it
//! looks for the receiver's speed.
//!
//! *Design.* The sender's line is a function of time, high or low. The board's
//! receiver waits for a falling edge, looks again half a bit later, then takes
//! eight bits and the stop bit in the middle of each; a low stop bit is a framing
//! error, and a new start needs a high line first (RM0090 30.3.3, with one sample
//! a bit in place of its three of sixteen).
//!
//! *Limits.* 8N1. A word's start is reported late where the word before it, which the
//! emulator gives ten whole bits of the board's, would still be on its way.

use world::{Transmission, WorldNanos};

const BITS_PER_BYTE: u64 = 10;
const NANOS: u64 = 1_000_000_000;

/// A word as the board's receiver takes it in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Word {
    /// When its start bit begins.
    pub(crate) start: WorldNanos,
    /// Its bits.
    pub(crate) byte: u8,
    /// Its stop bit was low.
    pub(crate) framing: bool,
}

/// What a receiver at `baud` makes of `sent`. Nothing, at a speed of 0.
pub(crate) fn words(sent: &Transmission, baud: u32) -> Vec<Word> {
    if baud == sent.baud {
        return as_sent(sent);
    }
    if baud == 0 || sent.baud == 0 {
        return Vec::new();
    }
    let bits = bit_stream(sent);
    let high = |at_ns: u64| {
        let bit = at_ns * u64::from(sent.baud) / NANOS;
        usize::try_from(bit)
            .ok()
            .and_then(|bit| bits.get(bit))
            .is_none_or(|&high| high)
    };
    // The middle of the receiver's bit `n`, counted from the start bit.
    let middle = |n: u64| (2 * n + 1) * NANOS / (2 * u64::from(baud));
    let word_ns = BITS_PER_BYTE * NANOS / u64::from(baud);

    let mut words = Vec::new();
    let mut from_ns = 0;
    let mut free_ns = 0;
    while let Some(start_ns) = falling_edge(&bits, sent.baud, from_ns) {
        if high(start_ns + middle(0)) {
            from_ns = start_ns + middle(0);
            continue;
        }
        let byte = (0..8).fold(0, |byte, bit| {
            byte | u8::from(high(start_ns + middle(bit + 1))) << bit
        });
        let reported_ns = start_ns.max(free_ns);
        words.push(Word {
            start: sent.start.plus(reported_ns),
            byte,
            framing: !high(start_ns + middle(9)),
        });
        from_ns = start_ns + middle(9);
        free_ns = reported_ns + word_ns;
    }
    words
}

/// Each byte as it was sent, at its own moment.
fn as_sent(sent: &Transmission) -> Vec<Word> {
    let start_of = |index: usize| match index.checked_sub(1) {
        Some(before) => sent.byte_end(before),
        None => sent.start,
    };
    let bytes = sent.bytes.iter().enumerate();
    bytes
        .map(|(index, &byte)| Word {
            start: start_of(index),
            byte,
            framing: false,
        })
        .collect()
}

/// The sender's bits in their order: start, eight of data from the lowest, stop.
fn bit_stream(sent: &Transmission) -> Vec<bool> {
    let frame = |&byte: &u8| {
        let data = (0..8).map(move |bit| byte >> bit & 1 == 1);
        std::iter::once(false).chain(data).chain([true])
    };
    sent.bytes.iter().flat_map(frame).collect()
}

/// The first change from high to low at or after `from_ns`; the line was high
/// before its first bit.
fn falling_edge(bits: &[bool], baud: u32, from_ns: u64) -> Option<u64> {
    let first = usize::try_from((from_ns * u64::from(baud)).div_ceil(NANOS)).ok()?;
    let edge = (first..bits.len()).find(|&bit| !bits[bit] && (bit == 0 || bits[bit - 1]))?;
    Some((edge as u64 * NANOS).div_ceil(u64::from(baud)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(bytes: &[u8], baud: u32) -> Transmission {
        Transmission {
            start: WorldNanos(1_000),
            bytes: bytes.to_vec(),
            baud,
        }
    }

    #[test]
    fn at_the_same_speed_every_byte_arrives_at_its_moment() {
        let words = words(&sent(&[0xB5, 0x62], 115_200), 115_200);
        assert_eq!(words.len(), 2);
        assert_eq!((words[0].byte, words[1].byte), (0xB5, 0x62));
        assert_eq!(words[0].start, WorldNanos(1_000));
        assert_eq!(words[1].start, WorldNanos(1_000 + 86_805));
        assert!(words.iter().all(|word| !word.framing));
    }

    #[test]
    fn sampling_finds_the_same_bytes_when_the_speeds_are_nearly_equal() {
        let bytes: Vec<u8> = (0..=255).collect();
        for baud in [113_000, 117_400] {
            let words = words(&sent(&bytes, 115_200), baud);
            let received: Vec<u8> = words.iter().map(|word| word.byte).collect();
            assert_eq!(received, bytes, "{baud}");
            assert!(words.iter().all(|word| !word.framing), "{baud}");
        }
    }

    #[test]
    fn a_slow_sender_is_received_as_breaks() {
        // At 9600 a start bit is twelve bits of 115200 long: all low.
        let words = words(&sent(&[0xff], 9_600), 115_200);
        assert_eq!(words.len(), 1);
        assert_eq!((words[0].byte, words[0].framing), (0, true));
    }

    #[test]
    fn a_fast_sender_is_received_as_fewer_words() {
        let bytes = [0x55; 120];
        let words = words(&sent(&bytes, 115_200), 9_600);
        assert!((8..=12).contains(&words.len()), "{}", words.len());
    }

    #[test]
    fn a_board_without_a_speed_receives_nothing() {
        assert!(words(&sent(&[1, 2, 3], 9_600), 0).is_empty());
    }

    #[test]
    fn words_never_overlap() {
        let bytes: Vec<u8> = (0..200_u8).map(|n| n.wrapping_mul(73)).collect();
        for (from, to) in [(9_600, 115_200), (38_400, 57_600), (230_400, 115_200)] {
            let words = words(&sent(&bytes, from), to);
            let word_ns = 10 * NANOS / u64::from(to);
            let apart = words
                .windows(2)
                .all(|pair| pair[1].start.0 - pair[0].start.0 >= word_ns);
            assert!(apart && !words.is_empty(), "{from} to {to}");
        }
    }
}
