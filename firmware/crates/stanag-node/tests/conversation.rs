//! What is answered, to the byte: frames that the decoder of `synapse-cdm` 3.9.1 accepts.

use node_values::{NodeTime, Parameter, Parameters, Severity};
use stanag_node::{Config, Node, Reading, State, message};
use stanag_wire::{Builder, Header, Layout, NodeId, Refusal, Sum, Values};
use timebase::{Cycles, Fix, StampedByte};

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
        time: NodeTime {
            boot: UP,
            utc_ns: Some(utc_ns),
        },
        uncertainty_ns: 40,
        state: State::Pulse,
    }
}

/// 83.456 012 345 s.
const UP: Cycles = Cycles::from_nanos(83_456_012_345);
const NOT_SET: Reading = Reading {
    time: NodeTime {
        boot: UP,
        utc_ns: None,
    },
    uncertainty_ns: u32::MAX,
    state: State::NotSet,
};

/// Parameters whose values are their indices and a half.
struct Halves;

impl Parameters for Halves {
    fn parameter(&self, parameter: Parameter) -> f32 {
        f32::from(parameter.index()) + 0.5
    }
}

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
    answers_of(&mut node, &datagram, at_arrival, now)
}

fn answers_of(node: &mut Node, datagram: &[u8], at_arrival: Reading, now: Reading) -> Vec<String> {
    let requests = node.handle(datagram, UP).expect("good frames");
    let requests: Vec<_> = requests.collect();
    let mut answers = Vec::new();
    for request in &requests {
        let mut send = |bytes: &[u8]| answers.push(hex(bytes));
        node.answer(request, (&at_arrival, &now), &Halves, &mut send);
    }
    answers
}

/// What the node sends in a second.
fn second(node: &mut Node, now: Reading) -> Vec<String> {
    let mut sent = Vec::new();
    node.handle_second(&now, &mut |bytes| sent.push(hex(bytes)));
    sent
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
    let fix = Fix {
        fix_type: 3,
        fix_ok: true,
        latitude_1e7_deg: 372_963_000,
        longitude_1e7_deg: 1_272_012_000,
        height_ellipsoid_mm: 120_000,
        velocity_mm_s: [1_500, -2_000, 100],
        ..Fix::default()
    };
    let mut node = node();
    let mut sent = |epoch_ns, fix: Fix| {
        node.handle_position(epoch_ns, &fix);
        second(&mut node, NOT_SET).get(1).cloned()
    };
    let expected =
        "ffff001a00504301ffffffff0fa01e400000ffc5b612267b1a85958f5a74459400177003001effd8000210cd";
    assert_eq!(sent(Some(TIME_NS), fix).as_deref(), Some(expected));
    let vector = |sent: Option<String>| sent.expect("it has room")[32..38].to_owned();
    // Faster than a field can say: that speed is left out.
    let fast = Fix {
        velocity_mm_s: [0, 2_000_000, 0],
        ..fix
    };
    assert_eq!(vector(sent(None, fast)), "0000be");
    // Without a height, and without a fix.
    assert_eq!(vector(sent(None, Fix { fix_type: 2, ..fix })), "0000e6");
    assert_eq!(
        vector(sent(
            None,
            Fix {
                fix_ok: false,
                ..fix
            }
        )),
        "000000"
    );
    // What was sent last is sent again to who asks for it.
    assert_eq!(sent(Some(TIME_NS), fix).as_deref(), Some(expected));
    let asks = "ffff000800505f0100504301426a1e4011c5b612267b0fa00742";
    let again = answers_of(&mut node, &bytes(asks), NOT_SET, NOT_SET);
    assert_eq!(again.len(), 1);
    assert_eq!(again[0][32..84], expected[32..84]);
}

