//! The node: which frames ask for something, and what is answered.
//!
//! *Purpose.* [`Node::receive`] turns bytes into [`Request`]s, [`Node::answer`]
//! turns a request and the time of its arrival into the frame to send.
//!
//! *Design.* In two steps, because between them the caller reads the clock at
//! [`Request::arrival`]. A PING is a request when its target system is 0: the
//! component is not looked at, since pymavlink's own is 0. A PING with a target is
//! an answer, whoever it is for, and answering one would make loops. A TIMESYNC is
//! a request when `tc1` is 0 and it is for us or for everybody. A command to us is
//! answered with UNSUPPORTED, from its raw payload, so that a number which no
//! enum knows is answered too. Each answer is in the version of its request.
//!
//! *Limits.* A command to system 0 (everybody) is nobody's to refuse: it is not
//! answered.

use mavlink::MavlinkVersion::V2;
use mavlink::MessageData;
use mavlink::dialects::common::{
    COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MavResult, TIMESYNC_DATA,
};
use timebase::{CORE_HZ, Cycles, StampedByte};

use crate::frame::{Address, Frame, Sender, Version};
use crate::framer::{Delimited, Framer, FramingCounters, Kind, Wanted};
use crate::ping::Ping;

/// How a node behaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Our system, 1 to 255.
    pub system_id: u8,
    /// Our component; 1 (autopilot) is what ground stations look for.
    pub component_id: u8,
    /// What the answer to a PING carries.
    pub ping_reply: PingReply,
}

impl Default for Config {
    /// System 1, component 1, answers with the node's time.
    fn default() -> Self {
        Self {
            system_id: 1,
            component_id: 1,
            ping_reply: PingReply::RtosTime,
        }
    }
}

/// What the `time_usec` of an answer to a PING is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PingReply {
    /// The node's time at which the request's first byte arrived, in µs of UTC;
    /// since boot until the clock is set.
    #[default]
    RtosTime,
    /// The `time_usec` of the request, as the MAVLink guide describes it.
    Echo,
}

/// The node's time at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeTime {
    /// Time since boot, in µs.
    pub boot_us: u64,
    /// UTC in ns since 1970, once the clock is set.
    pub utc_ns: Option<i64>,
}

impl NodeTime {
    /// UTC in µs; 0 until the clock is set.
    #[must_use]
    pub fn utc_us(self) -> u64 {
        per_thousand(u64::try_from(self.utc_ns.unwrap_or(0)).unwrap_or(0))
    }

    /// UTC in µs; since boot until the clock is set.
    #[must_use]
    pub fn rtos_us(self) -> u64 {
        match self.utc_ns {
            Some(_) => self.utc_us(),
            None => self.boot_us,
        }
    }

    /// UTC in ns; since boot until the clock is set. Never 0, which in a
    /// TIMESYNC would mean a request.
    #[must_use]
    pub fn rtos_ns(self) -> i64 {
        let since_boot = || i64::try_from(self.boot_us.saturating_mul(1_000)).unwrap_or(i64::MAX);
        match self.utc_ns.unwrap_or_else(since_boot) {
            0 => 1,
            ns => ns,
        }
    }

    /// Time since boot, in ms, modulo 2^32.
    #[must_use]
    pub fn boot_ms(self) -> u32 {
        per_thousand(self.boot_us) as u32
    }
}

/// A thousandth, rounded down: long division by digits of 16 bits, because a
/// division of 64 bits is a library call of hundreds of instructions here.
fn per_thousand(n: u64) -> u64 {
    let (mut quotient, mut rest) = (0, 0);
    for shift in [48, 32, 16, 0] {
        let part = (rest << 16) | ((n >> shift) as u32 & 0xffff);
        quotient = (quotient << 16) | u64::from(part / 1_000);
        rest = part % 1_000;
    }
    quotient
}

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
    pub ask: Ask,
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
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
    /// COMMAND_LONG or COMMAND_INT.
    Command {
        /// MAV_CMD, whether known or not.
        number: u16,
    },
}

/// What a node has heard, by kind. All wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// PINGs handed out to be answered.
    pub pings: u32,
    /// TIMESYNCs handed out to be answered.
    pub timesyncs: u32,
    /// Commands handed out to be refused.
    pub commands: u32,
    /// Answers to a PING or a TIMESYNC, whoever they are for: never answered.
    pub answers: u32,
    /// TIMESYNCs and commands to somebody else.
    pub for_others: u32,
    /// What the framing met.
    pub framing: FramingCounters,
}

/// The kinds that a node listens to.
#[derive(Debug)]
pub struct Requests;

/// How much later than `now` a byte may be stamped, in cycles: 1 s.
const AFTER_NOW: u64 = CORE_HZ as u64;

/// Command number, target system and target component stand at the same place in
/// COMMAND_LONG and COMMAND_INT, behind seven words of parameters.
const COMMAND_NUMBER: usize = 28;
const COMMAND_TARGET: usize = 30;

impl Wanted for Requests {
    // A command whose target is left out as a zero is not for us.
    const KINDS: &'static [Kind] = &[
        Ping::KIND,
        Kind::of::<TIMESYNC_DATA>(16, 1),
        Kind::of::<COMMAND_LONG_DATA>(33, COMMAND_TARGET as u8 + 1),
        Kind::of::<COMMAND_INT_DATA>(35, COMMAND_TARGET as u8 + 1),
    ];
}

