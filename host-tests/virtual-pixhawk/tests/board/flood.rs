//! A line at its limit, after a client that has made every counter speak: nothing is lost, on any phase of the
//! receiver.

use mavlink_node::Version;
use virtual_pixhawk::{Builder, Connector, Firmware, Script};
use world::{Receiver, ReceiverSettings, Transmission, WorldNanos};

use crate::common::{
    BAUD, MS, SECOND, START_UTC_NS, assert_all_answered, assert_nothing_lost, from_hex, image,
    last_status, pings,
};

/// What clients send, and what is broken, unknown or for others: after these each counter of the MAVLink
/// line stands in the status line.
const VISIT: [&str; 12] = [
    // TIMESYNC, COMMAND_LONG, PARAM_REQUEST_LIST, LOG_REQUEST_LIST.
    "fd09000000ff006f000000000000000000004d1352",
    "fd20000000ff004c00000000000000000000000000000000000000000000000000000000000000020101eeaf",
    "fd02000000ff001500000101fe16",
    "fd06000000ff007500000000ffff01011a67",
    // A PING to this board, which is an answer; data of a log that there is not.
    "fd0e000000ff00040000010000000000000001000000010139d8",
    "fd0c000000ff00770000000000005a0000000900010186b6",
    // For system 2; with a bad checksum; with an unknown flag.
    "fd12000000ff006f000000000000000000004d00000000000000020177dd",
    "fd09000000ff000400000100000000000000016700",
    "fd09020000ff00040000010000000000000001b8a3",
    // Signed; noise; half a header.
    "fd09010000ff0004000001000000000000000180a200000000000000000000000000",
    "0000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000",
    "fe0e00ff0004",
];
/// What the status line shows for them.
const SPEAKING: [&str; 9] = [
    "mav_timesyncs",
    "mav_commands",
    "mav_parameters",
    "mav_logs",
    "mav_answers",
    "mav_for_others",
    "mav_crc_failures",
    "mav_unknown_flags",
    "mav_foreign_bytes",
];

/// When the visit begins, and when the flood does: every answer to the visit has left by then.
const VISIT_AT: WorldNanos = WorldNanos(5 * SECOND);
const FLOOD_AT: WorldNanos = WorldNanos(12 * SECOND);
const FLOOD_S: u64 = 60;

/// The requests of a run: the visit, and `rate` PINGs a second.
fn requests(version: Version, rate: u64) -> Vec<Transmission> {
    let visit = VISIT.iter().zip(0..).map(|(hex, n)| Transmission {
        start: VISIT_AT.plus(n * 100 * MS),
        bytes: from_hex(hex),
        baud: BAUD,
    });
    let at = (0..FLOOD_S * rate).map(|n| FLOOD_AT.plus(n * SECOND / rate));
    visit.chain(pings(version, at)).collect()
}

/// On receivers whose epochs come `phases` of an eighth of their period after the board's own
/// seconds.
fn nothing_is_lost(firmware: &Firmware, version: Version, rate: u64, phases: [i64; 2]) {
    for phase in phases {
        let settings = ReceiverSettings::new(START_UTC_NS + phase * 25 * MS.cast_signed());
        let mut board = Builder::new(firmware.clone())
            .gps_and_pulse(Receiver::new(settings))
            .telem1(Script::new(requests(version, rate)))
            .power_on()
            .unwrap();
        board.run_to(FLOOD_AT).unwrap();
        // The visit's PING has its answer.
        board.take_received(Connector::Telem1).unwrap();
        board.run_to(FLOOD_AT.plus((FLOOD_S + 2) * SECOND)).unwrap();
        let status = last_status(&mut board);
        let what = format!("{version:?} at {rate} Hz, phase {phase}: {status}");
        for key in SPEAKING {
            assert!(status.contains(&format!(" {key}=")), "{key}: {what}");
        }
        assert_nothing_lost(&status, &what);
        let asked: Vec<u32> = (0..(FLOOD_S * rate) as u32).collect();
        assert_all_answered(&mut board, &asked, &what);
    }
}

macro_rules! floods {
    ($($name:ident: $version:ident, $rate:literal, $phases:expr;)+) => {
        $(
            #[test]
            fn $name() {
                let Some(firmware) = image() else { return };
                nothing_is_lost(&firmware, Version::$version, $rate, $phases);
            }
        )+
    };
}

floods! {
    of_480_pings_a_second_none_is_lost_on_phases_0_and_4: V1, 480, [0, 4];
    of_480_pings_a_second_none_is_lost_on_phases_1_and_5: V1, 480, [1, 5];
    of_480_pings_a_second_none_is_lost_on_phases_2_and_6: V1, 480, [2, 6];
    of_480_pings_a_second_none_is_lost_on_phases_3_and_7: V1, 480, [3, 7];
    of_420_pings_a_second_none_is_lost_on_phases_0_and_4: V2, 420, [0, 4];
    of_420_pings_a_second_none_is_lost_on_phases_1_and_5: V2, 420, [1, 5];
    of_420_pings_a_second_none_is_lost_on_phases_2_and_6: V2, 420, [2, 6];
    of_420_pings_a_second_none_is_lost_on_phases_3_and_7: V2, 420, [3, 7];
}
