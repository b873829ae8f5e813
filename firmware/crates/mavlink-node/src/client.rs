//! The other end of the line: asks a node and understands what it says.
//!
//! *Purpose.* For tools and tests on a host; the firmware does not use it.
//!
//! *Design.* The node's framer with other kinds wanted, the node's way to build
//! a frame. Requests for the time go to everybody; everything else is for one node.
//!
//! *Limits.* It has no clock: whoever sends and receives notes the moments, and asks
//! again when nothing comes. Since a node hears it in MAVLink 2 only,
//! PARAM_REQUEST_READ goes out in MAVLink 2 whatever the client speaks.

use mavlink::MavlinkVersion::V2;
use mavlink::MessageData;
use mavlink::dialects::common::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GPS_RAW_INT_DATA, HEARTBEAT_DATA, LOG_DATA_DATA,
    LOG_ENTRY_DATA, LOG_ERASE_DATA, LOG_REQUEST_DATA_DATA, LOG_REQUEST_END_DATA,
    LOG_REQUEST_LIST_DATA, MavCmd, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA,
    PARAM_VALUE_DATA, STATUSTEXT_DATA, SYSTEM_TIME_DATA, TIMESYNC_DATA,
};
use sample_log::Test;
use timebase::StampedByte;

use crate::command;
use crate::frame::{Address, Frame, Sender, Version};
use crate::framer::{Delimited, Framer, FramingCounters, Kind, Wanted};
use crate::log_transfer::{LOG_DATA_LEN, LOG_ID};
use crate::parameter::{Name, Parameter, Text};
use crate::ping::Ping;

/// Something that a node said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received {
    /// Who said it.
    pub from: Address,
    /// In which version.
    pub version: Version,
    /// What it said.
    pub what: Message,
}

/// What a node said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// It is there.
    Heartbeat,
    /// Its time, unasked.
    SystemTime {
        /// UTC in µs since 1970; 0 while the node does not know it.
        time_unix_usec: u64,
        /// Time since boot, in ms.
        time_boot_ms: u32,
    },
    /// What its receiver tells.
    Fix {
        /// GPS_FIX_TYPE: 0 where no receiver is heard.
        fix_type: u8,
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
    /// Its answer to a command.
    CommandAck {
        /// MAV_CMD.
        command: u16,
        /// MAV_RESULT, see [`What::ACCEPTED`].
        result: u8,
    },
    /// One of its parameters. It says so to everybody.
    Parameter {
        /// Its name; [`Parameter::named`] knows ours.
        name: Name,
        /// Its value.
        value: f32,
        /// Its index.
        index: u16,
        /// How many there are.
        count: u16,
    },
    /// A log that it has.
    LogEntry {
        /// The log's number.
        id: u16,
        /// How many logs there are.
        logs: u16,
        /// When it was begun, in s of UTC since 1970; 0 if unknown.
        time_utc: u32,
        /// Its length, in bytes.
        size: u32,
    },
    /// A stretch of a log.
    LogData {
        /// The log's number.
        id: u16,
        /// Where it begins, in bytes.
        offset: u32,
        /// The bytes; the first `count` are meant.
        data: [u8; LOG_DATA_LEN],
        /// How many bytes; 0 at the end of the log.
        count: u8,
    },
    /// Something that people should read.
    StatusText {
        /// MAV_SEVERITY: 3 error, 4 warning, 5 notice, 6 info.
        severity: u8,
        /// The text.
        text: Text<50>,
    },
}

/// Who a tool on a host is: a ground station's system, and the component that MAVLink gives
/// to no device (MAV_COMP_ID_MISSIONPLANNER).
pub const GROUND_STATION: Address = Address {
    system: 255,
    component: 190,
};

/// A node's time in µs below this is a time since boot: 2016-01-01, before which no node
/// sets its clock.
pub const EARLIEST_UTC_US: u64 = 1_451_606_400_000_000;

impl Message {
    /// MAV_RESULT_ACCEPTED: done.
    pub const ACCEPTED: u8 = 0;
    /// MAV_RESULT_DENIED: known, but not with these parameters.
    pub const DENIED: u8 = 2;
    /// MAV_RESULT_UNSUPPORTED: nothing of that number is known.
    pub const UNSUPPORTED: u8 = 3;
}

