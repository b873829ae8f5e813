//! The status over MAVLink is that of the log.

use crate::common::{BAUD, MS, SECOND, image, messages, receiver_settings};
use console::Status;
use mavlink_node::client::{Client, GROUND_STATION, Message};
use mavlink_node::{Address, Version};
use virtual_pixhawk::{Builder, Connector, Pixhawk, Script};
use world::{Receiver, Transmission, WorldNanos};

const BOARD: Address = Address {
    system: 1,
    component: 1,
};

/// What the board has sent of its status: the text, and how long that took, in ns.
fn status(board: &mut Pixhawk) -> (String, u64) {
    let received = board.take_received(Connector::Telem1).unwrap();
    let pieces = messages(&received)
        .into_iter()
        .filter_map(|(at, what)| match what {
            Message::LogData {
                id: Client::STATUS,
                data,
                count,
                ..
            } => Some((at, data[..usize::from(count)].to_vec())),
            _ => None,
        });
    let pieces: Vec<_> = pieces.collect();
    let took = pieces.last().unwrap().0.0 - pieces[0].0.0;
    let text = pieces.into_iter().flat_map(|(_, piece)| piece).collect();
    (String::from_utf8(text).unwrap(), took)
}

#[test]
fn every_word_of_the_logs_status_line_comes_over_the_line() {
    let Some(firmware) = image() else { return };
    let mut client = Client::new(GROUND_STATION, Version::V2);
    // In the middle between two lines of the log, so that counters stand still meanwhile.
    let asked = WorldNanos(20 * SECOND + 300 * MS);
    let ask = Transmission {
        start: asked,
        bytes: client.status(BOARD).to_vec(),
        baud: BAUD,
    };
    let noise = Transmission {
        start: WorldNanos(3 * SECOND),
        bytes: vec![0x55; 40],
        baud: BAUD,
    };
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new([noise, ask]))
        .power_on()
        .unwrap();
    board.run_to(asked).unwrap();
    let log = board.take_log().unwrap();
    let before = log
        .iter()
        .rev()
        .find_map(|logged| Status::parse(&logged.line.text))
        .unwrap();
    board.take_received(Connector::Telem1).unwrap();
    board.run_to(WorldNanos(20 * SECOND + 900 * MS)).unwrap();
    let (text, took_ns) = status(&mut board);
    println!("{} bytes in {} ms: {text}", text.len(), took_ns / MS);
    let over_the_line = Status::parse(&text).unwrap();
    for (key, value) in before.pairs() {
        let found = over_the_line.get(key);
        let found = found.unwrap_or_else(|| panic!("{key} is missing: {text}"));
        // What has gone on by part of a second.
        let goes_on = ["utc", "unc_ns", "ppb", "marks"].contains(&key);
        assert!(goes_on || found == value, "{key}: {found} and not {value}");
    }
    let number = |status: &Status, key: &str| status.number(key).unwrap();
    let marks = number(&over_the_line, "marks") - number(&before, "marks");
    assert!((0..=5).contains(&marks), "{marks}");
    assert!(number(&over_the_line, "mav_foreign_bytes") >= 40, "{text}");
    assert!(
        over_the_line
            .get("utc")
            .unwrap()
            .starts_with("2026-11-22T04:00:")
    );
    assert_eq!(over_the_line.get("fault"), None);
    assert!(took_ns < 300 * MS, "{took_ns}");
}
