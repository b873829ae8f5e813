//! The node: which frames ask for something, and how they are answered.
//!
//! *Purpose.* [`Node::push`] turns bytes into [`Request`]s; [`Node::answer`] turns a request and
//! the time of its arrival into the frame to send. What takes more than one frame (parameters, the
//! log) is sent piece by piece: [`Node::poll`].
//!
//! *Design.* In two steps, because between them the caller reads the clock at
//! [`Request::arrival`], and does what the request wants to have changed. Requests for parameters
//! and for the log are noted and not handed out: they cost no more than that, at any rate, and
//! `poll` returns their frames when the caller has room on the line.
//!
//! Each answer is in the version of its request.
//!
//! - A PING is a request when its target system is 0. The component is not looked at, since
//!   pymavlink's own is 0. A PING with a target is an answer, and answering it would make loops.
//! - A TIMESYNC is a request when `tc1` is 0 and it is for us or for all.
//! - A command to us is obeyed or refused, see [`Command`].
//!
//! What changes something (commands, PARAM_SET, the transfer of the log and its erasing) is obeyed only
//! outside of what an earlier header claims: [`framer`](crate::framer).
//!
//! *Limits.* Everything but PING and TIMESYNC must name our system: a command to system 0 (all) is
//! not refused, because no single node is meant. Who calls itself system 0 is nobody, and is not
//! answered: an answer to 0 would be a request to all.

use mavlink::MavlinkVersion::V2;
use mavlink::MessageData;
use mavlink::dialects::common::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, LOG_REQUEST_DATA_DATA,
    LOG_REQUEST_END_DATA, LOG_REQUEST_LIST_DATA, MISSION_REQUEST_LIST_DATA,
    PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, TIMESYNC_DATA,
};
use node_values::{Name, NodeTime, Parameter, Parameters, Severity};
use sample_log::Test;
use timebase::{CORE_HZ, Cycles, Stamp, StampedByte};

use crate::command::{Command, Order, Refusal};
use crate::frame::{Address, Frame, Sender, Version};
use crate::framer::{Delimited, Framer, FramingCounters};
use crate::log_transfer::{LOG_ID, LogFile, LogTransfer};
use crate::parameter::PendingParameters;
use crate::ping::Ping;
use crate::replies::{FailedParameter, FileAsked, MissionAsked, ParameterError, PendingReplies};
use crate::request::{Request, RequestKind};
use crate::status_transfer::{STATUS_ID, StatusLine, StatusTransfer};
use crate::wanted::{Requests, target_at};

/// How a node behaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Our system, 1 to 255.
    pub system_id: u8,
    /// Our component; 1 (autopilot) is what ground stations look for.
    pub component_id: u8,
    /// What the answer to a PING carries.
    pub ping_reply: PingReply,
    /// The chip's unique number, in the order of its bytes; zeros where there is none.
    pub unique_id: [u8; 12],
}

