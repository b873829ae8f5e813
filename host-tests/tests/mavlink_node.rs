//! Which requests a node answers, with which time, and which it ignores.
//!
//! *Purpose.* The rules of PING, TIMESYNC and of broadcasts, on frames of other people's software.
//!
//! *Design.* Requests are built without the crate; answers are compared with
//! frames built without it, or understood by the crate's own client.
//!
//! *Limits.* Commands, parameters and the log have files of their own. Sockets and times of flight:
//! `cargo xtask ping`, `pymavlink/`.

mod mavlink_frames;
mod mavlink_line;

use mavlink_frames::{Frame, SIGNED};
use mavlink_line::{BYTE, GROUND, TIME, ask, feed, node, parsed};
use mavlink_node::client::{Client, Message};
use mavlink_node::{
    Config, Fix, Node, NodeTime, PingReply, Plotted, RequestKind, Severity, Version,
};
use proptest::prelude::*;
use timebase::{Cycles, StampedByte};

const IDLE: u64 = Node::IDLE;

/// [`TIME`] in µs of UTC.
const UTC_US: u64 = 1_795_320_000_123_456;

/// The same moment on a board whose clock was never set.
const UNSET: NodeTime = NodeTime {
    boot: Cycles::from_micros(90_000_001),
    utc_ns: None,
};

/// The node's system and component.
const OURS: [u8; 2] = [1, 1];

fn hex(digits: &str) -> Vec<u8> {
    (0..digits.len() / 2)
        .map(|nth| u8::from_str_radix(&digits[2 * nth..2 * nth + 2], 16).expect("hex"))
        .collect()
}

#[test]
fn frames_of_other_peoples_software() {
    let ping = |time_usec, seq| RequestKind::Ping { time_usec, seq };
    let requests = [
        // pymavlink in MAVLink 1 and 2, MAVSDK, MAVProxy's `ping`.
        (
            "fe0e00ffbe040000a40731af0500010000000000ed99",
            Version::V1,
            190,
            ping(0x0005_af31_07a4_0000, 1),
        ),
        (
            "fd09000000ffbe0400000000a40731af050001b8e3",
            Version::V2,
            190,
            ping(0x0005_af31_07a4_0000, 1),
        ),
        (
            "fd04000000f5be04000015ee359b5d43",
            Version::V2,
            190,
            ping(0x9b35_ee15, 0),
        ),
        (
            "fd10000000ffbe6f000000000000000000000000a0d885573416ce74",
            Version::V2,
            190,
            RequestKind::TimeSync {
                ts1: i64::from_le_bytes([0, 0, 0xa0, 0xd8, 0x85, 0x57, 0x34, 0x16]),
            },
        ),
    ];
    for (digits, version, component, what) in requests {
        let request = ask(&mut node(), &hex(digits));
        assert_eq!(request.version, version, "{digits}");
        assert_eq!(request.from.component, component, "{digits}");
        assert_eq!(request.kind, what, "{digits}");
    }
}

#[test]
fn a_request_carries_the_arrival_of_its_first_byte() {
    // Across a wrap of the 32-bit stamps, in the middle of the frame, too.
    for start in [0, 12_345, (1 << 32) - 100_000, (7 << 32) - 5] {
        for v2 in [false, true] {
            let requests = feed(&mut node(), start, &Frame::ping(v2, 3, 0).bytes());
            assert_eq!(requests[0].arrival, Cycles(start));
        }
    }
}

#[test]
fn bytes_may_come_while_a_queue_is_emptied() {
    // `now` was read before the first byte of the frame came.
    let now = Cycles(3 << 32);
    for after in [1, 1_000_000, 100_000_000] {
        let mut node = node();
        let stamp = now.plus(after).stamp();
        let bytes = Frame::ping(true, 3, 0).bytes();
        let mut requests = bytes
            .iter()
            .filter_map(|&byte| node.push(StampedByte { stamp, byte }, now));
        let request = requests.next().expect("a request");
        assert_eq!(request.arrival, now.plus(after));
    }
}

