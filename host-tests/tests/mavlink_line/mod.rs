//! A node on a line at 115200 baud, the board behind it, and the messages between.

#![allow(
    dead_code,
    clippy::allow_attributes,
    reason = "each test file compiles this module and uses a part of it"
)]

use mavlink_node::client::{Client, Message};
use mavlink_node::{
    Address, Config, LogFile, Node, NodeTime, Parameter, Parameters, Request, StatusLine,
    StatusWriter, Version,
};
use timebase::{Cycles, Stamp, StampedByte};

/// The client.
pub const GROUND: Address = Address {
    system: 255,
    component: 190,
};

/// The node's address.
pub const US: Address = Address {
    system: 1,
    component: 1,
};

/// 2026-11-22 04:00:00.123456789 UTC, 90 s after boot.
pub const TIME: NodeTime = NodeTime {
    boot: Cycles::from_micros(90_000_001),
    utc_ns: Some(1_795_320_000_123_456_789),
};

/// Cycles from a byte to the next at 115200 baud.
pub const BYTE: u32 = 14_583;

/// Feeds bytes at line rate, the first one at `at`; each is handed over 300 µs late.
pub fn feed(node: &mut Node, at: u64, bytes: &[u8]) -> Vec<Request> {
    let arrivals = (0..).map(|nth: u64| at + nth * u64::from(BYTE));
    arrivals
        .zip(bytes)
        .filter_map(|(arrival, &byte)| {
            let stamp = Stamp(arrival as u32);
            node.push(StampedByte { stamp, byte }, Cycles(arrival + 50_400))
        })
        .collect()
}

/// The only request in `bytes`.
pub fn ask(node: &mut Node, bytes: &[u8]) -> Request {
    let requests = feed(node, 1 << 40, bytes);
    assert_eq!(requests.len(), 1, "{bytes:02x?}");
    requests[0]
}

/// The message in a node's frame.
pub fn parsed(frame: &[u8]) -> Option<Message> {
    let mut client = Client::new(GROUND, Version::V2);
    let stamp = Stamp(0);
    let mut received = frame
        .iter()
        .filter_map(|&byte| client.push(StampedByte { stamp, byte }));
    received.next().map(|received| received.message)
}

/// A log of these bytes, and parameters whose value is their index and a half.
pub struct Board(pub Vec<u8>);

impl Board {
    /// A log of `len` bytes.
    pub fn of(len: usize) -> Self {
        Self((0..len).map(|n| (n % 251) as u8).collect())
    }
}

impl Parameters for Board {
    fn parameter(&self, parameter: Parameter) -> f32 {
        f32::from(parameter.index()) + 0.5
    }
}

impl LogFile for Board {
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

impl StatusLine for Board {
    /// As many counters as the log has bytes, 0 for each third.
    fn write_status(&self, line: &mut StatusWriter<'_>) {
        line.word("state", "set");
        line.padded("utc", &[(0, 2026, 4), (b'-', 1, 2), (b'T', 7, 2)], b'Z');
        line.unsigned("unc_ns", u64::MAX);
        line.number("ppb", -120);
        line.word("card", "");
        line.word("why", "no card");
        for (nth, &byte) in self.0.iter().enumerate() {
            line.count_of(
                "counter",
                &nth.to_string(),
                u32::from(byte) % 3 * 1_000_000_007,
            );
        }
    }
}

/// A node, system 1, component 1.
pub fn node() -> Node {
    Node::new(Config::default())
}

/// Every message that the node has to send.
pub fn polled(node: &mut Node, board: &Board) -> Vec<Message> {
    let frames = std::iter::from_fn(|| node.poll(board));
    let messages = frames.map(|frame| parsed(&frame).expect("a frame that a client understands"));
    // More than any log here takes.
    let messages: Vec<_> = messages.take(5_000).collect();
    assert!(!node.has_more());
    messages
}

/// Sends requests that are noted and not handed out.
pub fn note(node: &mut Node, bytes: &[u8]) {
    assert_eq!(feed(node, 0, bytes), []);
}
