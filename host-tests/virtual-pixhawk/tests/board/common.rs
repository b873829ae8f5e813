//! What the tests of the image have in common.

use mavlink_node::client::{Client, Message};
use mavlink_node::{Address, Version};
use timebase::{Stamp, StampedByte};
use virtual_pixhawk::{Connector, Firmware, IMAGE_VARIABLE, Pixhawk, ReceivedByte};
use world::{ReceiverSettings, Transmission, WorldNanos};

pub(crate) const MS: u64 = 1_000_000;
pub(crate) const SECOND: u64 = 1_000 * MS;
/// 2026-11-22T04:00:00Z.
pub(crate) const START_UTC_NS: i64 = 1_795_320_000 * 1_000_000_000;
/// The speed of both of the board's lines.
pub(crate) const BAUD: u32 = 115_200;
/// One byte at that speed, in ns.
pub(crate) const BYTE_NS: u64 = 10 * SECOND / BAUD as u64;

/// The image that `cargo xtask board-test` hands over; `None` if a test has to be
/// skipped, which has been printed.
pub(crate) fn image() -> Option<Firmware> {
    Firmware::from_variable(IMAGE_VARIABLE).expect("the image can be read")
}

/// A receiver that comes out of its box at [`START_UTC_NS`].
pub(crate) fn receiver_settings() -> ReceiverSettings {
    ReceiverSettings::new(START_UTC_NS)
}

/// PINGs at the given moments, numbered from 0.
pub(crate) fn pings(
    version: Version,
    at: impl IntoIterator<Item = WorldNanos>,
) -> Vec<Transmission> {
    let address = Address {
        system: 255,
        component: 190,
    };
    let mut client = Client::new(address, version);
    (0..)
        .zip(at)
        .map(|(seq, start)| Transmission {
            start,
            bytes: client.ping(u64::from(seq) + 1_000, seq).to_vec(),
            baud: BAUD,
        })
        .collect()
}

/// The messages in `received`, each with the moment at which its last byte came.
pub(crate) fn messages(received: &[ReceivedByte]) -> Vec<(WorldNanos, Message)> {
    let address = Address {
        system: 255,
        component: 190,
    };
    let mut client = Client::new(address, Version::V2);
    received
        .iter()
        .filter_map(|received| {
            let stamped = StampedByte {
                stamp: Stamp((received.at.0 / 6) as u32),
                byte: received.byte,
            };
            Some((received.at, client.push(stamped)?.message))
        })
        .collect()
}

/// The PING answers among them, as `(seq, time_usec)`.
pub(crate) fn ping_answers(received: &[ReceivedByte]) -> Vec<(u32, u64)> {
    messages(received)
        .into_iter()
        .filter_map(|(_, what)| match what {
            Message::Ping { time_usec, seq, .. } => Some((seq, time_usec)),
            _ => None,
        })
        .collect()
}

/// Bytes that are written as hexadecimal digits.
pub(crate) fn from_hex(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> = hex.chars().map(|c| c.to_digit(16).unwrap() as u8).collect();
    digits.chunks(2).map(|two| two[0] << 4 | two[1]).collect()
}

/// The last status line of the log.
pub(crate) fn last_status(board: &mut Pixhawk) -> String {
    let log = board.take_log().unwrap();
    let last = log
        .into_iter()
        .rfind(|logged| logged.line.text.starts_with("status "));
    last.unwrap().line.text
}

/// By this status line no tick, no byte of either line, no mark and no line of the log was lost.
#[track_caller]
pub(crate) fn assert_nothing_lost(status: &str, what: &str) {
    assert!(status.contains(" lost_ticks=0"), "{what}");
    for key in [
        "mav_overrun",
        "gps_overrun",
        "gps_truncated",
        "mav_incoming_full",
        "gps_incoming_full",
        "mav_outgoing_full",
        "log_dropped",
    ] {
        assert!(!status.contains(&format!(" {key}=")), "{key}: {what}");
    }
}

/// PINGs with these numbers, and no others, were answered on TELEM1, each once and in turn.
#[track_caller]
pub(crate) fn assert_all_answered(board: &mut Pixhawk, asked: &[u32], what: &str) {
    let answers = ping_answers(&board.take_received(Connector::Telem1).unwrap());
    let answered: Vec<u32> = answers.iter().map(|&(seq, _)| seq).collect();
    assert_eq!(answered.len(), asked.len(), "{what}");
    assert_eq!(answered, asked, "{what}");
}
