//! Requests that take more than one frame: which are noted, and when and how they are answered.
//!
//! *Purpose.* Every request in both versions, to us and to others, damaged, repeated and mixed.
//!
//! *Design.* Requests are built without the crate or by its client; answers are understood by the
//! client.

mod mavlink_frames;
mod mavlink_line;

use mavlink_frames::Frame;
use mavlink_line::{Board, GROUND, TIME, US, ask, feed, node, note, parsed, polled};
use mavlink_node::client::{Client, Message};
use mavlink_node::{Parameter, Test, Version};
use proptest::prelude::*;

/// Every request with a target in both versions, as (id, CRC_EXTRA, its payload but for
/// the target, where the target stands).
fn targeted() -> Vec<(u32, u8, Vec<u8>, usize)> {
    let mut read = vec![0xff, 0xff, 0, 0];
    read.extend(b"PC_VARIANT\0\0\0\0\0\0");
    let mut set = 3_f32.to_le_bytes().to_vec();
    set.extend([0, 0]);
    set.extend(b"PC_VARIANT\0\0\0\0\0\0\x09");
    let mut data = [0, 0, 0, 0, 200, 0, 0, 0, 1, 0].to_vec();
    data.extend([0, 0]);
    vec![
        (20, 214, read, 2),
        (21, 159, vec![0, 0], 0),
        (23, 168, set, 4),
        (117, 128, vec![0, 0, 0xff, 0xff, 0, 0], 4),
        (119, 116, data, 10),
        (121, 237, vec![0, 0], 0),
        (122, 203, vec![0, 0], 0),
        (43, 132, vec![0, 0], 0),
    ]
}

#[test]
fn what_names_others_is_left_alone() {
    for (id, extra, payload, at) in targeted() {
        for v2 in [false, true] {
            let to = |target: [u8; 2]| {
                let mut payload = payload.clone();
                payload[at..at + 2].copy_from_slice(&target);
                Frame::message(v2, id, extra, payload).bytes()
            };
            let mut node = node();
            for target in [[2, 1], [2, 0], [1, 2], [0, 0], [0, 1]] {
                note(&mut node, &to(target));
            }
            assert!(!node.has_more(), "{id}");
            let counters = node.counters();
            assert_eq!(
                (counters.parameters, counters.logs, counters.missing),
                (0, 0, 0),
                "{id}"
            );
            if !v2 {
                assert_eq!(counters.for_others, 5, "{id}");
            }
            for target in [[1, 1], [1, 0]] {
                feed(&mut node, 0, &to(target));
            }
            let counters = node.counters();
            let received = counters.parameters + counters.logs + counters.missing;
            assert_eq!(received, 2, "{id}");
        }
    }
}

#[test]
fn a_damaged_request_starts_nothing() {
    for (id, extra, mut payload, at) in targeted() {
        payload[at..at + 2].copy_from_slice(&[1, 1]);
        let mut node = node();
        let bytes = Frame::message(true, id, extra, payload).bytes();
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            note(&mut node, &damaged);
        }
        assert!(!node.has_more(), "{id}");
        // The good one after all that is received, once no damaged length claims it.
        feed(&mut node, 0, &[0; 300]);
        feed(&mut node, 0, &bytes);
        let counters = node.counters();
        let received = counters.parameters + counters.logs + counters.missing;
        assert_eq!(received, 1, "{id}");
    }
}

#[test]
fn asking_twice_costs_nothing() {
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    for _ in 0..1_000 {
        note(&mut node, &client.parameters(US));
        note(&mut node, &client.logs(US));
    }
    // All parameters, and that there is no log.
    let all = Parameter::ALL.len() + 1;
    assert_eq!(polled(&mut node, &Board::of(0)).len(), all);
}

#[test]
fn parameters_come_before_the_log() {
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    let board = Board::of(6_767);
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&board).is_some());
    note(&mut node, &client.parameter(US, Parameter::LogLen));
    let next = node.poll(&board).expect("a frame");
    assert!(matches!(parsed(&next), Some(Message::Parameter { .. })));
    let next = node.poll(&board).expect("a frame");
    assert!(matches!(
        parsed(&next),
        Some(Message::LogData { offset: 90, .. })
    ));
}

#[test]
fn each_answer_is_in_the_version_of_its_request() {
    let board = Board::of(100);
    for (version, magic) in [(Version::V1, 0xfe), (Version::V2, 0xfd)] {
        let mut client = Client::new(GROUND, version);
        let mut node = node();
        // MAVLink 2 has been spoken on the line.
        feed(&mut node, 0, &Frame::ping(true, 1, 0).bytes());
        for request in [
            client.parameters(US),
            client.logs(US),
            client.log_data(US, 0, 90),
        ] {
            note(&mut node, &request);
            while let Some(frame) = node.poll(&board) {
                assert_eq!(frame[0], magic);
            }
        }
    }
}

