//! The board's USB, with a host that enumerates it as Linux does.

use std::collections::BTreeMap;

use mavlink_node::client::{Client, Message};
use mavlink_node::{Address, Test, Version};
use sample_log::csv;
use virtual_pixhawk::{Builder, Card, ControlTransfer, Firmware, Gaps, Host, Pixhawk, Script};
use world::{Receiver, Transmission, WorldNanos};

use crate::common::{BAUD, MS, SECOND, image, messages, ping_answers, pings, receiver_settings};

/// When the host has set the port up.
const OPEN_AT: WorldNanos = WorldNanos(SECOND);

/// The board, and who asks it.
const BOARD: Address = Address {
    system: 1,
    component: 1,
};
const GROUND: Address = Address {
    system: 255,
    component: 190,
};
/// Samples that the board has room for.
const CAPACITY: u64 = 8_192;

/// A board with a host whose program sends `requests`.
fn board(firmware: &Firmware, requests: impl IntoIterator<Item = Transmission>) -> Pixhawk {
    Builder::new(firmware.clone())
        .gps(Receiver::new(receiver_settings()))
        .usb(Host::new(Script::new(requests)))
        .power_on()
        .unwrap()
}

/// What a descriptor of a string says.
fn text(descriptor: &[u8]) -> String {
    assert_eq!(usize::from(descriptor[0]), descriptor.len());
    assert_eq!(descriptor[1], 3);
    let units = descriptor[2..].chunks(2);
    let units: Vec<u16> = units
        .map(|two| u16::from_le_bytes([two[0], two[1]]))
        .collect();
    String::from_utf16(&units).unwrap()
}

#[test]
fn a_host_finds_the_device_its_strings_and_a_port_that_can_be_set() {
    let Some(firmware) = image() else { return };
    let mut board = board(&firmware, []);
    board.run_to(OPEN_AT).unwrap();
    let is_configured = board.with_usb(|host| host.is_configured()).unwrap();
    let transfers = board.with_usb(Host::take_transfers).unwrap();
    assert!(is_configured, "{transfers:?}");
    let of = |setup: [u8; 4]| -> &ControlTransfer {
        let found = transfers
            .iter()
            .rfind(|transfer| transfer.setup[..4] == setup);
        found.unwrap_or_else(|| panic!("{setup:?} in {transfers:?}"))
    };
    let read = |setup| of(setup).data.clone().unwrap();
    let device = read([0x80, 6, 0, 1]);
    assert_eq!(device.len(), 18);
    // pid.codes' test id; 64 bytes on endpoint 0.
    assert_eq!(device[8..12], [0x09, 0x12, 0x01, 0x00]);
    assert_eq!(device[7], 64);
    let configuration = read([0x80, 6, 0, 2]);
    assert_eq!(
        usize::from(u16::from_le_bytes([configuration[2], configuration[3]])),
        configuration.len()
    );
    // Self-powered.
    assert_eq!(configuration[7] & 0x40, 0x40);
    assert_eq!(text(&read([0x80, 6, 1, 3])), "pixclock");
    assert_eq!(text(&read([0x80, 6, 2, 3])), "pixclock on a Pixhawk 1");
    let serial = text(&read([0x80, 6, 3, 3]));
    assert_eq!(serial.len(), 24);
    assert!(
        serial.chars().all(|digit| digit.is_ascii_hexdigit()),
        "{serial}"
    );
    assert_eq!(read([0xA1, 0x21, 0, 0]), [0x00, 0xC2, 0x01, 0x00, 0, 0, 8]);
    // DTR was taken.
    assert!(of([0x21, 0x22, 3, 0]).data.is_some());
    assert_eq!(board.gaps().unwrap(), Gaps::default());
}

#[test]
fn of_100_pings_a_second_each_has_its_answer() {
    let Some(firmware) = image() else { return };
    let at = (0..1_000).map(|n| OPEN_AT.plus(n * 10 * MS));
    let mut board = board(&firmware, pings(Version::V2, at));
    board.run_to(OPEN_AT.plus(10 * SECOND + 100 * MS)).unwrap();
    let received = board.with_usb(Host::take_received).unwrap();
    let answered: Vec<u32> = ping_answers(&received)
        .iter()
        .map(|&(seq, _)| seq)
        .collect();
    assert_eq!(answered, (0..1_000).collect::<Vec<_>>());
}

#[test]
fn the_whole_log_comes_three_times_and_is_the_cards_file() {
    let Some(firmware) = image() else { return };
    // The clock is set before the first of them.
    let first = 3 * SECOND;
    let at = (0..CAPACITY).map(|n| WorldNanos(first + n * MS));
    let mut requests = pings(Version::V2, at);
    let mut client = Client::new(GROUND, Version::V2);
    let end = first + CAPACITY * MS + 100 * MS;
    let mut ask = |at, bytes: mavlink_node::Frame| {
        requests.push(Transmission {
            start: WorldNanos(at),
            bytes: bytes.to_vec(),
            baud: BAUD,
        });
    };
    ask(end, client.test(BOARD, Test::Ends));
    // The card has the file 3 s later at the latest.
    let asked = [3, 9, 15].map(|later| end + later * SECOND);
    for at in asked {
        ask(at, client.log_data(BOARD, 0, u32::MAX));
    }
    let card = Card::holding(&fat_image::formatted(fat_image::Kind::Fat16));
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(receiver_settings()))
        .usb(Host::new(Script::new(requests)))
        .card(card)
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(asked[0])).unwrap();
    let received = board.with_usb(Host::take_received).unwrap();
    assert_eq!(ping_answers(&received).len(), CAPACITY as usize);
    let card = board.swap_card(None).unwrap().expect("it is in the slot");
    let file = fat_image::files(&card.image()).remove("TEST0001.CSV");
    let file = file.expect("the file is there").contents;
    assert_eq!(file.len(), (CAPACITY as usize + 1) * csv::LINE);
    for at in asked {
        board.run_to(WorldNanos(at + 5_900 * MS)).unwrap();
        let received = board.with_usb(Host::take_received).unwrap();
        let messages = messages(&received);
        let last = messages
            .iter()
            .rfind(|(_, what)| matches!(what, Message::LogData { .. }));
        let (last, _) = last.expect("the log");
        let pieces: BTreeMap<u32, Vec<u8>> = messages
            .iter()
            .filter_map(|(_, what)| match what {
                Message::LogData {
                    offset,
                    data,
                    count,
                    ..
                } => Some((*offset, data[..usize::from(*count)].to_vec())),
                _ => None,
            })
            .collect();
        println!("{} bytes in {} ms", file.len(), (last.0 - at) / MS);
        let whole: Vec<u8> = pieces.into_values().flatten().collect();
        assert!(whole == file, "{} bytes of {}", whole.len(), file.len());
    }
}

#[test]
fn a_closed_port_is_sent_nothing_and_an_opened_one_is() {
    let Some(firmware) = image() else { return };
    let mut board = board(&firmware, []);
    board.run_to(OPEN_AT).unwrap();
    board.with_usb(|host| host.open(false)).unwrap();
    board.run_for(100 * MS).unwrap();
    board.with_usb(Host::take_received).unwrap();
    board.run_for(5 * SECOND).unwrap();
    board.with_usb(|host| host.open(true)).unwrap();
    board.run_for(1_200 * MS).unwrap();
    let received = board.with_usb(Host::take_received).unwrap();
    // Not those of the five seconds before.
    let heartbeats = messages(&received)
        .iter()
        .filter(|(_, what)| *what == Message::Heartbeat)
        .count();
    assert!((1..=2).contains(&heartbeats), "{heartbeats}");
}
