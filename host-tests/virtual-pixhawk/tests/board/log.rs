//! The log of a test over MAVLink: it has every time that was answered to a PING, and the line
//! carries PINGs and log up to its rate.

use std::collections::BTreeMap;

use crate::common::{
    BAUD, BYTE_NS, MS, SECOND, image, messages, ping_answers, pings, receiver_settings,
};
use console::Status;
use mavlink_node::client::{Client, Message};
use mavlink_node::{Address, Frame, Parameter, Test, Version};
use sample_log::csv;
use virtual_pixhawk::{Builder, Connector, Firmware, Pixhawk, ReceivedByte, Script};
use world::{Receiver, Transmission, WorldNanos};

/// The board, and who asks it.
const BOARD: Address = Address {
    system: 1,
    component: 1,
};
const GROUND: Address = Address {
    system: 255,
    component: 190,
};
/// Samples that the board has room for: 64 KB twice, of 16 bytes each.
const CAPACITY: usize = 8_192;

/// What is asked, at which moment.
fn requests(
    version: Version,
    asked: impl IntoIterator<Item = (u64, fn(&mut Client) -> Frame)>,
) -> Vec<Transmission> {
    let mut client = Client::new(GROUND, version);
    let asked = asked.into_iter();
    asked
        .map(|(at_ns, ask)| Transmission {
            start: WorldNanos(at_ns),
            bytes: ask(&mut client).to_vec(),
            baud: BAUD,
        })
        .collect()
}

fn whole_log(client: &mut Client) -> Frame {
    client.log_data(BOARD, 0, u32::MAX)
}

/// `count` PINGs, the first one at `from_ns`, `apart_ns` apart.
fn some_pings(from_ns: u64, count: u64, apart_ns: u64) -> Vec<Transmission> {
    let at = (0..count).map(|n| WorldNanos(from_ns + n * apart_ns));
    pings(Version::V2, at)
}

/// A board with a receiver that is sent these requests.
fn board(firmware: Firmware, requests: Vec<Transmission>) -> Pixhawk {
    Builder::new(firmware)
        .crystal_ppb(-8_000)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new(requests))
        .power_on()
        .unwrap()
}

/// What the board has sent since the last call, and its last status line.
fn received(board: &mut Pixhawk) -> (Vec<ReceivedByte>, Status) {
    let log = board.take_log().unwrap();
    let mut statuses = log.iter().filter_map(|l| Status::parse(&l.line.text));
    let status = statuses.next_back().expect("a status each second");
    (board.take_received(Connector::Telem1).unwrap(), status)
}

/// The pieces of the log among what was received, by where they begin.
fn pieces(received: &[ReceivedByte]) -> BTreeMap<u32, Vec<u8>> {
    let what = messages(received).into_iter().map(|(_, what)| what);
    what.filter_map(|what| match what {
        Message::LogData {
            offset,
            data,
            count,
            ..
        } => Some((offset, data[..usize::from(count)].to_vec())),
        _ => None,
    })
    .collect()
}

/// The file that the pieces make, without a gap.
fn file(pieces: BTreeMap<u32, Vec<u8>>) -> Vec<u8> {
    let mut file = Vec::new();
    for (offset, bytes) in pieces {
        assert_eq!(offset as usize, file.len());
        file.extend(bytes);
    }
    file
}

/// The lines of a log's file as (sequence, PING's time in µs, board's time in ns, state).
fn lines(file: &[u8]) -> Vec<(u32, u64, u64, String)> {
    assert_eq!(file.len() % csv::LINE, 0);
    assert!(file.starts_with(csv::HEADER));
    let lines = file.chunks(csv::LINE).skip(1);
    lines
        .map(|line| {
            let text = std::str::from_utf8(line).unwrap().strip_suffix("\r\n");
            let columns: Vec<&str> = text.unwrap().split(',').collect();
            assert_eq!(columns.len(), 5);
            (
                columns[0].parse().unwrap(),
                columns[1].parse().unwrap(),
                columns[2].parse().unwrap(),
                columns[3].to_owned(),
            )
        })
        .collect()
}