#[test]
fn what_is_sent_each_second_leaves_an_arriving_frame_alone() {
    let mut node = node();
    let ping = Frame::ping(true, 3, 0).bytes();
    let (head, tail) = ping.split_at(12);
    assert_eq!(feed(&mut node, 0, head), []);
    for _ in 0..3 {
        node.heartbeat(TIME);
        node.system_time(TIME, true);
        node.gps_raw_int(TIME, None);
    }
    assert_eq!(feed(&mut node, u64::from(BYTE) * 12, tail).len(), 1);
    assert_eq!(node.counters().framing.abandoned, 0);
}

#[test]
fn a_frame_that_breaks_off_is_given_up_after_its_timeout() {
    let ping = Frame::ping(true, 3, 0).bytes();
    let (head, tail) = ping.split_at(12);
    // Around wraps of the stamps, too.
    for start in [1 << 40, (1 << 32) - 1_000, (3 << 32) - IDLE / 2] {
        let mut node = node();
        let last = Cycles(start + 11 * u64::from(BYTE));
        assert_eq!(node.poll_timeout(last), None);
        assert_eq!(feed(&mut node, start, head), []);
        let due = last.plus(IDLE);
        // The same whenever it is asked, be it before the last byte was stamped.
        for now in [start, last.0, due.0, due.plus(20 * IDLE).0] {
            assert_eq!(node.poll_timeout(Cycles(now)), Some(due));
        }
        node.handle_timeout(Cycles(due.0 - 1));
        assert_eq!(feed(&mut node, due.0 - 1, tail).len(), 1, "not silent yet");

        let again = due.plus(IDLE);
        assert_eq!(feed(&mut node, again.0, head), []);
        let due = node.poll_timeout(again).expect("a timeout");
        node.handle_timeout(due);
        assert_eq!(node.counters().framing.abandoned, 1);
        assert_eq!(node.poll_timeout(due), None, "nothing is waited for");
        assert_eq!(feed(&mut node, due.0, tail), [], "its rest is no frame");
        assert_eq!(feed(&mut node, due.0 + IDLE, &ping).len(), 1);
    }
}

#[test]
fn ping_is_answered_with_the_time_of_its_arrival() {
    for v2 in [false, true] {
        let mut node = node();
        let request = ask(&mut node, &Frame::ping(v2, 77, 0).bytes());
        for (time, time_usec) in [(TIME, UTC_US), (UNSET, UNSET.boot_us())] {
            let mut payload = time_usec.to_le_bytes().to_vec();
            payload.extend(77_u32.to_le_bytes());
            payload.extend([255, 190]);
            let expected = Frame {
                system: 1,
                component: 1,
                sequence: u8::from(time == UNSET),
                ..Frame::message(v2, 4, 237, payload)
            };
            assert_eq!(*node.answer(&request, time), expected.bytes());
        }
        assert_eq!(node.counters().pings, 1);
    }
}

#[test]
fn ping_echoes_where_that_is_wanted() {
    let mut node = Node::new(Config {
        ping_reply: PingReply::Echo,
        ..Config::default()
    });
    let request = ask(&mut node, &Frame::ping(true, 5, 0).bytes());
    let answer = node.answer(&request, TIME);
    assert_eq!(
        parsed(&answer),
        Some(Message::Ping {
            time_usec: 2,
            seq: 5,
            target: GROUND
        })
    );
}

#[test]
fn a_ping_with_a_target_is_never_answered() {
    let mut node = node();
    for target in [1, 2, 255] {
        for v2 in [false, true] {
            assert_eq!(feed(&mut node, 0, &Frame::ping(v2, 1, target).bytes()), []);
        }
    }
    // Nor is what this node itself answers, which the line may echo.
    let request = ask(&mut node, &Frame::ping(true, 5, 0).bytes());
    let answer = node.answer(&request, TIME);
    assert_eq!(feed(&mut node, 0, &answer), []);
    assert_eq!(node.counters().answers, 7);
    assert_eq!(node.counters().pings, 1);
}

