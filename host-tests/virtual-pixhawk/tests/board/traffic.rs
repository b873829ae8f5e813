//! What MAVProxy sends, as it was recorded, with PINGs in every gap: nothing is lost.
//!
//! *Design.* `mavproxy.txt` has ten minutes of `host-tests/clients/record.py`: in each all
//! parameters, the list of logs, a log, and two of MAVProxy's own pings, which are TIMESYNCs. A longer recording is played when
//! [`RECORDING_VARIABLE`] names it.

use mavlink_node::Version;
use virtual_pixhawk::{Builder, Script};
use world::{Receiver, Transmission, WorldNanos};

use crate::common::{
    BAUD, BYTE_NS, MS, SECOND, assert_all_answered, assert_nothing_lost, from_hex, image,
    last_status, pings, receiver_settings,
};

/// Names a file of `record.py` that is played in place of the ten minutes.
const RECORDING_VARIABLE: &str = "PIXCLOCK_TRAFFIC";
const TEN_MINUTES: &str = include_str!("mavproxy.txt");

const CONNECTED_AT: WorldNanos = WorldNanos(5 * SECOND);
const PINGS_PER_S: u64 = 100;

/// The frames of a recording: a line is ms since MAVProxy connected, and hexadecimal digits.
fn frames(recording: &str) -> Vec<Transmission> {
    let frame = |line: &str| {
        let (ms, hex) = line.split_once(' ').unwrap();
        Transmission {
            start: CONNECTED_AT.plus(ms.parse::<u64>().unwrap() * MS),
            bytes: from_hex(hex),
            baud: BAUD,
        }
    };
    recording.lines().map(frame).collect()
}

/// One line carries them all, so each waits for the one before it.
fn in_turn(mut sent: Vec<Transmission>) -> Vec<Transmission> {
    sent.sort_by_key(|one| one.start);
    let mut free_at = WorldNanos(0);
    for one in &mut sent {
        one.start = one.start.max(free_at);
        free_at = one.start.plus(one.bytes.len() as u64 * (BYTE_NS + 1));
    }
    sent
}

#[test]
fn mavproxy_and_100_pings_a_second_lose_nothing() {
    let Some(firmware) = image() else { return };
    let recording = match std::env::var_os(RECORDING_VARIABLE) {
        Some(file) => std::fs::read_to_string(file).unwrap(),
        None => TEN_MINUTES.to_owned(),
    };
    let mut sent = frames(&recording);
    let ends_at = sent.last().unwrap().start;
    let lasts_ns = ends_at.0 - CONNECTED_AT.0;
    let count = lasts_ns * PINGS_PER_S / SECOND;
    let at = (0..count).map(|n| CONNECTED_AT.plus(n * SECOND / PINGS_PER_S));
    let of_mavproxy = sent.len();
    sent.extend(pings(Version::V2, at));

    let mut board = Builder::new(firmware)
        .gps_and_pulse(Receiver::new(receiver_settings()))
        .telem1(Script::new(in_turn(sent)))
        .power_on()
        .unwrap();
    board.run_to(ends_at.plus(5 * SECOND)).unwrap();

    let status = last_status(&mut board);
    let what = format!("{of_mavproxy} frames and {count} PINGs: {status}");
    println!("{what}");
    assert_nothing_lost(&status, &what);
    let asked: Vec<u32> = (0..count as u32).collect();
    assert_all_answered(&mut board, &asked, &what);
}