/// Asserts that a file has a line for each PING that was answered, with the time that was answered.
fn assert_has_the_answers(file: &[u8], answers: &[(u32, u64)]) {
    let lines = lines(file);
    assert_eq!(lines.len(), answers.len());
    for ((sequence, ping_us, board_ns, state), &(seq, time_usec)) in lines.iter().zip(answers) {
        assert_eq!(*sequence, seq);
        assert_eq!(*ping_us, u64::from(seq) + 1_000, "the PING's own time");
        assert_eq!(board_ns / 1_000, time_usec, "PING {seq}");
        // Before the clock is set, time is since boot.
        assert_eq!(state == "unset", time_usec < 1_000_000_000_000);
    }
}

/// The last value of a parameter that was sent.
fn parameter(received: &[ReceivedByte], wanted: Parameter) -> Option<f32> {
    let what = messages(received).into_iter().map(|(_, what)| what);
    what.rev().find_map(|what| match what {
        Message::Parameter { name, value, .. } if Parameter::named(name) == Some(wanted) => {
            Some(value)
        }
        _ => None,
    })
}

/// The texts that were sent.
fn texts(received: &[ReceivedByte]) -> Vec<String> {
    let what = messages(received).into_iter().map(|(_, what)| what);
    what.filter_map(|what| match what {
        Message::StatusText { text, .. } => Some(text.as_str().to_owned()),
        _ => None,
    })
    .collect()
}

/// The results of commands that were sent.
fn results(received: &[ReceivedByte]) -> Vec<u8> {
    let what = messages(received).into_iter().map(|(_, what)| what);
    what.filter_map(|what| match what {
        Message::CommandAck { command, result } => {
            assert_eq!(command, 31_010);
            Some(result)
        }
        _ => None,
    })
    .collect()
}

#[test]
fn the_log_over_the_line_has_every_answer() {
    let Some(firmware) = image() else { return };
    for version in [Version::V1, Version::V2] {
        // Before the clock is set and after, until 4 s.
        let mut telem1 = some_pings(500 * MS, 350, 10 * MS);
        telem1.extend(requests(
            version,
            [
                (
                    4_200 * MS,
                    (|c| c.test(BOARD, Test::Ends)) as fn(&mut Client) -> Frame,
                ),
                (4_250 * MS, |c| c.logs(BOARD)),
                (4_300 * MS, whole_log),
                (8_000 * MS, |c| c.log_data(BOARD, 1_000, 300)),
            ],
        ));
        let mut board = board(firmware.clone(), telem1);
        board.run_to(WorldNanos(8 * SECOND - 100 * MS)).unwrap();
        let (received_first, _) = received(&mut board);
        let answers = ping_answers(&received_first);
        assert_eq!(answers.len(), 350);
        assert_eq!(results(&received_first), [Message::ACCEPTED]);
        let size = 351 * csv::LINE;
        let entries: Vec<_> = messages(&received_first)
            .into_iter()
            .filter_map(|(_, what)| match what {
                Message::LogEntry { id, logs, size, .. } => Some((id, logs, size as usize)),
                _ => None,
            })
            .collect();
        assert_eq!(entries, [(1, 1, size)]);

        let file = file(pieces(&received_first));
        assert_has_the_answers(&file, &answers);
        // A frame has up to 109 bytes for 90 of the file: it took little longer than that.
        let is_data = |what: &Message| matches!(what, Message::LogData { .. });
        let messages = messages(&received_first);
        let (last, _) = messages.iter().rfind(|(_, what)| is_data(what)).unwrap();
        let least_ns = size.div_ceil(90) as u64 * 109 * BYTE_NS;
        let took_ns = last.0 - 4_300 * MS;
        println!("{version:?}: {size} bytes in {} ms", took_ns / MS);
        assert!(took_ns < least_ns * 11 / 10, "{took_ns} {least_ns}");

        // What a client missed, it has again.
        board.run_for(SECOND).unwrap();
        let again: Vec<u8> = pieces(&received(&mut board).0)
            .into_values()
            .flatten()
            .collect();
        assert_eq!(again, file[1_000..1_300]);
    }
}