#[test]
fn a_heartbeat_is_to_all() {
    let sent = second(&mut node(), at(TIME_NS));
    let expected = "ffff000600504301ffffffff3e821e4001c5b612267b09e1";
    assert_eq!(sent, [expected]);
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
    assert_eq!(node.handle(&bytes(&own), UP).unwrap().count(), 0);
    assert_eq!(node.counters().from_our_id, 1);
    // To another vehicle.
    let other = CLOCK_REQUEST
        .replace("00504301", "00504302")
        .replace("0827", "0828");
    assert_eq!(node.handle(&bytes(&other), UP).unwrap().count(), 0);
    assert_eq!(node.counters().passed, 1);
}

#[test]
fn a_datagram_that_does_not_divide_is_refused_whole() {
    let mut node = node();
    let datagram = bytes(&format!("{CLOCK_REQUEST}{HEARTBEAT_WITH_BIT_15}"));
    assert_eq!(node.handle(&datagram, UP).unwrap().count(), 2);
    let cut = &datagram[..datagram.len() - 1];
    assert_eq!(node.handle(cut, UP).err(), Some(Refusal::Short));
    assert_eq!((node.counters().refused, node.counters().requests), (1, 2));
}

/// A frame from the station to the node.
fn frame(message: u16, data: &[u8]) -> Vec<u8> {
    let header = Header {
        source: NodeId(0x0050_5F01),
        destination: NodeId(0x0050_4301),
        message,
        wants_acknowledgement: false,
        idd: Header::EDITION_3,
        sum: Sum::Bytes2,
    };
    let mut out = [0; 548];
    let end = header.write(data, &mut out).expect("it has room");
    out[..end].to_vec()
}

fn data(layout: &Layout, fields: &[(usize, u64)]) -> Vec<u8> {
    let mut data = Builder::new(layout);
    for &(field, value) in fields {
        assert!(data.unsigned(field, value));
    }
    data.data().to_vec()
}

/// The data of the one frame in `hex`.
fn sent_data(hex: &str, expected: u16) -> Vec<u8> {
    let bytes = bytes(hex);
    let (frame, rest) = stanag_wire::Frame::read(&bytes).expect("a frame");
    assert_eq!((frame.header.message, rest.len()), (expected, 0));
    frame.data.to_vec()
}

/// The words of the alerts that wait, with whom they are for.
fn alerts(node: &mut Node) -> Vec<(u32, String)> {
    let mut said = Vec::new();
    for alert in &second(node, NOT_SET)[1..] {
        let alert = bytes(alert);
        let (frame, _) = stanag_wire::Frame::read(&alert).expect("a frame");
        assert_eq!(frame.header.message, message::ALERT);
        let values: Values<'_> = message::ALERT_LAYOUT.values(frame.data).expect("an alert");
        let text = values.bytes(11).expect("it has words");
        let end = text.iter().position(|&it| it == 0).expect("its NUL");
        let words = String::from_utf8(text[..end].to_vec()).expect("ASCII");
        said.push((frame.header.destination.0, words));
    }
    said
}

const STATION: u32 = 0x0050_5F01;
const ALL: u32 = 0xFFFF_FFFF;