#[test]
fn timesync_keeps_ts1_and_tells_our_time() {
    for v2 in [false, true] {
        for ts1 in [0, 1, -1, i64::MIN, i64::MAX] {
            let mut node = node();
            let request = ask(&mut node, &Frame::timesync(v2, 0, ts1, [0, 0]).bytes());
            for (time, tc1) in [
                (TIME, 1_795_320_000_123_456_789),
                (UNSET, 90_000_001_000),
                (
                    NodeTime {
                        boot: Cycles(0),
                        utc_ns: None,
                    },
                    1,
                ),
            ] {
                let answer = node.answer(&request, time);
                assert_eq!(parsed(&answer), Some(Message::TimeSync { tc1, ts1 }));
            }
            let Frame { payload, .. } = Frame::timesync(v2, TIME.utc_ns.unwrap(), ts1, [255, 190]);
            let answer = node.answer(&request, TIME);
            assert!(
                answer
                    .windows(payload.len())
                    .any(|window| window == payload)
            );
        }
    }
}

#[test]
fn timesync_of_and_for_others_is_left_alone() {
    let mut node = node();
    for bytes in [
        Frame::timesync(true, 5, 7, [0, 0]).bytes(),
        Frame::timesync(true, 5, 7, OURS).bytes(),
        Frame::timesync(false, -5, 7, OURS).bytes(),
    ] {
        assert_eq!(feed(&mut node, 0, &bytes), []);
    }
    assert_eq!(node.counters().answers, 3);
    for target in [[2, 1], [1, 2]] {
        assert_eq!(
            feed(&mut node, 0, &Frame::timesync(true, 0, 7, target).bytes()),
            []
        );
    }
    assert_eq!(node.counters().for_others, 2);
    ask(&mut node, &Frame::timesync(true, 0, 7, OURS).bytes());
    ask(&mut node, &Frame::timesync(true, 0, 7, [1, 0]).bytes());
    assert_eq!(node.counters().timesyncs, 2);
}

#[test]
fn a_signed_request_is_answered_unsigned() {
    let mut node = node();
    let signed = Frame {
        flags: SIGNED,
        ..Frame::ping(true, 9, 0)
    };
    let request = ask(&mut node, &signed.bytes());
    let answer = node.answer(&request, TIME);
    assert_eq!(answer[2], 0, "no flag");
    assert_eq!(node.counters().framing.signed, 1);
}

#[test]
fn foreign_messages_do_no_harm() {
    let mut node = node();
    let mut stream =
        b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n".to_vec();
    stream.extend(Frame::message(true, 0, 50, vec![0, 0, 0, 0, 6, 8, 0, 0, 3]).bytes());
    // REQUEST_DATA_STREAM.
    stream.extend(Frame::message(false, 66, 148, vec![4, 0, 1, 1, 0, 1]).bytes());
    // An unknown message with an id above 16 bits, and one with the id of PING
    // in its lowest byte only.
    stream.extend(Frame::message(true, 0x0001_0004, 1, vec![7; 14]).bytes());
    stream.extend(Frame::message(true, 0x0100 + 4, 1, vec![7; 14]).bytes());
    let foreign = stream.len() as u32;
    stream.extend(Frame::ping(true, 1, 0).bytes());
    assert_eq!(feed(&mut node, 0, &stream).len(), 1);
    assert_eq!(node.counters().framing.foreign_bytes, foreign);
}

#[test]
fn broadcasts_follow_the_version_that_is_spoken() {
    let mut node = node();
    assert_eq!(node.heartbeat(UNSET)[0], 0xfe);
    ask(&mut node, &Frame::ping(false, 1, 0).bytes());
    assert_eq!(
        node.heartbeat(UNSET)[0],
        0xfe,
        "MAVLink 1 as long as nothing else is received"
    );
    ask(&mut node, &Frame::ping(true, 1, 0).bytes());
    ask(&mut node, &Frame::ping(false, 1, 0).bytes());
    assert_eq!(
        node.heartbeat(UNSET)[0],
        0xfd,
        "MAVLink 2 once it was received"
    );
}

/// A node on a line of that version.
fn node_on(v2: bool) -> Node {
    let mut node = node();
    if v2 {
        ask(&mut node, &Frame::ping(true, 1, 0).bytes());
    }
    node
}