#[test]
fn no_ping_is_lost_at_100_hz_while_the_log_flows() {
    let Some(firmware) = image() else { return };
    let mut telem1 = some_pings(SECOND, 1_400, 10 * MS);
    // The log grows while it is read.
    let ask = (8_004 * MS, whole_log as fn(&mut Client) -> Frame);
    telem1.extend(requests(Version::V2, [ask]));
    let mut board = board(firmware, telem1);
    board.run_to(WorldNanos(15 * SECOND + 500 * MS)).unwrap();
    let (received, status) = received(&mut board);
    let answers = ping_answers(&received);
    let numbers: Vec<u32> = answers.iter().map(|&(seq, _)| seq).collect();
    assert_eq!(numbers, (0..1_400).collect::<Vec<_>>());
    for key in [
        "mav_outgoing_full",
        "mav_incoming_full",
        "mav_overrun",
        "mav_crc_failures",
    ] {
        assert_eq!(status.get(key), None, "{status:?}");
    }
    let pieces = pieces(&received);
    assert!(pieces.len() > 300, "{} pieces", pieces.len());
    let file = file(pieces);
    let whole = file.len() / csv::LINE * csv::LINE;
    let samples = whole / csv::LINE - 1;
    assert!(samples >= 700, "all samples of before it was asked for");
    assert_has_the_answers(&file[..whole], &answers[..samples]);
}

#[test]
fn what_is_frozen_stays_and_what_begins_is_empty() {
    let Some(firmware) = image() else { return };
    let mut telem1 = some_pings(3 * SECOND, 90, 50 * MS);
    telem1.extend(requests(
        Version::V2,
        [
            (
                4_010 * MS,
                (|c| c.test(BOARD, Test::Ends)) as fn(&mut Client) -> Frame,
            ),
            // Asked back, because nobody has saved the first one; obeyed 2 s later.
            (4_012 * MS, |c| c.test(BOARD, Test::Begins)),
            (5_010 * MS, |c| c.parameter(BOARD, Parameter::LogLen)),
            (5_020 * MS, whole_log),
            (6_015 * MS, |c| c.test(BOARD, Test::Begins)),
            (6_020 * MS, |c| c.parameter(BOARD, Parameter::LogLen)),
            (7_010 * MS, |c| c.test(BOARD, Test::Ends)),
            (7_600 * MS, whole_log),
        ],
    ));
    let mut board = board(firmware, telem1);
    // PINGs at 3.00, 3.05 … 4.00 s are in the first test.
    board.run_to(WorldNanos(6 * SECOND)).unwrap();
    let (first, _) = received(&mut board);
    assert_eq!(parameter(&first, Parameter::LogLen), Some(21.0));
    let answers = ping_answers(&first);
    assert!(answers.len() > 50, "they are answered all the same");
    assert_has_the_answers(&file(pieces(&first)), &answers[..21]);
    // Those from 6.05 to 7.00 s in the second one.
    board.run_to(WorldNanos(9 * SECOND)).unwrap();
    let (second, _) = received(&mut board);
    assert_eq!(parameter(&second, Parameter::LogLen), Some(0.0));
    assert_eq!(results(&second), [Message::ACCEPTED; 2]);
    let tested: Vec<_> = ping_answers(&second)
        .into_iter()
        .filter(|(seq, _)| (61..=80).contains(seq))
        .collect();
    assert_eq!(tested.len(), 20);
    assert_has_the_answers(&file(pieces(&second)), &tested);
}