#[test]
fn an_interval_and_a_parameter_are_reported_and_never_changed() {
    let mut node = node();
    let set = at(TIME_NS);
    let interval = &message::MESSAGE_INTERVAL_LAYOUT;
    for (of, asked_ms, holds_ms, complaints) in [
        (16_002, u64::from(u32::MAX), 1_000, 0),
        (4_000, 100, 1_000, 1),
        (52_001, 100, 0, 1),
    ] {
        let asks = frame(52_003, &data(interval, &[(1, of), (2, asked_ms)]));
        let sent = answers_of(&mut node, &asks, set, set);
        let sent = sent_data(&sent[0], 52_003);
        let values = interval.values(&sent).unwrap();
        assert_eq!(
            (values.unsigned(1), values.unsigned(2)),
            (Some(of), Some(holds_ms))
        );
        assert_eq!(alerts(&mut node).len(), complaints, "{of}");
    }
    // #17001 asks for the same.
    let asks = frame(
        17_001,
        &data(&message::SCHEDULE_LAYOUT, &[(1, 4_000), (2, 10)]),
    );
    let sent = answers_of(&mut node, &asks, set, set);
    sent_data(&sent[0], 52_003);
    assert!(alerts(&mut node)[0].1.starts_with("not changed"));
    assert_eq!(node.counters().no_key, 3);

    let layout = &message::PARAMETER_REQUEST_LAYOUT;
    let value = &message::PARAMETER_VALUE_LAYOUT;
    let mut by_name = Builder::new(layout);
    by_name.unsigned(1, 0xFFFF);
    by_name.bytes(2, b"PC_TICK_US");
    let mut change = Builder::new(value);
    change.unsigned(1, 1);
    change.unsigned(5, 7);
    for asks in [
        frame(52_004, by_name.data()),
        frame(52_004, &data(layout, &[(1, 1)])),
        frame(52_005, change.data()),
    ] {
        let sent = answers_of(&mut node, &asks, set, set);
        let sent = sent_data(&sent[0], 52_005);
        let values = value.values(&sent).unwrap();
        assert_eq!(values.unsigned(1), Some(1));
        assert_eq!(values.unsigned(2), Some(Parameter::ALL.len() as u64));
        assert_eq!(values.bytes(3), Some(&b"PC_TICK_US\0\0\0\0\0\0\0"[..]));
        let bits = values.unsigned(5).and_then(|it| u32::try_from(it).ok());
        assert_eq!(bits.map(f32::from_bits), Some(1.5));
    }
    assert_eq!(node.counters().no_key, 4);
    assert!(alerts(&mut node)[0].1.starts_with("not changed"));
    let asks = frame(52_004, &data(layout, &[(1, 99)]));
    assert!(answers_of(&mut node, &asks, set, set).is_empty());
    assert_eq!(alerts(&mut node), [(STATION, "not known here".to_owned())]);
}

