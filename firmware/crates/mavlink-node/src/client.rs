//! The other end of the line: sends requests to a node, and understands its messages.
//!
//! *Purpose.* For tools and tests on a host; the firmware does not use it.
//!
//! *Design.* The node's framer with other kinds wanted, and the node's way to build a frame.
//! Requests for the time go to all systems, everything else to one node.
//!
//! *Limits.* It has no clock: the caller notes when it sends and receives, and repeats a request
//! that was not answered.

use mavlink::MavlinkVersion::V2;
use mavlink::MessageData;
use mavlink::dialects::common::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GPS_RAW_INT_DATA, HEARTBEAT_DATA, LOG_DATA_DATA,
    LOG_ENTRY_DATA, LOG_ERASE_DATA, LOG_REQUEST_DATA_DATA, LOG_REQUEST_END_DATA,
    LOG_REQUEST_LIST_DATA, MavCmd, NAMED_VALUE_FLOAT_DATA, PARAM_REQUEST_LIST_DATA,
    PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA, STATUSTEXT_DATA, SYSTEM_TIME_DATA, TIMESYNC_DATA,
};
use node_values::{Name, Parameter, Text};
use sample_log::Test;
use timebase::StampedByte;

use crate::command;
use crate::frame::{Address, Frame, Sender, Version};
use crate::framer::{Delimited, Framer, FramingCounters};
use crate::kind::{Kind, Wanted};
use crate::log_transfer::{LOG_DATA_LEN, LOG_ID};
use crate::ping::Ping;
use crate::status_transfer::STATUS_ID;

/// A message of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received {
    /// Its sender.
    pub from: Address,
    /// Its version.
    pub version: Version,
    /// What it says.
    pub message: Message,
}

/// What a message of a node says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// HEARTBEAT: the node is there.
    Heartbeat,
    /// SYSTEM_TIME: its time, sent without being asked.
    SystemTime {
        /// UTC in µs since 1970; 0 while the node does not know it.
        time_unix_usec: u64,
        /// Time since boot, in ms.
        time_boot_ms: u32,
    },
    /// GPS_RAW_INT: what its receiver has.
    Fix {
        /// GPS_FIX_TYPE: 0 if no receiver is connected.
        fix_type: u8,
    },
    /// Its answer to a PING.
    Ping {
        /// The node's time, in µs: of UTC, or since boot while it is not set.
        time_usec: u64,
        /// The number of the request.
        seq: u32,
        /// The client that the answer is for.
        target: Address,
    },
    /// Its answer to a TIMESYNC.
    TimeSync {
        /// The node's time, in ns.
        tc1: i64,
        /// The request's own time.
        ts1: i64,
    },
    /// Its answer to a command.
    CommandAck {
        /// MAV_CMD.
        command: u16,
        /// MAV_RESULT, see [`Message::ACCEPTED`].
        result: u8,
    },
    /// PARAM_VALUE: one of its parameters, sent to all clients.
    Parameter {
        /// Its name; [`Parameter::named`] knows ours.
        name: Name,
        /// Its value.
        value: f32,
        /// Its index.
        index: u16,
        /// The number of parameters.
        count: u16,
    },
    /// LOG_ENTRY: a log that it has.
    LogEntry {
        /// The log's number.
        id: u16,
        /// The number of logs.
        logs: u16,
        /// When the log was begun, in s of UTC since 1970; 0 if unknown.
        time_utc: u32,
        /// Its length, in bytes.
        size: u32,
    },
    /// LOG_DATA: a piece of a log.
    LogData {
        /// The log's number.
        id: u16,
        /// The offset of the piece, in bytes.
        offset: u32,
        /// Its bytes are the first `count` of these.
        data: [u8; LOG_DATA_LEN],
        /// The number of bytes; 0 at the end of the log.
        count: u8,
    },
    /// NAMED_VALUE_FLOAT: a value to plot.
    Plotted {
        /// Its name, as in [`Plotted::name`](crate::Plotted::name).
        name: Text<10>,
        /// Its value; NaN if it is not known.
        value: f32,
    },
    /// STATUSTEXT: a text for people.
    StatusText {
        /// MAV_SEVERITY: 3 error, 4 warning, 5 notice, 6 info.
        severity: u8,
        /// The text.
        text: Text<50>,
    },
}

/// The address of a tool on a host: the system of a ground station, and the component
/// MAV_COMP_ID_MISSIONPLANNER, which no device has.
pub const GROUND_STATION: Address = Address {
    system: 255,
    component: 190,
};

/// No node is up for so long: 30 years. And none has a receiver that is older. \[µs\]
const LONGEST_UP_US: u64 = 30 * 365 * 86_400 * 1_000_000;

