//! The parameters of a node: listed, read by name or index, and not set.
//!
//! *Design.* Requests are built without the crate or by its client; answers are compared with
//! frames built without it, or understood by the client.

mod mavlink_frames;
mod mavlink_line;

use mavlink_frames::Frame;
use mavlink_line::{Board, GROUND, US, node, note, parsed, polled};
use mavlink_node::client::{Client, Message};
use mavlink_node::{Node, Parameter, Version};

#[test]
fn parameters_are_listed_in_both_versions() {
    for v2 in [false, true] {
        let mut node = node();
        note(&mut node, &Frame::message(v2, 21, 159, vec![1, 1]).bytes());
        let frames: Vec<_> = std::iter::from_fn(|| node.poll(&Board::of(0))).collect();
        assert_eq!(frames.len(), Parameter::ALL.len());
        let names = [
            "PC_VARIANT",
            "PC_TICK_US",
            "PC_GPS_BAUD",
            "PC_SOURCE",
            "PC_LOG_LEN",
            "PC_LOG_MISSED",
            "PC_FAULT",
            "PC_GNSS_ID",
            "PC_GNSS_STATE",
            "PC_CARD_ID",
            "PC_CARD_STATE",
            "PC_USB_ID",
            "PC_USB_STATE",
            "PC_CLOCK_PRIME",
        ];
        for ((index, frame), name) in (0_u8..).zip(&frames).zip(names) {
            // f32 value, u16 count, u16 index, 16 bytes of name, REAL32.
            let mut payload = (f32::from(index) + 0.5).to_le_bytes().to_vec();
            payload.extend([14, 0, index, 0]);
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
        let messages = polled(&mut node, &Board::of(0));
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
            assert_eq!(
                (index, usize::from(count)),
                (parameter.index(), Parameter::ALL.len())
            );
        }
    }
}

/// Every frame that the node has to send.
fn frames(node: &mut Node) -> Vec<mavlink_node::Frame> {
    std::iter::from_fn(|| node.poll(&Board::of(0))).collect()
}

/// The only parameter that is sent.
fn only_parameter(node: &mut Node) -> Parameter {
    match frames(node)[..] {
        [frame] => match parsed(&frame) {
            Some(Message::Parameter { name, .. }) => Parameter::named(name).expect("one of ours"),
            other => panic!("{other:?}"),
        },
        ref more => panic!("{more:?}"),
    }
}

/// PARAM_ERROR of the node: i16 index, u8 system, component, 16 bytes of name, u8 error.
fn error(sequence: u8, index: i16, name: &str, error: u8) -> Vec<u8> {
    let mut payload = index.to_le_bytes().to_vec();
    payload.extend([255, 190]);
    payload.extend(name.as_bytes());
    payload.resize(20, 0);
    payload.push(error);
    let (system, component) = (1, 1);
    Frame {
        sequence,
        system,
        component,
        ..Frame::message(true, 345, 209, payload)
    }
    .bytes()
}

/// PARAM_REQUEST_READ.
fn read(v2: bool, index: i16, name: &str) -> Vec<u8> {
    let mut payload = index.to_le_bytes().to_vec();
    payload.extend([1, 1]);
    payload.extend(name.as_bytes());
    payload.resize(20, 0);
    Frame::message(v2, 20, 214, payload).bytes()
}

#[test]
fn one_parameter_is_read_by_name_or_by_index() {
    for (v2, version) in [(false, Version::V1), (true, Version::V2)] {
        let mut client = Client::new(GROUND, version);
        for parameter in Parameter::ALL {
            let mut node = node();
            note(&mut node, &client.parameter(US, parameter));
            assert_eq!(only_parameter(&mut node), parameter);
            // With an index, the name does not count.
            note(&mut node, &read(v2, parameter.index() as i16, "PC_NONE"));
            assert_eq!(only_parameter(&mut node), parameter);
        }
    }
}

#[test]
fn a_parameter_that_is_not_there_is_an_error() {
    for v2 in [false, true] {
        let mut node = node();
        for (nth, (index, name)) in (0..).zip([
            (Parameter::ALL.len() as i16, ""),
            (i16::MAX, "PC_VARIANT"),
            (-1, "PC_NONE"),
            (-1, ""),
            (-1, "pc_variant"),
        ]) {
            note(&mut node, &read(v2, index, name));
            let sent = frames(&mut node);
            assert_eq!(sent.len(), 1);
            // MAV_PARAM_ERROR_DOES_NOT_EXIST.
            assert_eq!(*sent[0], error(nth, index, name, 1));
            assert_eq!(node.counters().unknown, u32::from(nth) + 1);
        }
    }
    // The frame of pymavlink in MAVLink 1 that had no answer: of index 0, and without a name.
    let mut node = node();
    let mut silent = vec![0xfe, 0x14, 0, 0xff, 0, 0x14, 0, 0, 1, 1];
    silent.extend([0; 16]);
    silent.extend([0xf1, 0x0c]);
    note(&mut node, &silent);
    assert_eq!(only_parameter(&mut node), Parameter::Variant);
}

#[test]
fn a_parameter_that_is_set_says_what_it_is_and_that_it_is_read_only() {
    for v2 in [false, true] {
        let mut node = node();
        // Whatever type the sender thinks it is of.
        for (nth, kind) in (0..).zip([9, 1, 0, 200]) {
            let mut payload = 7_f32.to_le_bytes().to_vec();
            payload.extend([1, 1]);
            payload.extend(b"PC_TICK_US\0\0\0\0\0\0");
            payload.push(kind);
            note(&mut node, &Frame::message(v2, 23, 168, payload).bytes());
            let sent = frames(&mut node);
            assert_eq!(sent.len(), 2);
            // MAV_PARAM_ERROR_READ_ONLY.
            assert_eq!(*sent[0], error(2 * nth, -1, "PC_TICK_US", 5));
            match parsed(&sent[1]) {
                Some(Message::Parameter { name, value, .. }) => {
                    assert_eq!((name.as_str(), value), ("PC_TICK_US", 1.5));
                }
                other => panic!("{other:?}"),
            }
        }
    }
}
