//! The parameters of a node: listed, read by name or index, and not set.
//!
//! *Design.* Requests are built without the crate or by its client; answers are compared with
//! frames built without it, or understood by the client.

mod mavlink_frames;
mod mavlink_line;

use mavlink_frames::Frame;
use mavlink_line::{Board, GROUND, US, node, note, polled};
use mavlink_node::client::{Client, Message};
use mavlink_node::{Node, Parameter, Version};

#[test]
fn parameters_are_listed_in_both_versions() {
    for v2 in [false, true] {
        let mut node = node();
        note(&mut node, &Frame::message(v2, 21, 159, vec![1, 1]).bytes());
        let frames: Vec<_> = std::iter::from_fn(|| node.poll(&Board::of(0))).collect();
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
            assert_eq!((index, count), (parameter.index(), 6));
        }
    }
}

/// The only parameter that is sent.
fn only_parameter(node: &mut Node) -> Option<Parameter> {
    match polled(node, &Board::of(0))[..] {
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
        match polled(&mut node, &Board::of(0))[..] {
            [Message::Parameter { name, value, .. }] => {
                assert_eq!((name.as_str(), value), ("PC_TICK_US", 1.5));
            }
            ref other => panic!("{other:?}"),
        }
    }
}