/// A MAVLink endpoint on one line.
#[derive(Debug)]
pub struct Node {
    framer: Framer<Requests>,
    pub(crate) sender: Sender,
    ping_reply: PingReply,
    /// The version in which the node speaks unasked.
    pub(crate) version: Version,
    counters: Counters,
}

impl Node {
    /// A node that has heard and sent nothing.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self {
            framer: Framer::new(),
            sender: Sender::new(Address {
                system: config.system_id,
                component: config.component_id,
            }),
            ping_reply: config.ping_reply,
            version: Version::V1,
            counters: Counters {
                pings: 0,
                timesyncs: 0,
                commands: 0,
                answers: 0,
                for_others: 0,
                framing: FramingCounters::ZERO,
            },
        }
    }

    /// What has been heard so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        Counters {
            framing: self.framer.counters(),
            ..self.counters
        }
    }

    /// HEARTBEAT's other duty, see [`Framer::give_up_if_silent`].
    pub(crate) fn give_up_if_silent(&mut self) {
        self.framer.give_up_if_silent();
    }

    /// Takes a byte that was stamped at most 24 s before `now`, or up to 1 s after it
    /// (while the queue was emptied for which `now` was read). A request is to be
    /// answered with [`Self::answer`]; where there is no room for an answer, it
    /// may be dropped.
    #[inline]
    pub fn receive(&mut self, byte: StampedByte, now: Cycles) -> Option<Request> {
        match self.framer.push(byte) {
            0 => None,
            length => self.request(length, now),
        }
    }

    #[inline(never)]
    fn request(&mut self, length: u8, now: Cycles) -> Option<Request> {
        let frame = self.framer.take(length);
        if frame.version == Version::V2 {
            self.version = Version::V2;
        }
        Some(Request {
            arrival: frame.stamp.extend(now.plus(AFTER_NOW)),
            from: frame.from,
            version: frame.version,
            ask: self.ask(&frame)?,
        })
    }

    fn ask(&mut self, frame: &Delimited) -> Option<Ask> {
        let counters = &mut self.counters;
        let us = self.sender.address();
        let (ask, count) = match u32::from(frame.id) {
            Ping::ID => {
                let ping = Ping::parse(&frame.payload)?;
                let ask = Ask::Ping {
                    time_usec: ping.time_usec,
                    seq: ping.seq,
                };
                match ping.target.system {
                    0 => (Some(ask), &mut counters.pings),
                    _ => (None, &mut counters.answers),
                }
            }
            TIMESYNC_DATA::ID => {
                let sync = TIMESYNC_DATA::deser(V2, &frame.payload).ok()?;
                let for_us = (sync.target_system == 0 || sync.target_system == us.system)
                    && (sync.target_component == 0 || sync.target_component == us.component);
                match (sync.tc1, for_us) {
                    (0, true) => (
                        Some(Ask::TimeSync { ts1: sync.ts1 }),
                        &mut counters.timesyncs,
                    ),
                    (0, false) => (None, &mut counters.for_others),
                    _ => (None, &mut counters.answers),
                }
            }
            _ => {
                let [low, high, system, component] =
                    *frame.payload.get(COMMAND_NUMBER..)?.first_chunk()?;
                let number = u16::from_le_bytes([low, high]);
                if system == us.system && (component == 0 || component == us.component) {
                    (Some(Ask::Command { number }), &mut counters.commands)
                } else {
                    (None, &mut counters.for_others)
                }
            }
        };
        *count = count.wrapping_add(1);
        ask
    }

    /// The answer to `request`; `time` is the node's time at its arrival.
    #[inline(never)]
    pub fn answer(&mut self, request: &Request, time: NodeTime) -> Frame {
        let Request { from, version, .. } = *request;
        match request.ask {
            Ask::Ping { time_usec, seq } => Ping {
                time_usec: match self.ping_reply {
                    PingReply::RtosTime => time.rtos_us(),
                    PingReply::Echo => time_usec,
                },
                seq,
                target: from,
            }
            .frame(&mut self.sender, version),
            Ask::TimeSync { ts1 } => {
                let answer = TIMESYNC_DATA {
                    tc1: time.rtos_ns(),
                    ts1,
                    target_system: from.system,
                    target_component: from.component,
                };
                self.sender.message(version, &answer)
            }
            Ask::Command { number } => self.refuse(version, from, number),
        }
    }

    /// COMMAND_ACK UNSUPPORTED. Built by hand, because the type in `mavlink` can
    /// only name the commands that it knows.
    fn refuse(&mut self, version: Version, from: Address, number: u16) -> Frame {
        let (id, crc_extra) = (COMMAND_ACK_DATA::ID as u8, COMMAND_ACK_DATA::EXTRA_CRC);
        let [low, high] = number.to_le_bytes();
        let result = MavResult::MAV_RESULT_UNSUPPORTED as u8;
        // u16 command, u8 result; extensions: u8 progress, i32 result_param2,
        // u8 target_system, u8 target_component.
        let ack = [
            low,
            high,
            result,
            0,
            0,
            0,
            0,
            0,
            from.system,
            from.component,
        ];
        self.sender.frame(version, id, crc_extra, |payload| {
            let (room, _) = payload.split_at_mut(ack.len());
            room.copy_from_slice(&ack);
            match version {
                Version::V1 => 3,
                // Trailing zeros are left out.
                Version::V2 => ack
                    .iter()
                    .rposition(|&byte| byte != 0)
                    .map_or(1, |last| last + 1),
            }
        })
    }
}
