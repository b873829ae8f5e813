//! What a host does to the port: unplugs, suspends, does not read, floods. Nothing hangs, and the receiver and the other
//! links lose nothing.

use mavlink_node::client::Client;
use mavlink_node::{Address, Version};
use virtual_pixhawk::{Builder, Connector, Firmware, Host, PACE_VARIABLE, Pixhawk, Script};
use world::{Receiver, Transmission, WorldNanos};

use crate::common::{
    BAUD, MS, SECOND, assert_all_answered, assert_nothing_lost, image, last_status, ping_answers,
    pings, receiver_settings,
};

const BOARD: Address = Address {
    system: 1,
    component: 1,
};
const GROUND: Address = Address {
    system: 255,
    component: 190,
};
/// When the port is open.
const OPEN_AT: u64 = SECOND;
/// From one PING on TELEM1 to the next.
const TELEM1_APART: u64 = 20 * MS;
/// Exception numbers (RM0090, table 62): 16 and the interrupt's.
const USART2: u16 = 16 + 38;
const USART3: u16 = 16 + 39;
const UART4: u16 = 16 + 52;

/// A board with a host, a receiver, and PINGs on TELEM1 until `until_ns`; how many these are.
fn board(firmware: &Firmware, host: Host, until_ns: u64) -> (Pixhawk, u32) {
    let count = (until_ns - OPEN_AT) / TELEM1_APART;
    let at = (0..count).map(|n| WorldNanos(OPEN_AT + n * TELEM1_APART));
    let board = Builder::new(firmware.clone())
        .gps_and_pulse(Receiver::new(receiver_settings()))
        .telem1(Script::new(pings(Version::V2, at)))
        .usb(host)
        .power_on()
        .unwrap();
    (board, count as u32)
}

/// Everything on TELEM1 was answered, and nothing was lost.
fn assert_others_are_well(board: &mut Pixhawk, count: u32, what: &str) -> String {
    board.run_for(1_200 * MS).unwrap();
    let status = last_status(board);
    assert_nothing_lost(&status, what);
    let asked: Vec<u32> = (0..count).collect();
    assert_all_answered(board, &asked, what);
    status
}

fn send(board: &mut Pixhawk, at: u64, bytes: Vec<u8>) {
    board
        .with_usb(move |host| host.send(WorldNanos(at), &bytes))
        .unwrap();
}

/// A PING over USB at `at`, which is now, has its answer within 50 ms.
#[track_caller]
fn assert_is_answered(board: &mut Pixhawk, at: u64, seq: u32) {
    let ping = Client::new(GROUND, Version::V2).ping(1_000, seq);
    send(board, at, ping.to_vec());
    board.run_to(WorldNanos(at + 50 * MS)).unwrap();
    let received = board.with_usb(Host::take_received).unwrap();
    let is_there = ping_answers(&received).iter().any(|&(it, _)| it == seq);
    assert!(is_there, "PING {seq}");
}

#[test]
fn of_50_unplugs_in_mid_transfer_none_hangs_anything() {
    const UNPLUGS: u32 = 50;
    // From one to the next; the host has set the port up 250 ms after the cable is in.
    const PERIOD: u64 = 500 * MS;
    let Some(firmware) = image() else { return };
    let from = 4 * SECOND;
    let until = from + u64::from(UNPLUGS) * PERIOD;
    let (mut board, count) = board(&firmware, Host::new(Script::default()), until);
    for n in 0..UNPLUGS {
        let at = from + u64::from(n) * PERIOD;
        board.run_to(WorldNanos(at)).unwrap();
        assert_is_answered(&mut board, at, n);
        // The log goes out, and PINGs come in, when the cable is pulled; each time at another moment.
        let mut client = Client::new(GROUND, Version::V2);
        let mut bytes = client.log_data(BOARD, 0, u32::MAX).to_vec();
        for seq in 0..40 {
            bytes.extend(client.ping(1_000, 1_000 + seq).iter());
        }
        send(&mut board, at + 50 * MS, bytes);
        let pulled = 51 * MS + u64::from(n) * 37_501;
        board.run_to(WorldNanos(at + pulled)).unwrap();
        board.with_usb(|host| host.plug(false)).unwrap();
        board.run_to(WorldNanos(at + pulled + 100 * MS)).unwrap();
        board.with_usb(|host| host.plug(true)).unwrap();
    }
    board.run_to(WorldNanos(until)).unwrap();
    assert_is_answered(&mut board, until, UNPLUGS);
    assert_others_are_well(&mut board, count, "unplugged");
}

#[test]
fn a_host_that_does_not_read_costs_the_other_links_nothing() {
    let Some(firmware) = image() else { return };
    let until = 12 * SECOND;
    let at = (0..500).map(|n| WorldNanos(3 * SECOND + n * 10 * MS));
    let host = Host::new(Script::new(pings(Version::V2, at)));
    let (mut board, count) = board(&firmware, host, until);
    board.run_to(WorldNanos(3 * SECOND)).unwrap();
    board.with_usb(|host| host.read(false)).unwrap();
    board.run_to(WorldNanos(10 * SECOND)).unwrap();
    board.with_usb(|host| host.read(true)).unwrap();
    board.run_to(WorldNanos(10_500 * MS)).unwrap();
    let received = board.with_usb(Host::take_received).unwrap();
    assert!(!ping_answers(&received).is_empty(), "what waited arrives");
    assert_is_answered(&mut board, 10_500 * MS, 900);
    board.run_to(WorldNanos(until)).unwrap();
    assert_others_are_well(&mut board, count, "not read");
}