#[test]
fn the_parameters_are_those_of_the_image() {
    let Some(firmware) = image() else { return };
    let ask = |c: &mut Client| c.parameters(BOARD);
    let listed = [3 * SECOND, 4 * SECOND].map(|at| (at, ask as fn(&mut Client) -> Frame));
    for version in [Version::V1, Version::V2] {
        let telem1 = requests(version, listed);
        let mut board = board(firmware.clone(), telem1);
        board.run_to(WorldNanos(3_500 * MS)).unwrap();
        let (received, _) = received(&mut board);
        let values = Parameter::ALL.map(|wanted| parameter(&received, wanted).expect("a value"));
        // Variant pixclock, 50 µs, 115200, the message, an empty log, no fault; an M8 that steers the clock, a card
        // that was not used yet, and USB without a host.
        let m8 = 0xA8_00_1D as f32;
        let devices = [m8, 1.0, 0xFF_01_00 as f32, 0.0, 0xFF_02_00 as f32, 0.0, m8];
        assert_eq!(values[..7], [0.0, 50.0, 115_200.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(values[7..], devices);
    }
}

#[test]
fn a_full_log_is_announced_once() {
    let Some(firmware) = image() else { return };
    const BEYOND: usize = 100;
    let count = (CAPACITY + BEYOND) as u64;
    // 400 a second, just below what the line carries.
    let mut telem1 = some_pings(SECOND, count, 2_500_000);
    let end_ns = SECOND + count * 2_500_000;
    let ask = |c: &mut Client| c.parameters(BOARD);
    telem1.extend(requests(
        Version::V2,
        [(end_ns + 100 * MS, ask as fn(&mut Client) -> Frame)],
    ));
    let mut board = board(firmware, telem1);
    board.run_to(WorldNanos(end_ns + 2 * SECOND)).unwrap();
    let (received, status) = received(&mut board);
    assert_eq!(ping_answers(&received).len(), CAPACITY + BEYOND);
    assert_eq!(
        parameter(&received, Parameter::LogLen),
        Some(CAPACITY as f32)
    );
    assert_eq!(
        parameter(&received, Parameter::LogMissed),
        Some(BEYOND as f32)
    );
    let announced = texts(&received)
        .iter()
        .filter(|text| *text == "log full")
        .count();
    assert_eq!(announced, 1, "{:?}", texts(&received));
    assert_eq!(status.get("mav_outgoing_full"), None);
}

#[test]
fn at_the_lines_limit_answers_are_missing_where_the_line_is_full_and_counted() {
    let Some(firmware) = image() else { return };
    // Short PINGs, each right behind the one before: 21 or 22 bytes that ask for 26.
    const COUNT: u32 = 2_000;
    let mut client = Client::new(GROUND, Version::V2);
    let start = WorldNanos(4 * SECOND);
    let bytes: Vec<u8> = (0..COUNT)
        .flat_map(|seq| client.ping(u64::from(seq) + 1_000, seq).to_vec())
        .collect();
    let flood = Transmission {
        start,
        bytes,
        baud: BAUD,
    };
    let end = flood.end();
    let mut telem1 = vec![flood];
    let ask = (end.0 + 500 * MS, whole_log as fn(&mut Client) -> Frame);
    telem1.extend(requests(Version::V2, [ask]));
    let mut board = board(firmware, telem1);
    board.run_to(start).unwrap();
    let (before, status_before) = received(&mut board);
    assert_eq!(ping_answers(&before), []);
    assert_eq!(status_before.get("mav_outgoing_full"), None);
    board.run_to(WorldNanos(end.0 + 25 * SECOND)).unwrap();
    let (received, status) = received(&mut board);
    let answers = ping_answers(&received);
    let missing = COUNT as usize - answers.len();
    println!("{missing} of {COUNT} answers found no room");
    assert_eq!(
        status.number("pings"),
        Some(COUNT.into()),
        "every one has arrived"
    );
    for key in ["mav_overrun", "mav_incoming_full", "mav_crc_failures"] {
        assert_eq!(status.get(key), None, "{status:?}");
    }
    // Each that is missing is counted, and nothing else: what is sent each second has its place.
    let refused = status.number("mav_outgoing_full").unwrap_or(0) as usize;
    assert!(missing > 0 && refused == missing, "{refused} {missing}");
    let heartbeats: Vec<u64> = messages(&received)
        .into_iter()
        .filter(|(_, what)| *what == Message::Heartbeat)
        .map(|(at, _)| at.0)
        .collect();
    let longest_ns = heartbeats.windows(2).map(|pair| pair[1] - pair[0]).max();
    assert!(longest_ns < Some(1_200 * MS), "{longest_ns:?}");
    // And none was missing while the line had room: it never paused.
    // Once the first answers were on it, that is.
    let flood = start.0 + 50 * MS..end.0;
    let flooded: Vec<_> = received
        .iter()
        .filter(|h| flood.contains(&h.at.0))
        .collect();
    let longest_ns = flooded
        .windows(2)
        .map(|pair| pair[1].at.0 - pair[0].at.0)
        .max();
    assert!(longest_ns < Some(2 * BYTE_NS), "{longest_ns:?}");
    // What was answered is in the log, and nothing else.
    assert_has_the_answers(&file(pieces(&received)), &answers);
}
