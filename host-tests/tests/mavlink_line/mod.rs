//! A node on a line at 115200 baud, and the messages on it.

#![allow(
    dead_code,
    clippy::allow_attributes,
    reason = "each test file compiles this module and uses a part of it"
)]

use mavlink_node::client::{Client, Message};
use mavlink_node::{Address, Node, Request, Version};
use timebase::{Cycles, Stamp, StampedByte};

/// The client.
pub const GROUND: Address = Address {
    system: 255,
    component: 190,
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
