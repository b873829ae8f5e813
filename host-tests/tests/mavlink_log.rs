//! What a node does for an experiment: tests that begin and end, its parameters, its log.
//!
//! *Purpose.* Every request in both versions, to us and to others, damaged and repeated;
//! a log that is fetched whole, in gaps, and while it changes.
//!
//! *Design.* Requests are built without the crate or by its client; answers are compared
//! with frames built without it, or understood by the client. The log is a vector here.
//!
//! *Limits.* The log of the board itself: `virtual-pixhawk/tests/board/log.rs`.

mod mavlink_frames;
mod mavlink_line;

use mavlink_frames::Frame;
use mavlink_line::{GROUND, ask, feed, parsed};
use mavlink_node::client::{Client, Message};
use mavlink_node::{
    Address, Command, Config, LogFile, Node, NodeTime, Parameter, Parameters, Refusal, RequestKind,
    Test, Version,
};
use proptest::prelude::*;

const TIME: NodeTime = NodeTime {
    boot_us: 90_000_001,
    utc_ns: Some(1_795_320_000_123_456_789),
};
const US: Address = Address {
    system: 1,
    component: 1,
};
/// MAV_CMD_USER_1.
const USER_1: u16 = 31_010;

/// A log of these bytes, and parameters whose value is their index and a half.
struct Vault(Vec<u8>);

impl Vault {
    fn of(len: usize) -> Self {
        Self((0..len).map(|n| (n % 251) as u8).collect())
    }
}

impl Parameters for Vault {
    fn parameter(&self, parameter: Parameter) -> f32 {
        f32::from(parameter.index()) + 0.5
    }
}

impl LogFile for Vault {
    fn log_len(&self) -> u32 {
        self.0.len() as u32
    }

    fn log_began_ns(&self) -> Option<i64> {
        TIME.utc_ns
    }

    fn read_log(&self, offset: u32, out: &mut [u8]) -> usize {
        let rest = self.0.get(offset as usize..).unwrap_or_default();
        let count = out.len().min(rest.len());
        out[..count].copy_from_slice(&rest[..count]);
        count
    }
}

fn node() -> Node {
    Node::new(Config::default())
}

/// A COMMAND_LONG or COMMAND_INT with a first parameter, then zeros.
fn command(long: bool, v2: bool, number: u16, param1: f32) -> Frame {
    let frame = if long {
        Frame::command_long(v2, number, [1, 1])
    } else {
        Frame::command_int(v2, number, [1, 1])
    };
    let mut payload = frame.payload.clone();
    payload[..4].copy_from_slice(&param1.to_le_bytes());
    Frame { payload, ..frame }
}

/// Every message that the node has to send.
fn polled(node: &mut Node, vault: &Vault) -> Vec<Message> {
    let frames = std::iter::from_fn(|| node.poll(vault));
    let messages = frames.map(|frame| parsed(&frame).expect("a frame that a client understands"));
    // More than any log here takes.
    let messages: Vec<_> = messages.take(5_000).collect();
    assert!(!node.has_more());
    messages
}

/// The stretches of a log among `messages`: where each begins, and its bytes.
fn stretches(messages: &[Message]) -> Vec<(u32, Vec<u8>)> {
    messages
        .iter()
        .map(|what| match what {
            Message::LogData {
                id: 1,
                offset,
                data,
                count,
            } => (*offset, data[..usize::from(*count)].to_vec()),
            other => panic!("{other:?}"),
        })
        .collect()
}

/// Sends requests that are noted and not handed out.
fn note(node: &mut Node, bytes: &[u8]) {
    assert_eq!(feed(node, 0, bytes), []);
}

#[test]
fn a_test_begins_and_ends_by_command() {
    for (param1, meaning, result) in [
        (0.0, Ok(Test::Begins), 0),
        (-0.0, Ok(Test::Begins), 0),
        (1.0, Ok(Test::Ends), 0),
        (2.0, Err(Refusal::Denied), 2),
        (-1.0, Err(Refusal::Denied), 2),
        (0.5, Err(Refusal::Denied), 2),
        (f32::NAN, Err(Refusal::Denied), 2),
        (f32::INFINITY, Err(Refusal::Denied), 2),
    ] {
        for (long, v2) in [(true, false), (true, true), (false, false), (false, true)] {
            let mut node = node();
            let request = ask(&mut node, &command(long, v2, USER_1, param1).bytes());
            let number = USER_1;
            assert_eq!(
                request.kind,
                RequestKind::Command(Command { number, meaning })
            );
            let mut payload = USER_1.to_le_bytes().to_vec();
            payload.push(result);
            if v2 {
                payload.extend([0, 0, 0, 0, 0, 255, 190]);
            }
            let expected = Frame {
                system: 1,
                component: 1,
                ..Frame::message(v2, 77, 143, payload)
            };
            assert_eq!(*node.answer(&request, TIME), expected.bytes());
            assert_eq!(node.counters().commands, 1);
        }
    }
}