/// Anything that a client can ask, as often and in whatever order.
fn anything() -> impl Strategy<Value = Vec<u8>> {
    let asked = (0..9_usize, any::<u32>(), any::<u32>(), any::<bool>()).prop_map(
        |(what, offset, count, v2)| {
            let version = if v2 { Version::V2 } else { Version::V1 };
            let mut client = Client::new(GROUND, version);
            match what {
                0 => client.parameters(US),
                1 => client.parameter(US, Parameter::LogLen),
                2 => client.logs(US),
                3 => client.log_data(US, offset % 1_000, count % 1_000),
                4 => client.log_data(US, offset, count),
                5 => client.end_log(US),
                6 => client.erase_log(US),
                7 => client.test(US, Test::Begins),
                _ => client.ping(offset.into(), count),
            }
            .to_vec()
        },
    );
    prop_oneof![4 => asked, 1 => prop::collection::vec(any::<u8>(), 0..40)]
}

proptest! {
    /// Whatever comes, every frame is understood, each transfer ends, and a PING among
    /// it all is answered.
    #[test]
    fn nothing_that_is_asked_hangs_or_panics(
        asked in prop::collection::vec(anything(), 0..20),
        len in 0..2_000_usize,
    ) {
        let mut node = node();
        let board = Board::of(len);
        for bytes in asked {
            for request in feed(&mut node, 0, &bytes) {
                prop_assert!(parsed(&node.answer(&request, TIME)).is_some());
            }
            if let Some(frame) = node.poll(&board) {
                prop_assert!(parsed(&frame).is_some());
            }
        }
        // The noise may end in the beginning of a frame.
        feed(&mut node, 0, &[0; 64]);
        let request = ask(&mut node, &Frame::ping(true, 7, 0).bytes());
        let is_ping = matches!(parsed(&node.answer(&request, TIME)), Some(Message::Ping { seq: 7, .. }));
        prop_assert!(is_ping);
        polled(&mut node, &board);
    }
}

/// The only frame that the node has to send.
fn only_frame(node: &mut mavlink_node::Node) -> mavlink_node::Frame {
    let frame = node.poll(&Board::of(0)).expect("a frame");
    assert!(!node.has_more());
    frame
}

#[test]
fn there_are_no_missions_and_that_is_said() {
    for (v2, mission_type) in [(false, 0), (true, 0), (true, 1), (true, 2), (true, 200)] {
        let mut node = node();
        let mut payload = vec![1, 1];
        if v2 {
            payload.push(mission_type);
        }
        note(&mut node, &Frame::message(v2, 43, 132, payload).bytes());
        // u16 count, u8 system, component, u8 type.
        let mut count = vec![0, 0, 255, 190];
        if v2 {
            count.push(mission_type);
        }
        let expected = Frame {
            system: 1,
            component: 1,
            ..Frame::message(v2, 44, 221, count)
        };
        assert_eq!(*only_frame(&mut node), expected.bytes());
    }
}

#[test]
fn there_are_no_files_and_that_is_said() {
    // OpenFileRO and ListDirectory: not found; TerminateSession, and one that is not known: no such
    // command.
    for (opcode, error) in [(4, 10), (3, 10), (1, 7), (99, 7)] {
        let mut node = node();
        let mut payload = vec![0, 1, 1, 0xff, 0xff, 5, opcode, 20, 0, 0, 0, 0, 0, 0, 0];
        payload.extend(b"@PARAM/param.pck?with");
        // As short as it goes over the line, and as long as it can be.
        for len in [payload.len(), 254] {
            payload.resize(len, 0x11);
            let mut node_now = mavlink_line::node();
            std::mem::swap(&mut node, &mut node_now);
            note(
                &mut node,
                &Frame::message(true, 110, 84, payload.clone()).bytes(),
            );
            // The next number, the session, NAK, one byte, of which request, and why.
            let mut nak = vec![0, 255, 190, 0, 0, 5, 129, 1, opcode, 0, 0, 0, 0, 0, 0];
            nak.push(error);
            let expected = Frame {
                system: 1,
                component: 1,
                ..Frame::message(true, 110, 84, nak)
            };
            assert_eq!(*only_frame(&mut node), expected.bytes());
            assert_eq!(node.counters().missing, 1);
        }
    }
    // An answer of somebody is none to answer.
    let mut node = node();
    let ack = vec![0, 1, 1, 0, 0, 0, 128, 0, 4];
    note(&mut node, &Frame::message(true, 110, 84, ack).bytes());
    assert!(!node.has_more());
}

#[test]
fn nobody_is_not_answered() {
    let mut node = node();
    // A PING of system 0: the answer would be a request to all.
    let ping = [
        0xfd, 9, 0, 0, 0, 0, 0, 4, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 9, 0xe8, 0x7e,
    ];
    note(&mut node, &ping);
    for frame in [
        Frame::timesync(true, 0, 7, [0, 0]),
        Frame::command_long(true, 31_010, [1, 1]),
        Frame::message(true, 21, 159, vec![1, 1]),
    ] {
        note(&mut node, &Frame { system: 0, ..frame }.bytes());
    }
    assert!(!node.has_more());
    let counters = node.counters();
    assert_eq!((counters.from_nobody, counters.pings), (4, 0));
}