/// Whether a node's time, in µs as in an answer to a PING, is UTC and not the time since boot.
#[must_use]
pub const fn is_utc(time_usec: u64) -> bool {
    time_usec >= LONGEST_UP_US
}

impl Message {
    /// MAV_RESULT_ACCEPTED: done.
    pub const ACCEPTED: u8 = 0;
    /// MAV_RESULT_DENIED: known, but not with these parameters.
    pub const DENIED: u8 = 2;
    /// MAV_RESULT_UNSUPPORTED: a command of that number is not known.
    pub const UNSUPPORTED: u8 = 3;
}

/// The kinds of frames that a client wants.
#[derive(Debug)]
struct Answers;

impl Wanted for Answers {
    const KINDS: &'static [Kind] = &[
        Kind::of::<HEARTBEAT_DATA>(9, 1),
        Kind::of::<SYSTEM_TIME_DATA>(12, 1),
        Kind::of::<GPS_RAW_INT_DATA>(30, 1),
        Ping::KIND,
        Kind::of::<TIMESYNC_DATA>(16, 1),
        Kind::of::<COMMAND_ACK_DATA>(3, 1),
        Kind::of::<PARAM_VALUE_DATA>(25, 1),
        Kind::of::<LOG_ENTRY_DATA>(14, 1),
        Kind::of::<LOG_DATA_DATA>(97, 1),
        Kind::of::<NAMED_VALUE_FLOAT_DATA>(18, 1),
        Kind::of::<STATUSTEXT_DATA>(51, 1),
    ];
}

/// The longest payload that a client wants: LOG_DATA.
const MAX_PAYLOAD: usize = LOG_DATA_DATA::ENCODED_LEN;

/// The offset of the type of fix in GPS_RAW_INT, in bytes: behind all fields that are longer.
const FIX_TYPE: usize = 28;

/// Builds requests, and understands messages.
#[derive(Debug)]
pub struct Client {
    framer: Framer<Answers, MAX_PAYLOAD, 128>,
    sender: Sender,
    version: Version,
}

impl Client {
    /// The number of the log that is the status.
    pub const STATUS: u16 = STATUS_ID;

    /// A client that speaks `version` as `address`.
    #[must_use]
    pub const fn new(address: Address, version: Version) -> Self {
        Self {
            framer: Framer::new(),
            sender: Sender::new(address),
            version,
        }
    }

    /// A request for the time, to all systems. `time_usec` is the client's own time, in µs.
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

    /// A request for the time, to all systems. `ts1` is the client's own time, in ns.
    pub fn timesync(&mut self, ts1: i64) -> Frame {
        self.frame(&TIMESYNC_DATA {
            ts1,
            ..TIMESYNC_DATA::DEFAULT
        })
    }

    /// The command that begins or ends a test (MAV_CMD_USER_1). Answered with
    /// [`Message::CommandAck`]. Repeat it until then, and send nothing else before, because each
    /// command that begins a test clears the log.
    pub fn test(&mut self, node: Address, test: Test) -> Frame {
        self.frame(&COMMAND_LONG_DATA {
            param1: command::param1(test),
            command: MavCmd::MAV_CMD_USER_1,
            target_system: node.system,
            target_component: node.component,
            ..COMMAND_LONG_DATA::DEFAULT
        })
    }

    /// The command that restarts a board into its bootloader
    /// (MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN). Answered with [`Message::CommandAck`], and then the board
    /// is silent. PX4's firmware obeys it too.
    pub fn bootloader(&mut self, node: Address) -> Frame {
        self.frame(&COMMAND_LONG_DATA {
            param1: command::TO_BOOTLOADER,
            command: MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
            target_system: node.system,
            target_component: node.component,
            ..COMMAND_LONG_DATA::DEFAULT
        })
    }