impl Default for Config {
    /// System 1, component 1, answers with the node's time, no unique number.
    fn default() -> Self {
        Self {
            system_id: 1,
            component_id: 1,
            ping_reply: PingReply::RtosTime,
            unique_id: [0; 12],
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

/// What a node has received, by kind. All wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// PING requests, handed out to be answered.
    pub pings: u32,
    /// TIMESYNC requests, handed out to be answered.
    pub timesyncs: u32,
    /// Commands to us, handed out.
    pub commands: u32,
    /// Requests for parameters.
    pub parameters: u32,
    /// Requests about the log.
    pub logs: u32,
    /// Requests for missions and files, of which there are none.
    pub missing: u32,
    /// Those of the above that name a parameter or a log that is not there.
    pub unknown: u32,
    /// Answers to a PING or a TIMESYNC of any system: never answered.
    pub answers: u32,
    /// TIMESYNCs, commands and requests to another system or component.
    pub for_others: u32,
    /// Frames of system 0: never answered.
    pub from_nobody: u32,
    /// What the framer found.
    pub framing: FramingCounters,
}

/// How much later than `now` a byte may be stamped, in cycles: 1 s.
const AFTER_NOW: u64 = CORE_HZ as u64;

/// The offsets of the names in PARAM_REQUEST_READ and PARAM_SET, in bytes.
const READ_NAME: usize = 4;
const SET_NAME: usize = 6;

/// The offset of the type in a MISSION_REQUEST_LIST, in bytes.
const MISSION_TYPE: usize = 2;

/// A MAVLink endpoint on one line.
#[derive(Debug)]
pub struct Node {
    framer: Framer<Requests>,
    pub(crate) sender: Sender,
    ping_reply: PingReply,
    /// The version of broadcasts, see [`broadcast`](crate::broadcast).
    pub(crate) version: Version,
    parameters: PendingParameters,
    log: LogTransfer,
    status: StatusTransfer,
    pub(crate) replies: PendingReplies,
    counters: Counters,
}

impl Node {
    /// A line that has been silent for this long, in cycles, is between frames: 1 s. No host pauses
    /// for that long inside one.
    pub const IDLE: u64 = CORE_HZ as u64;

    /// A node that has received and sent nothing.
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
            parameters: PendingParameters::NONE,
            log: LogTransfer::NONE,
            status: StatusTransfer::NONE,
            replies: PendingReplies::new(config.unique_id),
            counters: Counters {
                pings: 0,
                timesyncs: 0,
                commands: 0,
                parameters: 0,
                logs: 0,
                missing: 0,
                unknown: 0,
                answers: 0,
                for_others: 0,
                from_nobody: 0,
                framing: FramingCounters::ZERO,
            },
        }
    }

