//! What is answered, to the byte: frames that the decoder of `synapse-cdm` 3.9.1 accepts.

use stanag_node::{Config, Node, Position, Reading, State};
use stanag_wire::{NodeId, Refusal};

/// 2026-11-28 06:40:00.123 UTC. \[ns\]
const TIME_NS: i64 = 1_795_848_000_123_000_000;
const DISCOVERY: &str =
    "ffff001500505f01ffffffff00011e4000003fc5b612267bffffffffffffffff00000000001183";
const IDENTITY: [&str; 2] = [
    "ffff00160050430100505f0100021e40006067c5b612267bff000000ff00000001010000000008ad",
    "ffff00100050430100505f0100031e40003bc5b612267bff0000000000000300071e",
];
const CLOCK_REQUEST: &str = "ffff000d00505f0100504301cb201e4007c5b612267b06f855000000070827";
const HEARTBEAT_WITH_BIT_15: &str = "ffff000600505f01005043013e829e4001c5b612267b0715";

fn node() -> Node {
    Node::new(Config {
        id: NodeId(0x0050_4301),
        version: [0, 3, 0],
        git_hash: 0x1234_5678,
        board: 9,
    })
}

fn at(utc_ns: i64) -> Reading {
    Reading {
        utc_ns: Some(utc_ns),
        uncertainty_ns: 40,
        state: State::Pulse,
        boot_ns: 83_456_012_345,
    }
}

const NOT_SET: Reading = Reading {
    utc_ns: None,
    uncertainty_ns: u32::MAX,
    state: State::NotSet,
    boot_ns: 83_456_012_345,
};

fn bytes(hex: &str) -> Vec<u8> {
    let digit = |it: u8| char::from(it).to_digit(16).expect("hexadecimal") as u8;
    let pairs = hex.as_bytes().as_chunks::<2>().0.iter();
    pairs
        .map(|pair| digit(pair[0]) << 4 | digit(pair[1]))
        .collect()
}