#[test]
fn a_suspended_bus_resumes_and_the_port_is_there_again() {
    let Some(firmware) = image() else { return };
    let until = 10 * SECOND;
    let (mut board, count) = board(&firmware, Host::new(Script::default()), until);
    for n in 0..5 {
        let at = 3 * SECOND + n * SECOND;
        board.run_to(WorldNanos(at)).unwrap();
        assert_is_answered(&mut board, at, n as u32);
        board.suspend_usb(true).unwrap();
        board.run_to(WorldNanos(at + 400 * MS)).unwrap();
        board.suspend_usb(false).unwrap();
    }
    board.run_to(WorldNanos(until)).unwrap();
    assert_is_answered(&mut board, until, 99);
    assert_others_are_well(&mut board, count, "suspended");
}

/// More bytes than the bus carries in half a second, made of whole `pattern`s.
fn flood(pattern: &[u8]) -> Vec<u8> {
    pattern.repeat(650_000 / pattern.len())
}

#[test]
fn a_flood_takes_a_third_of_the_core_and_a_good_frame_behind_it_is_late_and_not_lost() {
    let Some(firmware) = image() else { return };
    let pace = std::env::var(PACE_VARIABLE).map_or(1.0, |pace| pace.parse::<f64>().unwrap());
    let ping = Client::new(GROUND, Version::V2).ping(1, 1).to_vec();
    for (name, pattern) in [
        ("zeros", &[0][..]),
        ("headers", &[0xfe, 14, 4]),
        ("PINGs", &ping),
    ] {
        let until = 12 * SECOND;
        let (mut board, count) = board(&firmware, Host::new(Script::default()), until);
        let instructions_at = |board: &mut Pixhawk, ms| {
            board.run_to(WorldNanos(ms * MS)).unwrap();
            board.instructions().unwrap()
        };
        // Half a second without, and one with it.
        let [begin, middle] = [3_500, 4_000].map(|ms| instructions_at(&mut board, ms));
        board.with_usb(Host::take_received).unwrap();
        let bytes = flood(pattern);
        let frames = bytes.len() / ping.len();
        send(&mut board, 4_000 * MS, bytes);
        let end = instructions_at(&mut board, 4_500);
        let unsent = board.with_usb(|host| host.unsent()).unwrap();
        assert!(unsent > 0, "{name}: the flood was over");
        let more = (end - middle) as f64 - (middle - begin) as f64;
        let part = more * pace * 2.0 / f64::from(timebase::CORE_HZ);
        println!("{name}: {part:.3} of the core, {unsent} bytes still to come");
        assert!(part <= 1.0 / 3.0, "{name}: {part}");
        let frame = Client::new(GROUND, Version::V2).ping(1, 77).to_vec();
        send(&mut board, 4_500 * MS, frame);
        board.run_to(WorldNanos(until)).unwrap();
        let received = board.with_usb(Host::take_received).unwrap();
        let answers = ping_answers(&received);
        assert!(answers.iter().any(|&(seq, _)| seq == 77), "{name}");
        if pattern == ping {
            assert_eq!(answers.len(), frames + 1);
        }
        assert_others_are_well(&mut board, count, name);
    }
}

#[test]
fn no_stamp_waits_and_no_tick_is_lost_with_usb_flooded_and_three_lines_busy() {
    let Some(firmware) = image() else { return };
    let times = || (0..2_000).map(|n| WorldNanos(14 * SECOND + n * 4 * MS));
    let mut board = Builder::new(firmware.clone())
        .gps_and_pulse(Receiver::new(receiver_settings()))
        .telem1(Script::new(pings(Version::V1, times())))
        .telem2(Script::new(pings(Version::V2, times())))
        .usb(Host::new(Script::new([Transmission {
            start: WorldNanos(15 * SECOND),
            bytes: flood(&Client::new(GROUND, Version::V2).ping(1, 1)).repeat(3),
            baud: BAUD,
        }])))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(16 * SECOND)).unwrap();
    board.start_meter(&[]).unwrap();
    board.run_for(2 * SECOND).unwrap();
    let profile = board.stop_meter();
    let masked = profile.masked(&firmware);
    for (function, tally) in masked.iter().take(5) {
        println!("{:>4} instructions masked in {function}", tally.most);
    }
    let longest = masked[0].1.most;
    assert!(longest <= 250, "{longest} instructions, {}", masked[0].0);
    for line in [UART4, USART2, USART3] {
        let stamp = profile.stamps()[&line];
        println!("{line}: {stamp:?}");
        assert!(stamp.times > 900 && stamp.most <= 500, "{line}: {stamp:?}");
    }
    let status = last_status(&mut board);
    assert_nothing_lost(&status, &status);
    for connector in [Connector::Telem1, Connector::Telem2] {
        let answers = ping_answers(&board.take_received(connector).unwrap());
        assert!(answers.len() >= 980, "{connector:?}: {}", answers.len());
    }
}
