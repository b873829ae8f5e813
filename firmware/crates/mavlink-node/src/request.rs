//! What somebody asks of a node, and where the node finds the answer.
//!
//! *Purpose.* The values between a node and whoever runs it.
//!
//! *Design.* A [`Request`] needs the clock, or changes something: it is handed out.
//! What is only looked up (parameters, the log) the node asks of its [`Holdings`].
//!
//! *Limits.* None.

use timebase::Cycles;

use crate::command::Command;
use crate::frame::{Address, Version};
use crate::parameter::Parameter;

/// Somebody asks something of this node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// When the first byte of the frame had arrived.
    pub arrival: Cycles,
    /// Who asks.
    pub from: Address,
    /// In which version, hence in which the answer goes out.
    pub version: Version,
    /// What is asked.
    pub ask: RequestKind,
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestKind {
    /// PING: the node's time.
    Ping {
        /// The request's time, in µs of the sender's own clock.
        time_usec: u64,
        /// Its number, which the answer keeps.
        seq: u32,
    },
    /// TIMESYNC: the node's time between two of the sender's.
    TimeSync {
        /// The sender's time, in ns of its own clock; returned bit for bit.
        ts1: i64,
    },
    /// COMMAND_LONG or COMMAND_INT: a test begins or ends, or a refusal. A test is to
    /// begin or end before this is answered.
    Command(Command),
    /// LOG_ERASE: the log is to be cleared before this is answered.
    EraseLog,
}

/// Where a node finds what it is asked for.
pub trait Holdings {
    /// The value of a parameter.
    fn parameter(&self, parameter: Parameter) -> f32;

    /// The length of the log's file, in bytes.
    fn log_len(&self) -> u32;

    /// When the log was begun, in ns of UTC since 1970, if it was and that is known.
    fn log_began_ns(&self) -> Option<i64>;

    /// Fills `out` with the log's file from `offset` on. The number of bytes: fewer
    /// than there is room for at its end.
    fn read_log(&self, offset: u32, out: &mut [u8]) -> usize;
}
