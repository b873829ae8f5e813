//! The payload of a PING, the same in a request and in an answer.
//!
//! The type of `mavlink` is marked as deprecated, since the MAVLink guide prefers TIMESYNC, so it
//! is named in this file only.
#![expect(deprecated, reason = "PING is what this project answers")]

use mavlink::dialects::common::PING_DATA;
use mavlink::{MavlinkVersion, MessageData};

use crate::frame::{Address, Frame, Sender, Version};
use crate::kind::Kind;

/// The fields of a PING.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ping {
    /// In a request the sender's time in µs, in an answer the node's.
    pub(crate) time_usec: u64,
    /// The number of the request.
    pub(crate) seq: u32,
    /// The receiver of the answer; with system 0 the PING is a request.
    pub(crate) target: Address,
}

impl Ping {
    pub(crate) const ID: u32 = PING_DATA::ID;
    pub(crate) const KIND: Kind = Kind::of::<PING_DATA>(PING_DATA::ENCODED_LEN as u8, 1);

    /// From a payload, extended with zeros.
    pub(crate) fn parse(payload: &[u8]) -> Option<Self> {
        let ping = PING_DATA::deser(MavlinkVersion::V2, payload).ok()?;
        Some(Self {
            time_usec: ping.time_usec,
            seq: ping.seq,
            target: Address {
                system: ping.target_system,
                component: ping.target_component,
            },
        })
    }

    pub(crate) fn frame(self, sender: &mut Sender, version: Version) -> Frame {
        let ping = PING_DATA {
            time_usec: self.time_usec,
            seq: self.seq,
            target_system: self.target.system,
            target_component: self.target.component,
        };
        sender.message(version, &ping)
    }
}