#[test]
fn the_clients_commands_are_obeyed() {
    for version in [Version::V1, Version::V2] {
        let mut client = Client::new(GROUND, version);
        let mut node = node();
        for test in [Test::Begins, Test::Ends] {
            let request = ask(&mut node, &client.test(US, test));
            let meaning = Ok(test);
            let number = USER_1;
            assert_eq!(
                request.kind,
                RequestKind::Command(Command { number, meaning })
            );
            assert_eq!(
                parsed(&node.answer(&request, TIME)),
                Some(Message::CommandAck {
                    command: USER_1,
                    result: Message::ACCEPTED
                })
            );
        }
    }
}

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
    ]
}

/// Whether a kind is received in MAVLink 1, too.
fn in_v1(id: u32) -> bool {
    ![20, 23].contains(&id)
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
            assert_eq!((counters.parameters, counters.logs), (0, 0), "{id}");
            if !v2 && in_v1(id) {
                assert_eq!(counters.for_others, 5, "{id}");
            }
            for target in [[1, 1], [1, 0]] {
                feed(&mut node, 0, &to(target));
            }
            let received = node.counters().parameters + node.counters().logs;
            let expected = if v2 || in_v1(id) { 2 } else { 0 };
            assert_eq!(received, expected, "{id}");
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
        // The good one after all that is received.
        feed(&mut node, 0, &bytes);
        let received = node.counters().parameters + node.counters().logs;
        assert_eq!(received, 1, "{id}");
    }
}

#[test]
fn parameters_are_listed_in_both_versions() {
    for v2 in [false, true] {
        let mut node = node();
        note(&mut node, &Frame::message(v2, 21, 159, vec![1, 1]).bytes());
        let frames: Vec<_> = std::iter::from_fn(|| node.poll(&Vault::of(0))).collect();
        assert_eq!(frames.len(), 6);
        let names = [
            "PC_VARIANT",
            "PC_TICK_US",
            "PC_GPS_BAUD",
            "PC_SOURCE",
            "PC_LOG_LEN",
            "PC_LOG_MISSED",
        ];
        for ((index, frame), name) in (0_u8..).zip(&frames).zip(names) {
            // f32 value, u16 count, u16 index, 16 bytes of name, REAL32.
            let mut payload = (f32::from(index) + 0.5).to_le_bytes().to_vec();
            payload.extend([6, 0, index, 0]);
            payload.extend(name.as_bytes());
            payload.resize(24, 0);
            payload.push(9);
            let expected = Frame {
                system: 1,
                component: 1,
                sequence: index,
                ..Frame::message(v2, 22, 220, payload)
            };
            assert_eq!(**frame, expected.bytes(), "{name}");
        }
    }
}

#[test]
fn the_client_receives_all_parameters_by_their_names() {
    for version in [Version::V1, Version::V2] {
        let mut node = node();
        note(&mut node, &Client::new(GROUND, version).parameters(US));
        let messages = polled(&mut node, &Vault::of(0));
        assert_eq!(messages.len(), Parameter::ALL.len());
        for (what, parameter) in messages.iter().zip(Parameter::ALL) {
            let Message::Parameter {
                name,
                value,
                index,
                count,
            } = *what
            else {
                panic!("{what:?}");
            };
            assert_eq!(Parameter::named(name), Some(parameter));
            assert_eq!(name.as_str(), parameter.name());
            assert_eq!(value, f32::from(parameter.index()) + 0.5);
            assert_eq!((index, count), (parameter.index(), 6));
        }
    }
}

/// The only parameter that is sent.
fn only_parameter(node: &mut Node) -> Option<Parameter> {
    match polled(node, &Vault::of(0))[..] {
        [] => None,
        [Message::Parameter { name, .. }] => Parameter::named(name),
        ref more => panic!("{more:?}"),
    }
}

#[test]
fn one_parameter_is_read_by_name_or_by_index() {
    let mut client = Client::new(GROUND, Version::V1);
    let mut node = node();
    for parameter in Parameter::ALL {
        note(&mut node, &client.parameter(US, parameter));
        assert_eq!(only_parameter(&mut node), Some(parameter));

        let read = |index: i16, name: &str| {
            let mut payload = index.to_le_bytes().to_vec();
            payload.extend([1, 1]);
            payload.extend(name.as_bytes());
            payload.resize(20, 0);
            Frame::message(true, 20, 214, payload).bytes()
        };
        // With an index, the name does not count.
        note(&mut node, &read(parameter.index() as i16, "PC_NONE"));
        assert_eq!(only_parameter(&mut node), Some(parameter));
        for (index, name) in [
            (6, ""),
            (i16::MAX, "PC_VARIANT"),
            (-1, "PC_NONE"),
            (-1, ""),
            (-1, "pc_variant"),
        ] {
            let before = node.counters().unknown;
            note(&mut node, &read(index, name));
            assert_eq!(only_parameter(&mut node), None);
            assert_eq!(node.counters().unknown, before + 1);
        }
    }
}