/// A frame of the node, built without it.
fn sent(v2: bool, sequence: u8, (id, extra): (u32, u8), payload: Vec<u8>) -> Vec<u8> {
    let (system, component) = (1, 1);
    Frame {
        sequence,
        system,
        component,
        ..Frame::message(v2, id, extra, payload)
    }
    .bytes()
}

#[test]
fn heartbeat_and_system_time_have_the_state_of_the_clock() {
    for v2 in [false, true] {
        let mut node = node_on(v2);
        // GENERIC, GENERIC; MAV_STATE_BOOT, then ACTIVE; version 3.
        let booting = sent(v2, 0, (0, 50), vec![0, 0, 0, 0, 0, 0, 0, 1, 3]);
        let active = sent(v2, 1, (0, 50), vec![0, 0, 0, 0, 0, 0, 0, 4, 3]);
        assert_eq!(*node.heartbeat(UNSET), booting);
        assert_eq!(*node.heartbeat(TIME), active);

        let time = |unix_us: u64| [&unix_us.to_le_bytes()[..], &90_000_u32.to_le_bytes()].concat();
        assert_eq!(
            *node.system_time(UNSET, true),
            sent(v2, 2, (2, 137), time(0))
        );
        assert_eq!(
            *node.system_time(TIME, true),
            sent(v2, 3, (2, 137), time(UTC_US))
        );
        // A time that is not proved is none to set other clocks by.
        let unproved = node.system_time(TIME, false);
        assert_eq!(*unproved, sent(v2, 4, (2, 137), time(0)));
    }
}

#[test]
fn what_is_plotted_has_a_name_and_a_value() {
    for v2 in [false, true] {
        let mut node = node_on(v2);
        for (sequence, (what, name)) in (0..).zip([
            (Plotted::Uncertainty, "CLK_UNC_NS"),
            (Plotted::Frequency, "CLK_PPB"),
            (Plotted::Source, "CLK_SOURCE"),
            (Plotted::Unproved, "CLK_UNPROV"),
        ]) {
            let mut payload = 90_000_u32.to_le_bytes().to_vec();
            payload.extend(18_000_000_410_f32.to_le_bytes());
            payload.extend(name.bytes());
            payload.resize(18, 0);
            let frame = node.plot(TIME, what, 18_000_000_410.0);
            assert_eq!(*frame, sent(v2, sequence, (251, 170), payload));
            let Some(Message::Plotted { name: text, .. }) = parsed(&frame) else {
                panic!("{frame:?}");
            };
            assert_eq!((text.as_str(), what.name()), (name, name));
        }
        assert_eq!(Plotted::ALL.len(), 4);
        let unknown = parsed(&node.plot(UNSET, Plotted::Uncertainty, f32::NAN));
        assert!(matches!(unknown, Some(Message::Plotted { value, .. }) if value.is_nan()));
    }
}

#[test]
fn gps_raw_int_has_the_fix_in_its_units() {
    for v2 in [false, true] {
        let mut node = node_on(v2);
        let fix = Fix {
            fix_type: 3,
            fix_ok: true,
            latitude_1e7_deg: 473_977_420,
            longitude_1e7_deg: 85_455_940,
            height_msl_mm: 488_100,
            ground_speed_mm_s: 129,
            heading_1e5_deg: 35_999_999,
            satellites: 17,
            horizontal_accuracy_mm: 1_200,
            vertical_accuracy_mm: 2_300,
            ..Fix::default()
        };
        let mut payload = UTC_US.to_le_bytes().to_vec();
        payload.extend(473_977_420_i32.to_le_bytes());
        payload.extend(85_455_940_i32.to_le_bytes());
        payload.extend(488_100_i32.to_le_bytes());
        // No dilutions, 12 cm/s, 359.99 degrees, 3D, 17 satellites.
        payload.extend([0xff, 0xff, 0xff, 0xff, 12, 0, 0x9f, 0x8c, 3, 17]);
        if v2 {
            // No height above the ellipsoid.
            payload.extend([0; 4]);
            payload.extend(1_200_u32.to_le_bytes());
            payload.extend(2_300_u32.to_le_bytes());
        }
        assert_eq!(
            *node.gps_raw_int(TIME, Some(&fix)),
            sent(v2, 0, (24, 24), payload)
        );
    }
}

