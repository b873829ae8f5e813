//! A request that the node hands out, because its answer needs the clock or it changes
//! something.
//!
//! What is only looked up the node asks of [`Parameters`](crate::Parameters) and
//! [`LogFile`](crate::LogFile).

use timebase::Cycles;

use crate::command::Command;
use crate::frame::{Address, Version};

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
