//! The other end of the line: asks a node for its time and understands it.
//!
//! *Purpose.* For tools and tests on a host; the firmware does not use it.
//!
//! *Design.* The node's framer with other kinds wanted, the node's way to build
//! a frame.
//!
//! *Limits.* It has no clock: whoever sends and receives notes the moments.

use mavlink::MavlinkVersion::V2;
use mavlink::MessageData;
use mavlink::dialects::common::{HEARTBEAT_DATA, SYSTEM_TIME_DATA, TIMESYNC_DATA};
use timebase::StampedByte;

use crate::frame::{Address, Frame, Sender, Version};
use crate::framer::{Framer, FramingCounters, Kind, Wanted};
use crate::ping::Ping;

/// Something that a node said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// Who said it.
    pub from: Address,
    /// In which version.
    pub version: Version,
    /// What it said.
    pub what: What,
}

/// What a node said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// It is there.
    Heartbeat,
    /// Its time, unasked.
    SystemTime {
        /// UTC in µs since 1970; 0 while the node does not know it.
        time_unix_usec: u64,
        /// Time since boot, in ms.
        time_boot_ms: u32,
    },
    /// Its answer to a PING.
    Ping {
        /// The node's time, in µs: of UTC, or since boot while it is not set.
        time_usec: u64,
        /// The number of the request.
        seq: u32,
        /// Whom the answer is for.
        target: Address,
    },
    /// Its answer to a TIMESYNC.
    TimeSync {
        /// The node's time, in ns.
        tc1: i64,
        /// The request's own time.
        ts1: i64,
    },
}

/// The kinds that a client listens to.
#[derive(Debug)]
struct Answers;

impl Wanted for Answers {
    const KINDS: &'static [Kind] = &[
        Kind::of::<HEARTBEAT_DATA>(9, 1),
        Kind::of::<SYSTEM_TIME_DATA>(12, 1),
        Ping::KIND,
        Kind::of::<TIMESYNC_DATA>(16, 1),
    ];
}

/// Asks, and understands what is said.
#[derive(Debug)]
pub struct Client {
    framer: Framer<Answers>,
    sender: Sender,
    version: Version,
}

impl Client {
    /// A client that speaks `version` as `address`.
    #[must_use]
    pub const fn new(address: Address, version: Version) -> Self {
        Self {
            framer: Framer::new(),
            sender: Sender::new(address),
            version,
        }
    }

    /// A request for the time, to everybody. `time_usec` is the client's own time
    /// in µs.
    pub fn ping(&mut self, time_usec: u64, seq: u32) -> Frame {
        Ping {
            time_usec,
            seq,
            target: Address {
                system: 0,
                component: 0,
            },
        }
        .frame(&mut self.sender, self.version)
    }

    /// A request for the time, to everybody. `ts1` is the client's own time in ns.
    pub fn timesync(&mut self, ts1: i64) -> Frame {
        let request = TIMESYNC_DATA {
            ts1,
            ..TIMESYNC_DATA::DEFAULT
        };
        self.sender.message(self.version, &request)
    }

    /// Takes a byte.
    pub fn receive(&mut self, byte: StampedByte) -> Option<Heard> {
        let frame = match self.framer.push(byte) {
            0 => return None,
            length => self.framer.take(length),
        };
        let what = match u32::from(frame.id) {
            HEARTBEAT_DATA::ID => What::Heartbeat,
            SYSTEM_TIME_DATA::ID => {
                let time = SYSTEM_TIME_DATA::deser(V2, &frame.payload).ok()?;
                What::SystemTime {
                    time_unix_usec: time.time_unix_usec,
                    time_boot_ms: time.time_boot_ms,
                }
            }
            TIMESYNC_DATA::ID => {
                let sync = TIMESYNC_DATA::deser(V2, &frame.payload).ok()?;
                What::TimeSync {
                    tc1: sync.tc1,
                    ts1: sync.ts1,
                }
            }
            _ => {
                let Ping {
                    time_usec,
                    seq,
                    target,
                } = Ping::parse(&frame)?;
                What::Ping {
                    time_usec,
                    seq,
                    target,
                }
            }
        };
        Some(Heard {
            from: frame.from,
            version: frame.version,
            what,
        })
    }

    /// What the framing met.
    #[must_use]
    pub const fn counters(&self) -> FramingCounters {
        self.framer.counters()
    }
}
