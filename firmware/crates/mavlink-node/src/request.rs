//! A request that the node hands out, because its answer needs the clock or it changes
//! something.
//!
//! What is only looked up, the node reads from [`Parameters`](crate::Parameters) and
//! [`LogFile`](crate::LogFile) by itself.

use timebase::Cycles;

use crate::command::Command;
use crate::frame::{Address, Version};

/// A client asks something of this node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// When the first byte of the frame had arrived.
    pub arrival: Cycles,
    /// The client.
    pub from: Address,
    /// The version of its frame, and so of the answer.
    pub version: Version,
    /// What it asks for.
    pub kind: RequestKind,
}

/// What a client asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestKind {
    /// PING: the node's time.
    Ping {
        /// The request's time, in µs of the sender's own clock.
        time_usec: u64,
        /// Its number, which the answer keeps.
        seq: u32,
    },
    /// TIMESYNC: the node's time, to be compared with the sender's.
    TimeSync {
        /// The sender's time, in ns of its own clock; returned bit for bit.
        ts1: i64,
    },
    /// COMMAND_LONG or COMMAND_INT: a test begins or ends, a message is asked for, or the command is
    /// refused. The test has to begin or end before this is answered.
    Command(Command),
    /// LOG_ERASE: the log has to be cleared before this is answered.
    EraseLog,
}
