//! A MAVLink endpoint that answers with the time at which a request arrived.
//!
//! *Purpose.* MAVLink 1 and 2 on one serial line: PING and TIMESYNC answered, a test begun and
//! ended, other commands refused, read-only parameters and a log served, HEARTBEAT, SYSTEM_TIME,
//! GPS_RAW_INT and values to plot sent. The types that matter:
//!
//! - [`Node`], the endpoint: bytes in, requests out, answers made;
//! - [`Request`], which has the arrival of its first byte, and [`NodeTime`], the node's time then;
//! - [`client::Client`], the other end of the line, for tools on a host.
//!
//! *Design.* A state machine without I/O and without a clock. [`framer`] finds the frames of a few
//! wanted kinds in any stream of bytes, at a cost that no stream can raise. The crate `mavlink`
//! parses and builds payloads; none of its types is in the interface.
//!
//! *Limits.* One node a line. Signatures are not checked: the time is no secret, and signed
//! requests are answered unsigned, as the C library does when it has no key. There are no missions
//! and no files, which is said to who asks; there is one log, and beside it the status as a log that
//! is not listed; no parameter can be set.
//!
//! ```
//! use mavlink_node::client::{Client, GROUND_STATION, Message};
//! use mavlink_node::{Config, Node, NodeTime, Version};
//! use timebase::{Cycles, StampedByte};
//!
//! let mut node = Node::new(Config::default());
//! let mut client = Client::new(GROUND_STATION, Version::V2);
//! // A byte each 87 µs, as on a line at 115200 baud.
//! let arrival = |nth: usize| Cycles(1_000_000 + 14_583 * nth as u64);
//! let stamped = |(nth, &byte)| StampedByte { stamp: arrival(nth).stamp(), byte };
//!
//! let ping = client.ping(1_000, 7);
//! let now = arrival(ping.len());
//! let mut bytes = ping.iter().enumerate().map(stamped);
//! let request = bytes.find_map(|byte| node.push(byte, now)).expect("a request");
//! // The caller reads its clock at the arrival of the first byte, not now.
//! assert_eq!(request.arrival, arrival(0));
//! let time = NodeTime {
//!     boot: request.arrival,
//!     utc_ns: Some(1_795_320_000_123_456_789),
//! };
//!
//! let answer = node.answer(&request, time);
//! let mut bytes = answer.iter().enumerate().map(stamped);
//! let received = bytes.find_map(|byte| client.push(byte)).expect("an answer");
//! let time_usec = 1_795_320_000_123_456;
//! let expected = Message::Ping { time_usec, seq: 7, target: GROUND_STATION };
//! assert_eq!(received.message, expected);
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod broadcast;
pub mod client;
mod command;
mod crc;
mod frame;
pub mod framer;
mod kind;
mod log_transfer;
pub mod node;
mod parameter;
mod ping;
mod plotted;
mod replies;
mod request;
mod severity;
mod status_transfer;
mod wanted;

pub use broadcast::last_words;
pub use command::{Command, Order, Refusal};
pub use frame::{Address, Frame, Version};
pub use kind::{Kind, Wanted};
pub use log_transfer::{LOG_DATA_LEN, LogFile};
pub use node::{Config, Counters, Node, PingReply};
pub use node_values::{Name, NodeTime, Parameter, Parameters, Severity, Text, difference};
pub use plotted::Plotted;
pub use replies::Described;
pub use request::{Request, RequestKind};
pub use sample_log::Test;
pub use status_transfer::{StatusLine, StatusWriter};
pub use timebase::Fix;
pub use wanted::Requests;