/// The kinds that a client listens to.
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
        Kind::of::<STATUSTEXT_DATA>(51, 1),
    ];
}

/// The longest payload that a client wants: LOG_DATA.
const MAX_PAYLOAD: usize = LOG_DATA_DATA::ENCODED_LEN;

/// Where GPS_RAW_INT has its type of fix, behind what is longer than a byte.
const FIX_TYPE: usize = 28;

/// Asks, and understands what is said.
#[derive(Debug)]
pub struct Client {
    framer: Framer<Answers, MAX_PAYLOAD, 256>,
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
        self.say(&TIMESYNC_DATA {
            ts1,
            ..TIMESYNC_DATA::DEFAULT
        })
    }

    /// The command by which a test begins or ends (MAV_CMD_USER_1). Answered with
    /// [`What::CommandAck`]; to be repeated until it is, before anything else is sent:
    /// each one that begins a test clears the log.
    pub fn test(&mut self, node: Address, test: Test) -> Frame {
        self.say(&COMMAND_LONG_DATA {
            param1: command::param1(test),
            command: MavCmd::MAV_CMD_USER_1,
            target_system: node.system,
            target_component: node.component,
            ..COMMAND_LONG_DATA::DEFAULT
        })
    }

    /// A request for all parameters. Answered with a [`What::Parameter`] for each.
    pub fn parameters(&mut self, node: Address) -> Frame {
        self.say(&PARAM_REQUEST_LIST_DATA {
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// A request for one parameter. Answered with [`What::Parameter`].
    pub fn parameter(&mut self, node: Address, parameter: Parameter) -> Frame {
        let request = PARAM_REQUEST_READ_DATA {
            // By its name.
            param_index: -1,
            target_system: node.system,
            target_component: node.component,
            param_id: parameter.name().into(),
        };
        self.sender.message(Version::V2, &request)
    }

    /// A request for the list of logs. Answered with [`What::LogEntry`].
    pub fn logs(&mut self, node: Address) -> Frame {
        self.say(&LOG_REQUEST_LIST_DATA {
            start: 0,
            end: u16::MAX,
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// A request for up to `count` bytes of the log from `offset` on; it takes the
    /// place of an earlier one. Answered with [`What::LogData`], one after the other,
    /// as far as the log goes.
    pub fn log_data(&mut self, node: Address, offset: u32, count: u32) -> Frame {
        self.say(&LOG_REQUEST_DATA_DATA {
            ofs: offset,
            count,
            id: LOG_ID,
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// No more of the log is wanted. Not answered.
    pub fn end_log(&mut self, node: Address) -> Frame {
        self.say(&LOG_REQUEST_END_DATA {
            target_system: node.system,
            target_component: node.component,
        })
    }

    /// Erases the log. Answered with a text.
    pub fn erase_log(&mut self, node: Address) -> Frame {
        self.say(&LOG_ERASE_DATA {
            target_system: node.system,
            target_component: node.component,
        })
    }

    fn say<M: MessageData>(&mut self, message: &M) -> Frame {
        self.sender.message(self.version, message)
    }

    /// Takes a byte.
    pub fn push(&mut self, byte: StampedByte) -> Option<Received> {
        let frame = match self.framer.push(byte) {
            0 => return None,
            length => self.framer.take(length),
        };
        Some(Received {
            from: frame.from,
            version: frame.version,
            what: what(&frame)?,
        })
    }

    /// What the framing met.
    #[must_use]
    pub const fn counters(&self) -> FramingCounters {
        self.framer.counters()
    }
}

/// What a frame says; `None` if it makes no sense.
fn what(frame: &Delimited<MAX_PAYLOAD>) -> Option<Message> {
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
            // By hand, for types that the enum does not know.
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
            // By hand, for commands and results that the enums do not know.
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
        _ => {
            let told = STATUSTEXT_DATA::deser(V2, payload).ok()?;
            Message::StatusText {
                severity: told.severity as u8,
                text: Text::new(told.text.into()),
            }
        }
    })
}
