//! The commands that a node accepts, and those that it refuses or ignores.
//!
//! *Design.* Requests are built without the crate or by its client; answers are compared with
//! frames built without it, or understood by the client.

mod mavlink_frames;
mod mavlink_line;

use mavlink_frames::Frame;
use mavlink_line::{Board, GROUND, TIME, US, ask, feed, node, parsed};
use mavlink_node::client::{Client, Message};
use mavlink_node::{
    Command, Config, Described, Fix, Node, Order, Refusal, RequestKind, Test, Version,
};

const OURS: [u8; 2] = [1, 1];

/// MAV_CMD_USER_1.
const USER_1: u16 = 31_010;

/// MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN.
const REBOOT: u16 = 246;

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

#[test]
fn a_test_begins_and_ends_and_is_saved_and_the_bootloader_is_called() {
    let denied = Err(Refusal::Denied);
    let test = |test| Ok(Order::Test(test));
    for (number, param1, meaning, result) in [
        (USER_1, 0.0, test(Test::Begins), 0),
        (USER_1, -0.0, test(Test::Begins), 0),
        (USER_1, 1.0, test(Test::Ends), 0),
        (USER_1, 2.0, test(Test::SavesAgain), 0),
        (USER_1, 3.0, test(Test::StopsSaving), 0),
        (USER_1, 4.0, denied, 2),
        (USER_1, -1.0, denied, 2),
        (USER_1, 0.5, denied, 2),
        (USER_1, f32::NAN, denied, 2),
        (USER_1, f32::INFINITY, denied, 2),
        (REBOOT, 3.0, Ok(Order::Bootloader), 0),
        (REBOOT, 0.0, denied, 2),
        (REBOOT, 1.0, denied, 2),
        (REBOOT, 2.0, denied, 2),
        (REBOOT, 3.5, denied, 2),
        (REBOOT, f32::NAN, denied, 2),
    ] {
        for (long, v2) in [(true, false), (true, true), (false, false), (false, true)] {
            let mut node = node();
            let request = ask(&mut node, &command(long, v2, number, param1).bytes());
            assert_eq!(
                request.kind,
                RequestKind::Command(Command { number, meaning })
            );
            let mut payload = number.to_le_bytes().to_vec();
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
        for (frame, number, order) in [
            (
                client.test(US, Test::Begins),
                USER_1,
                Order::Test(Test::Begins),
            ),
            (client.test(US, Test::Ends), USER_1, Order::Test(Test::Ends)),
            (client.bootloader(US), REBOOT, Order::Bootloader),
        ] {
            let request = ask(&mut node, &frame);
            let meaning = Ok(order);
            assert_eq!(
                request.kind,
                RequestKind::Command(Command { number, meaning })
            );
            assert_eq!(
                parsed(&node.answer(&request, TIME)),
                Some(Message::CommandAck {
                    command: number,
                    result: Message::ACCEPTED
                })
            );
        }
    }
}

#[test]
fn what_px4s_uploader_sends_calls_the_bootloader() {
    // Its bytes as they were recorded, to system 1; those to system 0 mean no single board.
    let mut recorded = vec![0xfe, 0x21, 0x72, 0xff, 0x00, 0x4c, 0x00, 0x00, 0x40, 0x40];
    recorded.extend([0; 24]);
    recorded.extend([0xf6, 0x00, 0x01, 0x00, 0x00, 0x53, 0x6b]);
    let expected = RequestKind::Command(Command {
        number: REBOOT,
        meaning: Ok(Order::Bootloader),
    });
    assert_eq!(ask(&mut node(), &recorded).kind, expected);
}

#[test]
fn commands_to_us_are_refused_whatever_their_number() {
    // Of others, and numbers that are not assigned.
    for number in [400, 511, 521, 0, 6, 49_999, u16::MAX] {
        for frame in [
            Frame::command_long(false, number, OURS),
            Frame::command_long(true, number, OURS),
            Frame::command_int(false, number, OURS),
            Frame::command_int(true, number, OURS),
            Frame::command_long(true, number, [1, 0]),
        ] {
            let mut node = node();
            let request = ask(&mut node, &frame.bytes());
            assert_eq!(
                request.kind,
                RequestKind::Command(Command {
                    number,
                    meaning: Err(Refusal::Unsupported)
                })
            );
            // COMMAND_ACK: number, MAV_RESULT_UNSUPPORTED; extensions progress,
            // result_param2, target.
            let mut payload = number.to_le_bytes().to_vec();
            payload.push(3);
            if frame.v2 {
                payload.extend([0, 0, 0, 0, 0, 255, 190]);
            }
            let expected = Frame {
                system: 1,
                component: 1,
                ..Frame::message(frame.v2, 77, 143, payload)
            };
            assert_eq!(*node.answer(&request, TIME), expected.bytes());
        }
    }
}

#[test]
fn commands_to_others_and_to_all_are_ignored() {
    let mut node = node();
    for target in [[2, 1], [1, 2], [0, 0], [0, 1]] {
        for frame in [
            Frame::command_long(false, 512, target),
            Frame::command_int(true, 512, target),
        ] {
            assert_eq!(feed(&mut node, 0, &frame.bytes()), []);
        }
    }
    assert_eq!(node.counters().commands, 0);
    assert_eq!(node.counters().for_others, 8);
}

#[test]
fn versions_are_sent_to_who_asks() {
    const UNIQUE: [u8; 12] = *b"a chip's own";
    // REQUEST_MESSAGE of both, and the older commands.
    for (number, param1, what) in [
        (512, 148.0, Described::Autopilot),
        (512, 300.0, Described::Protocol),
        (520, 1.0, Described::Autopilot),
        (519, 1.0, Described::Protocol),
    ] {
        for (long, v2) in [(true, false), (true, true), (false, false), (false, true)] {
            let mut node = Node::new(Config {
                unique_id: UNIQUE,
                ..Config::default()
            });
            let request = ask(&mut node, &command(long, v2, number, param1).bytes());
            let meaning = Ok(Order::Describe(what));
            assert_eq!(
                request.kind,
                RequestKind::Command(Command { number, meaning })
            );
            let ack = node.answer(&request, TIME);
            assert!(matches!(
                parsed(&ack),
                Some(Message::CommandAck { command, result: 0 }) if command == number
            ));
            let frame = node.poll(&Board::of(0)).expect("the message");
            assert!(!node.has_more());
            let expected = match what {
                Described::Autopilot => {
                    // u64 capabilities: COMMAND_INT, PARAM_ENCODE_C_CAST, MAVLINK2; u64 uid; u32
                    // release 0.1.0 of type dev; [u8; 18] uid2; the rest is 0.
                    let mut payload = (8_u64 + 131_072 + 8_192).to_le_bytes().to_vec();
                    payload.extend(&UNIQUE[..8]);
                    payload.extend([0, 0, 1, 0]);
                    payload.resize(60, 0);
                    if v2 {
                        payload.extend(UNIQUE);
                    }
                    Frame::message(v2, 148, 178, payload)
                }
                // MAVLink 1.0 to 2.0.
                Described::Protocol => Frame::message(true, 300, 217, vec![200, 0, 100, 0, 200, 0]),
                // With its own test.
                Described::Home => continue,
            };
            let expected = Frame {
                sequence: 1,
                system: 1,
                component: 1,
                ..expected
            };
            assert_eq!(*frame, expected.bytes(), "{number} {v2}");
        }
    }
    // A message that there is none of.
    for (number, param1) in [(512, 0.0), (512, 149.0), (519, 0.0), (520, 2.0)] {
        let mut node = node();
        let request = ask(&mut node, &command(true, true, number, param1).bytes());
        let meaning = Err(Refusal::Denied);
        assert_eq!(
            request.kind,
            RequestKind::Command(Command { number, meaning })
        );
        assert!(!node.has_more());
    }
}

#[test]
fn home_is_where_the_first_fix_was() {
    for (number, param1) in [(410, 0.0), (512, 242.0)] {
        for v2 in [false, true] {
            let mut node = node();
            let bytes = command(true, v2, number, param1).bytes();
            let meaning_of = |node: &mut Node| match ask(node, &bytes).kind {
                RequestKind::Command(command) => command.meaning,
                other => panic!("{other:?}"),
            };
            assert_eq!(meaning_of(&mut node), Err(Refusal::NotYet));
            assert!(!node.has_more());
            let mut fix = Fix {
                fix_type: 2,
                fix_ok: true,
                latitude_1e7_deg: 473_977_420,
                longitude_1e7_deg: 85_455_940,
                height_msl_mm: 488_100,
                ..Fix::default()
            };
            // A fix without a height is no home, and one that comes later is no other.
            node.gps_raw_int(TIME, Some(&fix));
            assert_eq!(meaning_of(&mut node), Err(Refusal::NotYet));
            fix.fix_type = 3;
            node.gps_raw_int(TIME, Some(&fix));
            fix.latitude_1e7_deg = 0;
            node.gps_raw_int(TIME, Some(&fix));
            assert_eq!(meaning_of(&mut node), Ok(Order::Describe(Described::Home)));
            let mut payload = 473_977_420_i32.to_le_bytes().to_vec();
            payload.extend(85_455_940_i32.to_le_bytes());
            payload.extend(488_100_i32.to_le_bytes());
            payload.extend(f32::NAN.to_le_bytes().repeat(10));
            let frame = node.poll(&Board::of(0)).expect("the message");
            assert!(!node.has_more());
            let expected = Frame {
                sequence: 3,
                system: 1,
                component: 1,
                ..Frame::message(v2, 242, 104, payload)
            };
            assert_eq!(*frame, expected.bytes());
        }
    }
}