#[test]
fn a_parameter_that_is_set_says_what_it_is() {
    let mut node = node();
    // Whatever type the sender thinks it is of.
    for kind in [9, 1, 0, 200] {
        let mut payload = 7_f32.to_le_bytes().to_vec();
        payload.extend([1, 1]);
        payload.extend(b"PC_TICK_US\0\0\0\0\0\0");
        payload.push(kind);
        note(&mut node, &Frame::message(true, 23, 168, payload).bytes());
        match polled(&mut node, &Vault::of(0))[..] {
            [Message::Parameter { name, value, .. }] => {
                assert_eq!((name.as_str(), value), ("PC_TICK_US", 1.5));
            }
            ref other => panic!("{other:?}"),
        }
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
    assert_eq!(polled(&mut node, &Vault::of(0)).len(), 7);
}

#[test]
fn the_log_is_listed() {
    for v2 in [false, true] {
        let mut node = node();
        note(
            &mut node,
            &Frame::message(v2, 117, 128, vec![0, 0, 0xff, 0xff, 1, 1]).bytes(),
        );
        let entry = node.poll(&Vault::of(6_767)).expect("an entry");
        // u32 time_utc, u32 size, u16 id, u16 num_logs, u16 last_log_num.
        let mut payload = 1_795_320_000_u32.to_le_bytes().to_vec();
        payload.extend(6_767_u32.to_le_bytes());
        payload.extend([1, 0, 1, 0, 1, 0]);
        let expected = Frame {
            system: 1,
            component: 1,
            ..Frame::message(v2, 118, 56, payload)
        };
        assert_eq!(*entry, expected.bytes());
        assert_eq!(
            parsed(&entry),
            Some(Message::LogEntry {
                id: 1,
                logs: 1,
                time_utc: 1_795_320_000,
                size: 6_767
            })
        );
        assert!(!node.has_more());
    }
}

#[test]
fn the_whole_log_comes_in_pieces_of_90_bytes() {
    for version in [Version::V1, Version::V2] {
        for len in [0, 1, 89, 90, 91, 180, 6_767] {
            let vault = Vault::of(len);
            let mut node = node();
            note(
                &mut node,
                &Client::new(GROUND, version).log_data(US, 0, u32::MAX),
            );
            let pieces = stretches(&polled(&mut node, &vault));
            assert_eq!(pieces.len(), len.div_ceil(90).max(1));
            for ((nth, piece), bytes) in (0_u32..).zip(&pieces).zip(vault.0.chunks(90)) {
                assert_eq!(*piece, (90 * nth, bytes.to_vec()));
            }
            if len == 0 {
                assert_eq!(pieces, [(0, vec![])], "an empty piece");
            }
        }
    }
}

#[test]
fn what_lies_behind_the_end_is_answered_with_nothing() {
    let vault = Vault::of(100);
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    for (offset, count) in [(100, 90), (101, 1), (u32::MAX, u32::MAX), (0, 0), (100, 0)] {
        note(&mut node, &client.log_data(US, offset, count));
        assert_eq!(stretches(&polled(&mut node, &vault)), [(offset, vec![])]);
    }
    // Another log than number 1.
    let mut payload = [0, 0, 0, 0, 90, 0, 0, 0, 2, 0, 1, 1].to_vec();
    note(
        &mut node,
        &Frame::message(true, 119, 116, payload.clone()).bytes(),
    );
    payload[8] = 0;
    note(&mut node, &Frame::message(true, 119, 116, payload).bytes());
    assert!(!node.has_more());
    assert_eq!(node.counters().unknown, 2);
}

#[test]
fn a_new_request_takes_the_place_of_the_one_before() {
    let vault = Vault::of(6_767);
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    for nth in 0..5_u32 {
        let frame = node.poll(&vault).expect("a piece");
        assert_eq!(stretches(&[parsed(&frame).unwrap()])[0].0, 90 * nth);
    }
    note(&mut node, &client.log_data(US, 90, 100));
    let pieces = stretches(&polled(&mut node, &vault));
    assert_eq!(
        pieces,
        [
            (90, vault.0[90..180].to_vec()),
            (180, vault.0[180..190].to_vec())
        ]
    );
}

#[test]
fn a_transfer_ends_when_that_is_asked_for() {
    let vault = Vault::of(6_767);
    let mut client = Client::new(GROUND, Version::V1);
    let mut node = node();
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&vault).is_some());
    note(&mut node, &client.end_log(US));
    assert!(!node.has_more());

    note(&mut node, &client.log_data(US, 0, u32::MAX));
    let request = ask(&mut node, &client.erase_log(US));
    assert_eq!(request.kind, RequestKind::EraseLog);
    assert!(!node.has_more());
    match parsed(&node.answer(&request, TIME)) {
        Some(Message::StatusText { severity: 5, text }) => assert_eq!(text.as_str(), "log erased"),
        other => panic!("{other:?}"),
    }

    note(&mut node, &client.log_data(US, 0, u32::MAX));
    ask(&mut node, &client.test(US, Test::Begins));
    assert!(!node.has_more());

    // The end of a test does not end it: the log does not change by that.
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    ask(&mut node, &client.test(US, Test::Ends));
    assert!(node.has_more());
}