fn answers(datagram: &str, at_arrival: Reading, now: Reading) -> Vec<String> {
    let mut node = node();
    let datagram = bytes(datagram);
    let requests: Vec<_> = node.handle(&datagram).expect("good frames").collect();
    let answers = requests
        .into_iter()
        .flat_map(|it| node.answers(it, at_arrival, now));
    answers.map(|it| hex(it.bytes())).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_discovery_is_answered_with_who_we_are() {
    assert_eq!(answers(DISCOVERY, at(TIME_NS), at(TIME_NS)), IDENTITY);
}

#[test]
fn an_acknowledgement_has_the_time_of_arrival_or_none() {
    let later = at(TIME_NS + 7_000_000);
    let set = "ffff000e0050430100505f0142681e400fc5b6122682c5b612267b3e8201098b";
    assert_eq!(answers(HEARTBEAT_WITH_BIT_15, later, later), [set]);
    let not_set = "ffff00090050430100505f0142681e400ec5b612267b3e82010750";
    assert_eq!(answers(HEARTBEAT_WITH_BIT_15, NOT_SET, NOT_SET), [not_set]);
}

#[test]
fn a_clock_request_is_answered_to_the_nanosecond() {
    let (arrival, sent) = (at(TIME_NS + 999_999), at(TIME_NS + 1_002_345));
    let report = "ffff002b0050430100505f01cb211e4007ffc5b612267c00092900000007c5b612267b06f855c5b612267b0f423f000000280200000146000030390f3e";
    assert_eq!(answers(CLOCK_REQUEST, arrival, sent), [report]);
    let not_set =
        "ffff00170050430100505f01cb211e40071c00000007c5b612267b06f85500000001460000303908fe";
    assert_eq!(answers(CLOCK_REQUEST, NOT_SET, NOT_SET), [not_set]);
    // Set in between: the arrival has no time, and half a pair would mislead.
    assert_eq!(answers(CLOCK_REQUEST, NOT_SET, sent), [not_set]);
}

#[test]
fn a_message_that_is_asked_for_is_sent() {
    let asks_for_3 = "ffff000800505f0100504301426a1e4011c5b612267b00030696";
    let set = at(TIME_NS);
    assert_eq!(answers(asks_for_3, set, set), [IDENTITY[1]]);
    // #52001 has a question of its own; #9 does not exist.
    for (wanted, sum) in [("cb21", "077f"), ("0009", "069c")] {
        let asks = asks_for_3.replace("00030696", &format!("{wanted}{sum}"));
        assert_eq!(answers(&asks, set, set), [""; 0], "{wanted}");
    }
}

#[test]
fn where_and_when_the_receiver_is() {
    let position = Position {
        latitude: 372_963_000,
        longitude: 1_272_012_000,
        height_mm: 120_000,
        velocity_mm_s: [1_500, -2_000, 100],
    };
    let sent = node()
        .position(Some(TIME_NS), &position)
        .map(|it| hex(it.bytes()));
    let expected =
        "ffff001a00504301ffffffff0fa01e400000ffc5b612267b1a85958f5a74459400177003001effd8000210cd";
    assert_eq!(sent.as_deref(), Some(expected));
    // Faster than a field can say: that speed is left out.
    let fast = Position {
        velocity_mm_s: [0, 2_000_000, 0],
        ..position
    };
    let sent = node().position(None, &fast).map(|it| hex(it.bytes()));
    assert_eq!(
        sent.map(|it| it[32..38].to_owned()).as_deref(),
        Some("0000be")
    );
}

#[test]
fn a_heartbeat_is_to_all() {
    let sent = node().heartbeat(at(TIME_NS)).map(|it| hex(it.bytes()));
    let expected = "ffff000600504301ffffffff3e821e4001c5b612267b09e1";
    assert_eq!(sent.as_deref(), Some(expected));
}

#[test]
fn answers_and_our_own_frames_are_never_answered() {
    let set = at(TIME_NS);
    for answer in IDENTITY {
        assert_eq!(answers(answer, set, set), [""; 0]);
    }
    // A request from our own id to us: somebody else has it.
    let own = CLOCK_REQUEST
        .replace("00505f0100504301", "0050430100504301")
        .replace("0827", "080b");
    let mut node = node();
    assert_eq!(node.handle(&bytes(&own)).unwrap().count(), 0);
    assert_eq!(node.counters().from_our_id, 1);
    // To another vehicle.
    let other = CLOCK_REQUEST
        .replace("00504301", "00504302")
        .replace("0827", "0828");
    assert_eq!(node.handle(&bytes(&other)).unwrap().count(), 0);
    assert_eq!(node.counters().passed, 1);
}

#[test]
fn a_datagram_that_does_not_divide_is_refused_whole() {
    let mut node = node();
    let datagram = bytes(&format!("{CLOCK_REQUEST}{HEARTBEAT_WITH_BIT_15}"));
    assert_eq!(node.handle(&datagram).unwrap().count(), 2);
    let cut = &datagram[..datagram.len() - 1];
    assert_eq!(node.handle(cut).err(), Some(Refusal::Short));
    assert_eq!((node.counters().refused, node.counters().requests), (1, 2));
}

#[test]
fn every_private_message_with_every_byte_changes_nothing() {
    let mut node = node();
    let header = |message| stanag_wire::Header {
        source: NodeId(0x0050_5f01),
        destination: NodeId(0x0050_4301),
        message,
        wants_acknowledgement: false,
        idd: 30,
        sum: stanag_wire::Sum::Bytes2,
    };
    for message in 52_000..=52_015 {
        for byte in 0..=255 {
            for length in [1, 2, 13, 40] {
                let mut out = [0; 128];
                let end = header(message)
                    .write(&[byte; 40][..length], &mut out)
                    .unwrap();
                let requests: Vec<_> = node.handle(&out[..end]).unwrap().collect();
                for request in requests {
                    assert!(node.answers(request, NOT_SET, NOT_SET).count() <= 2);
                }
            }
        }
    }
    assert_eq!(hex(node.heartbeat(NOT_SET).unwrap().bytes()).len(), 2 * 19);
}