    /// What has been received so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        Counters {
            framing: self.framer.counters(),
            ..self.counters
        }
    }

    /// When to call [`Self::handle_timeout`] if no byte comes before; `None` while no frame can
    /// have begun. `now` as for [`Self::push`].
    #[must_use]
    pub fn poll_timeout(&self, now: Cycles) -> Option<Cycles> {
        let newest = self.framer.newest()?.extend(now.plus(AFTER_NOW));
        Some(newest.plus(Self::IDLE))
    }

    /// Gives up a frame that has begun, if the line has been silent for [`Self::IDLE`]; otherwise
    /// does nothing. The call may be up to 20 s late: after that the stamps are ambiguous.
    pub fn handle_timeout(&mut self, now: Cycles) {
        if self.poll_timeout(now).is_some_and(|due| now >= due) {
            self.framer.give_up();
        }
    }

    /// Takes a byte that was stamped at most 24 s before `now`, or up to 1 s after it (bytes may
    /// come while a queue is emptied, for which `now` was read once). A request is to be answered
    /// with [`Self::answer`], or dropped where there is no room for an answer. After each call
    /// [`Self::poll`] may have something to send.
    #[inline(always)]
    pub fn push(&mut self, byte: StampedByte, now: Cycles) -> Option<Request> {
        match self.framer.push(byte) {
            0 => None,
            length => self.request(length, now),
        }
    }

    /// Takes bytes as [`Self::push`] does, up to the one that ends a request, and leaves the rest of them in
    /// `bytes`.
    #[inline(never)] // A loop of its own, built for speed whatever its caller is built for.
    pub fn push_bytes(&mut self, bytes: &mut &[StampedByte], now: Cycles) -> Option<Request> {
        while let Some((&byte, rest)) = bytes.split_first() {
            *bytes = rest;
            let request = self.push(byte, now);
            if request.is_some() {
                return request;
            }
        }
        None
    }

    /// Takes bytes with one stamp as [`Self::push_bytes`] does.
    #[inline(never)]
    pub fn push_packet(&mut self, bytes: &mut &[u8], stamp: Stamp, now: Cycles) -> Option<Request> {
        while let Some((&byte, rest)) = bytes.split_first() {
            *bytes = rest;
            let request = self.push(StampedByte { stamp, byte }, now);
            if request.is_some() {
                return request;
            }
        }
        None
    }

    #[inline(never)]
    fn request(&mut self, length: u16, now: Cycles) -> Option<Request> {
        let frame = self.framer.take(length);
        if frame.from.system == 0 {
            self.counters.from_nobody = self.counters.from_nobody.wrapping_add(1);
            return None;
        }
        if frame.version == Version::V2 {
            self.version = Version::V2;
        }
        Some(Request {
            arrival: frame.stamp.extend(now.plus(AFTER_NOW)),
            from: frame.from,
            version: frame.version,
            kind: self.kind(&frame)?,
        })
    }

    fn kind(&mut self, frame: &Delimited) -> Option<RequestKind> {
        let counters = &mut self.counters;
        let us = self.sender.address();
        let (kind, count) = match u32::from(frame.id) {
            Ping::ID => {
                let ping = Ping::parse(&frame.payload)?;
                let request = RequestKind::Ping {
                    time_usec: ping.time_usec,
                    seq: ping.seq,
                };
                match ping.target.system {
                    0 => (Some(request), &mut counters.pings),
                    _ => (None, &mut counters.answers),
                }
            }
            TIMESYNC_DATA::ID => {
                let sync = TIMESYNC_DATA::deser(V2, &frame.payload).ok()?;
                let for_us = (sync.target_system == 0 || sync.target_system == us.system)
                    && (sync.target_component == 0 || sync.target_component == us.component);
                match (sync.tc1, for_us) {
                    (0, true) => (
                        Some(RequestKind::TimeSync { ts1: sync.ts1 }),
                        &mut counters.timesyncs,
                    ),
                    (0, false) => (None, &mut counters.for_others),
                    _ => (None, &mut counters.answers),
                }
            }
            _ => return self.targeted(frame),
        };
        *count = count.wrapping_add(1);
        kind
    }

    /// A request that names its target.
    #[inline(never)]
    fn targeted(&mut self, frame: &Delimited) -> Option<RequestKind> {
        let (payload, version, id) = (&frame.payload, frame.version, u32::from(frame.id));
        let us = self.sender.address();
        let counters = &mut self.counters;
        let [system, component] = *payload.get(target_at(id)..)?.first_chunk()?;
        if system != us.system || (component != 0 && component != us.component) {
            counters.for_others = counters.for_others.wrapping_add(1);
            return None;
        }
        let count = match id {
            COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => &mut counters.commands,
            PARAM_REQUEST_LIST_DATA::ID | PARAM_REQUEST_READ_DATA::ID | PARAM_SET_DATA::ID => {
                &mut counters.parameters
            }
            MISSION_REQUEST_LIST_DATA::ID | FILE_TRANSFER_PROTOCOL_DATA::ID => {
                &mut counters.missing
            }
            _ => &mut counters.logs,
        };
        *count = count.wrapping_add(1);
        match id {
            COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => {
                let mut command = Command::parse(payload)?;
                match command.meaning {
                    Ok(Order::Describe(what)) if !self.replies.is_known(what) => {
                        command.meaning = Err(Refusal::NotYet);
                    }
                    Ok(Order::Describe(what)) => self.replies.want(what, version),
                    Ok(Order::Test(_) | Order::Bootloader) | Err(_) => {}
                }
                return Some(RequestKind::Command(command));
            }
            PARAM_REQUEST_LIST_DATA::ID => self.parameters.all(version),
            PARAM_REQUEST_READ_DATA::ID | PARAM_SET_DATA::ID => {
                self.one_parameter(id, frame);
            }
            MISSION_REQUEST_LIST_DATA::ID => {
                self.replies.mission = Some(MissionAsked {
                    to: frame.from,
                    version,
                    mission_type: payload.get(MISSION_TYPE).copied().unwrap_or(0),
                });
            }
            FILE_TRANSFER_PROTOCOL_DATA::ID => {
                if let Some(asked) = FileAsked::parse(frame.from, payload) {
                    self.replies.file = Some(asked);
                }
            }
            LOG_REQUEST_LIST_DATA::ID => self.log.want_entry(version),
            LOG_REQUEST_DATA_DATA::ID => {
                let request = LOG_REQUEST_DATA_DATA::deser(V2, payload).ok()?;
                match request.id {
                    LOG_ID => self.log.want(version, request.ofs, request.count),
                    STATUS_ID if request.ofs == 0 => self.status.want(version),
                    _ => counters.unknown = counters.unknown.wrapping_add(1),
                }
            }
            LOG_REQUEST_END_DATA::ID => self.log.end(),
            _ => {
                self.log.end();
                return Some(RequestKind::EraseLog);
            }
        }
        None
    }

    /// PARAM_REQUEST_READ or PARAM_SET.
    fn one_parameter(&mut self, id: u32, frame: &Delimited) {
        let payload = &frame.payload;
        let is_set = id == PARAM_SET_DATA::ID;
        let (index, name_at) = match payload.first_chunk() {
            Some(index) if !is_set => (i16::from_le_bytes(*index), READ_NAME),
            _ => (-1, SET_NAME),
        };
        let Some(name) = payload.get(name_at..).and_then(<[u8]>::first_chunk) else {
            return;
        };
        let name = Name::new(*name);
        let parameter = match usize::try_from(index) {
            Ok(index) => Parameter::ALL.get(index).copied(),
            Err(_) => Parameter::named(name),
        };
        let error = match parameter {
            Some(parameter) => {
                self.parameters.one(frame.version, parameter);
                is_set.then_some(ParameterError::ReadOnly)
            }
            None => {
                self.counters.unknown = self.counters.unknown.wrapping_add(1);
                Some(ParameterError::DoesNotExist)
            }
        };
        if let Some(error) = error {
            self.replies.parameter = Some(FailedParameter {
                to: frame.from,
                index,
                name,
                error,
            });
        }
    }

    /// The log is another one now, at the request of somebody on another line: what was requested of the one
    /// before is given up.
    pub const fn handle_new_log(&mut self) {
        self.log.end();
    }

    /// Whether [`Self::poll`] has something to send.
    #[must_use]
    pub const fn has_more(&self) -> bool {
        !self.replies.is_none()
            || !self.parameters.is_none()
            || !self.status.is_done()
            || !self.log.is_done()
    }

    /// The next frame of an answer that takes more than one. To be called when nothing more urgent
    /// waits for the line.
    #[inline(never)]
    pub fn poll(&mut self, board: &(impl Parameters + LogFile + StatusLine)) -> Option<Frame> {
        self.replies
            .poll(&mut self.sender)
            .or_else(|| self.parameters.poll(&mut self.sender, board))
            .or_else(|| self.status.poll(&mut self.sender, board))
            .or_else(|| self.log.poll(&mut self.sender, board))
    }

    /// The answer to `request`; `time` is the node's time at its arrival.
    #[inline(never)]
    pub fn answer(&mut self, request: &Request, time: NodeTime) -> Frame {
        let Request { from, version, .. } = *request;
        match request.kind {
            RequestKind::Ping { time_usec, seq } => Ping {
                time_usec: match self.ping_reply {
                    PingReply::RtosTime => time.rtos_us(),
                    PingReply::Echo => time_usec,
                },
                seq,
                target: from,
            }
            .frame(&mut self.sender, version),
            RequestKind::TimeSync { ts1 } => {
                let answer = TIMESYNC_DATA {
                    tc1: time.rtos_ns(),
                    ts1,
                    target_system: from.system,
                    target_component: from.component,
                };
                self.sender.message(version, &answer)
            }
            RequestKind::Command(command) => {
                // A *begin* that was refused leaves the log, and so its transfer, as it was.
                if command.meaning == Ok(Order::Test(Test::Begins)) {
                    self.log.end();
                }
                command.ack(&mut self.sender, version, from)
            }
            RequestKind::EraseLog => self.statustext(Severity::Notice, "log erased"),
        }
    }
}