#[test]
fn a_log_that_grows_or_shrinks_on_the_variant_harms_nothing() {
    let mut vault = Vault::of(200);
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&vault).is_some());
    vault = Vault::of(300);
    let pieces = stretches(&polled(&mut node, &vault));
    let bytes: Vec<u8> = pieces.into_iter().flat_map(|(_, bytes)| bytes).collect();
    assert_eq!(bytes, vault.0[90..]);

    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&vault).is_some());
    assert_eq!(
        stretches(&polled(&mut node, &Vault::of(10))),
        [(90, vec![])]
    );
}

#[test]
fn parameters_come_before_the_log() {
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    let vault = Vault::of(6_767);
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&vault).is_some());
    note(&mut node, &client.parameter(US, Parameter::LogLen));
    let next = node.poll(&vault).expect("a frame");
    assert!(matches!(parsed(&next), Some(Message::Parameter { .. })));
    let next = node.poll(&vault).expect("a frame");
    assert!(matches!(
        parsed(&next),
        Some(Message::LogData { offset: 90, .. })
    ));
}

#[test]
fn each_answer_is_in_the_version_of_its_request() {
    let vault = Vault::of(100);
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
            while let Some(frame) = node.poll(&vault) {
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
    /// A line that loses frames: a client that asks again for what is missing has it all in the end.
    #[test]
    fn a_log_with_gaps_is_completed(
        len in 1..5_000_usize,
        lost in prop::collection::vec(any::<bool>(), 64),
        v2: bool,
    ) {
        let vault = Vault::of(len);
        let version = if v2 { Version::V2 } else { Version::V1 };
        let mut client = Client::new(GROUND, version);
        let mut node = node();
        let mut copy = vec![None; len];
        let mut losses = lost.into_iter().cycle();
        let mut has_lost = [false; 2];
        for round in 0.. {
            prop_assert!(round < 500);
            let Some(from) = copy.iter().position(Option::is_none) else { break };
            let missing = copy[from..].iter().take_while(|byte| byte.is_none()).count();
            note(&mut node, &client.log_data(US, from as u32, missing as u32));
            for (offset, bytes) in stretches(&polled(&mut node, &vault)) {
                // Each piece is lost in the first rounds, if at all.
                let is_lost = round < 40 && losses.next() == Some(true);
                has_lost[usize::from(is_lost)] = true;
                if !is_lost {
                    for (place, byte) in copy[offset as usize..].iter_mut().zip(bytes) {
                        *place = Some(byte);
                    }
                }
            }
        }
        let copy: Vec<u8> = copy.into_iter().flatten().collect();
        prop_assert_eq!(copy, vault.0);
    }

    /// Whatever comes, every frame is understood, each transfer ends, and a PING among
    /// it all is answered.
    #[test]
    fn nothing_that_is_asked_hangs_or_panics(
        asked in prop::collection::vec(anything(), 0..20),
        len in 0..2_000_usize,
    ) {
        let mut node = node();
        let vault = Vault::of(len);
        for bytes in asked {
            for request in feed(&mut node, 0, &bytes) {
                prop_assert!(parsed(&node.answer(&request, TIME)).is_some());
            }
            if let Some(frame) = node.poll(&vault) {
                prop_assert!(parsed(&frame).is_some());
            }
        }
        // The noise may end in the beginning of a frame.
        feed(&mut node, 0, &[0; 64]);
        let request = ask(&mut node, &Frame::ping(true, 7, 0).bytes());
        let is_ping = matches!(parsed(&node.answer(&request, TIME)), Some(Message::Ping { seq: 7, .. }));
        prop_assert!(is_ping);
        polled(&mut node, &vault);
    }
}
