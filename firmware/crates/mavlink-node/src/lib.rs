//! The MAVLink endpoint: it hears requests for the time and says what to answer.
//!
//! *Purpose.* MAVLink 1 and 2 on one serial line: PING and TIMESYNC answered, a test
//! begun and ended, other commands refused politely, read-only parameters and a log
//! served, HEARTBEAT, SYSTEM_TIME and GPS_RAW_INT told.
//!
//! *Design.* A state machine without I/O and without a clock. [`framer`] finds
//! the frames of a few wanted kinds in any stream of bytes, at a cost that no
//! stream can raise; [`crc`] is the arithmetic that makes this possible.
//! [`node`] turns a frame into a [`Request`], which carries the arrival of the
//! frame's first byte, and a request with the [`NodeTime`] of that moment into
//! the [`Frame`] to send; [`parameter`] and the log's transfer keep what is still to be
//! sent of an answer of many frames. What is sent without being asked is made by [`Node::heartbeat`] and its neighbours.
//! [`client`] is the other end of the line, for the tools on a host. The crate
//! `mavlink` parses and builds payloads; none of its types is in the interface.
//!
//! *Limits.* One node a line. Signatures are not checked: the time is no
//! secret, and signed requests are answered unsigned, as the C library does
//! when it has no key. Missions and files are not served; there is one log, and no parameter can be set.
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
pub mod crc;
pub mod frame;
pub mod framer;
mod log_transfer;
pub mod node;
mod node_time;
pub mod parameter;
mod ping;
mod request;
mod severity;

pub use command::{Command, Refusal};
pub use frame::{Address, Frame, Version};
pub use log_transfer::{LOG_DATA_LEN, LogFile};
pub use node::{Config, Counters, Node, PingReply};
pub use node_time::NodeTime;
pub use parameter::{Parameter, Parameters};
pub use request::{Request, RequestKind};
pub use sample_log::Test;
pub use severity::Severity;
pub use timebase::Fix;