#[test]
fn statustext_has_the_first_50_bytes() {
    for v2 in [false, true] {
        let mut node = node_on(v2);
        let mut payload = vec![4];
        payload.extend(b"clock set");
        payload.resize(51, 0);
        let warning = node.statustext(Severity::Warning, "clock set");
        assert_eq!(*warning, sent(v2, 0, (253, 83), payload));
        let long = node.statustext(Severity::Info, &"x".repeat(200));
        assert_eq!(long.len(), if v2 { 63 } else { 59 });
    }
}

#[test]
fn a_fix_is_sent_as_its_receiver_claims_it() {
    let mut node = node();
    let mut fix_type_of = |fix: Option<Fix>| match parsed(&node.gps_raw_int(TIME, fix.as_ref())) {
        Some(Message::Fix { fix_type }) => fix_type,
        other => panic!("{other:?}"),
    };
    // NAV-PVT's: none, dead reckoning, 2D, 3D, both, time only, and one that is not known.
    for (fix_type, known) in [(0, 1), (1, 1), (2, 2), (3, 3), (4, 3), (5, 1), (6, 1)] {
        for (fix_ok, expected) in [(true, known), (false, 1)] {
            let fix = Fix {
                fix_type,
                fix_ok,
                ..Fix::default()
            };
            assert_eq!(fix_type_of(Some(fix)), expected, "{fix:?}");
        }
    }
    assert_eq!(fix_type_of(None), 0, "no receiver");
    // Speeds and headings that the message cannot hold are unknown.
    for (ground_speed_mm_s, heading_1e5_deg) in [(-20, -2_000), (i32::MAX, i32::MAX)] {
        let fix = Fix {
            ground_speed_mm_s,
            heading_1e5_deg,
            ..Fix::default()
        };
        let frame = node.gps_raw_int(TIME, Some(&fix));
        assert_eq!(frame[6 + 24..6 + 28], [0xff; 4]);
    }
}

proptest! {
    #[test]
    fn the_client_and_the_node_understand_each_other(
        time_usec: u64,
        seq: u32,
        utc_ns in prop::option::of(0..i64::MAX),
        boot_us in 0..u64::MAX / 1_000_000,
        v2: bool,
    ) {
        let version = if v2 { Version::V2 } else { Version::V1 };
        let mut client = Client::new(GROUND, version);
        let mut node = node();
        let request = ask(&mut node, &client.ping(time_usec, seq));
        prop_assert_eq!(request.kind, RequestKind::Ping { time_usec, seq });
        prop_assert_eq!(request.from, GROUND);
        let time = NodeTime { boot: Cycles::from_micros(boot_us), utc_ns };
        let us = utc_ns.map_or(boot_us, |ns| (ns / 1_000) as u64);
        prop_assert_eq!(
            parsed(&node.answer(&request, time)),
            Some(Message::Ping { time_usec: us, seq, target: GROUND })
        );
        prop_assert_eq!(
            parsed(&node.system_time(time, true)),
            Some(Message::SystemTime {
                time_unix_usec: utc_ns.map_or(0, |ns| (ns / 1_000) as u64),
                time_boot_ms: (boot_us / 1_000) as u32,
            })
        );
        prop_assert_eq!(parsed(&node.heartbeat(time)), Some(Message::Heartbeat));
    }

    #[test]
    fn no_bytes_make_a_node_panic(stream: Vec<u8>, times: (u64, Option<i64>)) {
        let mut node = node();
        let time = NodeTime { boot: Cycles(times.0), utc_ns: times.1 };
        for request in feed(&mut node, 0, &stream) {
            prop_assert!(!node.answer(&request, time).is_empty());
        }
        node.heartbeat(time);
        node.system_time(time, true);
        node.gps_raw_int(time, None);
    }
}