    /// A request for all parameters. Answered with a [`Message::Parameter`] for each.
    pub fn parameters(&mut self, node: Address) -> Frame {
        self.frame(&PARAM_REQUEST_LIST_DATA {
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// A request for one parameter. Answered with [`Message::Parameter`].
    pub fn parameter(&mut self, node: Address, parameter: Parameter) -> Frame {
        let request = PARAM_REQUEST_READ_DATA {
            // By its name.
            param_index: -1,
            target_system: node.system,
            target_component: node.component,
            param_id: parameter.name().into(),
        };
        self.frame(&request)
    }

    /// A request for the list of logs. Answered with [`Message::LogEntry`].
    pub fn logs(&mut self, node: Address) -> Frame {
        self.frame(&LOG_REQUEST_LIST_DATA {
            start: 0,
            end: u16::MAX,
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// A request for up to `count` bytes of the log from `offset` on; it replaces an earlier one.
    /// Answered with one [`Message::LogData`] after the other, up to the end of the log.
    pub fn log_data(&mut self, node: Address, offset: u32, count: u32) -> Frame {
        self.frame(&LOG_REQUEST_DATA_DATA {
            ofs: offset,
            count,
            id: LOG_ID,
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// A request for the status, which replaces an earlier one. Answered with one [`Message::LogData`]
    /// of the log [`Self::STATUS`] after the other, up to one with fewer than [`LOG_DATA_LEN`] bytes:
    /// a text as in the board's own log, `status key=value key=value …`.
    pub fn status(&mut self, node: Address) -> Frame {
        self.frame(&LOG_REQUEST_DATA_DATA {
            ofs: 0,
            count: u32::MAX,
            id: STATUS_ID,
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// Ends the transfer of the log. Not answered.
    pub fn end_log(&mut self, node: Address) -> Frame {
        self.frame(&LOG_REQUEST_END_DATA {
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// Erases the log. Answered with a text.
    pub fn erase_log(&mut self, node: Address) -> Frame {
        self.frame(&LOG_ERASE_DATA {
            target_system: node.system,
            target_component: node.component,
        })
    }

    fn frame<M: MessageData>(&mut self, message: &M) -> Frame {
        self.sender.message(self.version, message)
    }

    /// Takes a byte, and returns the message that ends with it.
    pub fn push(&mut self, byte: StampedByte) -> Option<Received> {
        let frame = match self.framer.push(byte) {
            0 => return None,
            length => self.framer.take(length),
        };
        Some(Received {
            from: frame.from,
            version: frame.version,
            message: parse(&frame)?,
        })
    }

    /// What the framer found.
    #[must_use]
    pub const fn counters(&self) -> FramingCounters {
        self.framer.counters()
    }
}

/// The message of a frame; `None` if it is not valid.
fn parse(frame: &Delimited<MAX_PAYLOAD>) -> Option<Message> {
    let payload = &frame.payload;
    Some(match u32::from(frame.id) {
        HEARTBEAT_DATA::ID => Message::Heartbeat,
        SYSTEM_TIME_DATA::ID => {
            let time = SYSTEM_TIME_DATA::deser(V2, payload).ok()?;
            Message::SystemTime {
                time_unix_usec: time.time_unix_usec,
                time_boot_ms: time.time_boot_ms,
            }
        }
        GPS_RAW_INT_DATA::ID => Message::Fix {
            // By hand, for types that the enum does not have.
            fix_type: payload.get(FIX_TYPE).copied()?,
        },
        Ping::ID => {
            let ping = Ping::parse(payload)?;
            Message::Ping {
                time_usec: ping.time_usec,
                seq: ping.seq,
                target: ping.target,
            }
        }
        TIMESYNC_DATA::ID => {
            let sync = TIMESYNC_DATA::deser(V2, payload).ok()?;
            Message::TimeSync {
                tc1: sync.tc1,
                ts1: sync.ts1,
            }
        }
        COMMAND_ACK_DATA::ID => {
            // By hand, for commands and results that the enums do not have.
            let [low, high, result] = *payload.first_chunk()?;
            Message::CommandAck {
                command: u16::from_le_bytes([low, high]),
                result,
            }
        }
        PARAM_VALUE_DATA::ID => {
            let parameter = PARAM_VALUE_DATA::deser(V2, payload).ok()?;
            Message::Parameter {
                name: Text::new(parameter.param_id.into()),
                value: parameter.param_value,
                index: parameter.param_index,
                count: parameter.param_count,
            }
        }
        LOG_ENTRY_DATA::ID => {
            let entry = LOG_ENTRY_DATA::deser(V2, payload).ok()?;
            Message::LogEntry {
                id: entry.id,
                logs: entry.num_logs,
                time_utc: entry.time_utc,
                size: entry.size,
            }
        }
        LOG_DATA_DATA::ID => {
            let log = LOG_DATA_DATA::deser(V2, payload).ok()?;
            Message::LogData {
                id: log.id,
                offset: log.ofs,
                data: log.data,
                count: log.count.min(LOG_DATA_LEN as u8),
            }
        }
        NAMED_VALUE_FLOAT_DATA::ID => {
            let named = NAMED_VALUE_FLOAT_DATA::deser(V2, payload).ok()?;
            Message::Plotted {
                name: Text::new(named.name.into()),
                value: named.value,
            }
        }
        _ => {
            let text = STATUSTEXT_DATA::deser(V2, payload).ok()?;
            Message::StatusText {
                severity: text.severity as u8,
                text: Text::new(text.text.into()),
            }
        }
    })
}