#[test]
fn what_is_refused_is_counted_and_said_in_words() {
    let mut node = node();
    let loi = |bits| {
        let fields = [(1, u64::from(ALL)), (5, bits)];
        frame(1, &data(&message::AUTHORISATION_REQUEST_LAYOUT, &fields))
    };
    // LOI 2, and all of them: granted is LOI 2.
    for (bits, complaints) in [(1, 0), (0xF, 1)] {
        let sent = answers_of(&mut node, &loi(bits), at(TIME_NS), at(TIME_NS));
        assert_eq!(sent_data(&sent[0], 2)[16..18], [1, 1]);
        assert_eq!(alerts(&mut node).len(), complaints);
    }
    assert_eq!(node.counters().loi, 1);
    // Longer and shorter than the vector says.
    for length in [1, 5, 7] {
        let bytes = frame(16_002, &[1, 2, 3, 4, 5, 6, 7, 8][..length]);
        assert_eq!(node.handle(&bytes, UP).unwrap().count(), 0);
        assert!(alerts(&mut node)[0].1.contains("presence vector"));
    }
    assert_eq!(node.counters().malformed, 3);
    // A bit that the table does not have: what is known of it is read.
    let later = frame(16_002, &[0x81, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(node.handle(&later, UP).unwrap().count(), 0);
    assert!(alerts(&mut node).is_empty());
    // Of another edition, cut off, of Edition 2, and from our own id.
    let mut other = frame(16_002, &[0]);
    (other[14], other[18]) = (40, other[18] + 10);
    assert_eq!(node.handle(&other, UP).err(), Some(Refusal::Idd(40)));
    assert!(alerts(&mut node)[0].1.contains("IDD 30"));
    assert!(node.handle(&other[..12], UP).is_err());
    assert!(alerts(&mut node)[0].1.contains("whole"));
    assert!(node.handle(b"25and so on, to 16 bytes", UP).is_err());
    assert!(alerts(&mut node).is_empty());
    let own = CLOCK_REQUEST
        .replace("00505f0100504301", "0050430100504301")
        .replace("0827", "080b");
    assert_eq!(node.handle(&bytes(&own), UP).unwrap().count(), 0);
    assert_eq!(
        alerts(&mut node),
        [(ALL, "another node has our id".to_owned())]
    );
    // A flood of one kind is one alert.
    for _ in 0..1_000 {
        assert!(node.handle(&other, UP).is_err());
    }
    assert_eq!(alerts(&mut node).len(), 1);
    assert_eq!(node.counters().refused, 1_003);
}

fn alert(node: &mut Node, now: Reading, said: (Severity, &str)) -> String {
    let mut sent = String::new();
    node.alert(&now, said, &mut |bytes| sent = hex(bytes));
    sent
}

#[test]
fn an_alert_has_the_words_of_a_statustext() {
    let mut node = node();
    let said = alert(
        &mut node,
        at(TIME_NS),
        (Severity::Warning, "clock in holdover"),
    );
    let data = sent_data(&said, message::ALERT);
    let values = message::ALERT_LAYOUT.values(&data).unwrap();
    let read = [0, 2, 4].map(|field| values.unsigned(field));
    assert_eq!(read, [Some(849_163_200_123), Some(3), Some(5)]);
    assert_eq!(values.integer(10), Some(-1));
    assert!(
        values
            .bytes(11)
            .unwrap()
            .starts_with(b"clock in holdover\0")
    );
    let long = alert(&mut node, NOT_SET, (Severity::Error, &"x".repeat(200)));
    let data = sent_data(&long, message::ALERT);
    let values = message::ALERT_LAYOUT.values(&data).unwrap();
    assert_eq!(values.bytes(11).map(|it| it[79]), Some(0));
}

#[test]
fn a_line_gives_the_same_requests_with_their_arrival() {
    let mut node = node();
    let stream = bytes(&format!(
        "00ffff{CLOCK_REQUEST}ff{HEARTBEAT_WITH_BIT_15}{DISCOVERY}"
    ));
    let at = |nth: usize| Cycles(50_000_000_000 + 14_583 * nth as u64);
    let now = at(stream.len());
    let mut requests = Vec::new();
    for (nth, &byte) in stream.iter().enumerate() {
        let stamp = at(nth).stamp();
        requests.extend(node.push(StampedByte { stamp, byte }, now));
    }
    let arrivals: Vec<_> = requests.iter().map(|it| it.arrival).collect();
    assert_eq!(arrivals, [at(3), at(35), at(59)]);
    let framing = node.counters().framing;
    assert_eq!((framing.frames, framing.foreign_bytes), (3, 4));
    // A frame without a sum is no frame there, and that is said to all, once.
    for byte in bytes("ffff000600505f01005043013e821e0001c5b612267b") {
        let stamp = now.stamp();
        assert_eq!(node.push(StampedByte { stamp, byte }, now), None);
    }
    assert_eq!(alerts(&mut node).len(), 1);
    // After a silence what has begun is given up.
    assert_eq!(node.poll_timeout(now), Some(now.plus(Node::IDLE)));
    node.handle_timeout(now.plus(Node::IDLE));
    assert_eq!(node.poll_timeout(now), None);
}

#[test]
fn every_message_of_ours_with_every_byte_changes_nothing() {
    let mut node = node();
    let before = second(&mut node, NOT_SET);
    for number in message::OURS.chain([1, 16_002, 17_000, 17_001, 17_002]) {
        for byte in 0..=255 {
            for length in [1, 2, 13, 40] {
                let bytes = frame(number, &[byte; 40][..length]);
                assert!(answers_of(&mut node, &bytes, NOT_SET, NOT_SET).len() <= 2);
            }
        }
        assert!(alerts(&mut node).len() <= 3);
    }
    assert_eq!(second(&mut node, NOT_SET), before);
    for bits in [0, u64::from(u32::MAX)] {
        let asks = data(&message::MESSAGE_INTERVAL_LAYOUT, &[(1, 4_000), (2, bits)]);
        let sent = answers_of(&mut node, &frame(52_003, &asks), NOT_SET, NOT_SET);
        let sent = sent_data(&sent[0], 52_003);
        let values = message::MESSAGE_INTERVAL_LAYOUT.values(&sent).unwrap();
        assert_eq!(values.unsigned(2), Some(1_000));
    }
}
