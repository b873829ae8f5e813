//! Answers of one frame that say what a node is, and what it does not have.
//!
//! *Purpose.* Clients ask for these when they connect, and repeat what is not answered: for the
//! versions of autopilot and protocol, for its home, for a mission, for files, for parameters that are
//! not there.
//!
//! *Design.* A request is noted, one of each kind: a client asks for one thing at a time. The frame is
//! made when the line has room ([`Node::poll`](crate::Node::poll)).
//!
//! *Limits.* PROTOCOL_VERSION and PARAM_ERROR have ids that MAVLink 1 has no room for, and files are
//! asked for in MAVLink 2 only: these are sent in MAVLink 2 whatever the request was in.

use mavlink::MessageData;
use mavlink::dialects::common::{
    AUTOPILOT_VERSION_DATA, FILE_TRANSFER_PROTOCOL_DATA, HOME_POSITION_DATA, MISSION_COUNT_DATA,
    MavParamError, MavProtocolCapability, PARAM_ERROR_DATA,
};

use timebase::Fix;

use crate::frame::{Address, Frame, Sender, Version};
use crate::parameter::Name;

/// The id of PROTOCOL_VERSION and its CRC_EXTRA: as it is deprecated, its type in `mavlink` is not used.
pub(crate) const PROTOCOL_VERSION: u32 = 300;
const PROTOCOL_VERSION_EXTRA: u8 = 217;

/// What a client can ask for by command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Described {
    /// AUTOPILOT_VERSION: what this node can do, and its release.
    Autopilot,
    /// PROTOCOL_VERSION: the versions of MAVLink that it speaks.
    Protocol,
    /// HOME_POSITION: where this node was at its first fix.
    Home,
}

/// Why a parameter was not read or set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ParameterError {
    DoesNotExist,
    ReadOnly,
}

/// A request for a parameter that fails.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FailedParameter {
    pub(crate) to: Address,
    pub(crate) index: i16,
    pub(crate) name: Name,
    pub(crate) error: ParameterError,
}

/// A request for a mission.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MissionAsked {
    pub(crate) to: Address,
    pub(crate) version: Version,
    /// MAV_MISSION_TYPE, as it was asked for.
    pub(crate) mission_type: u8,
}

/// A request for something of the file system.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FileAsked {
    pub(crate) to: Address,
    sequence: u16,
    session: u8,
    opcode: u8,
}

impl FileAsked {
    /// From FILE_TRANSFER_PROTOCOL's payload behind its target: u16 sequence, u8 session, u8 opcode,
    /// and what does not matter here. `None` for an answer, which nobody has asked for.
    pub(crate) fn parse(to: Address, payload: &[u8]) -> Option<Self> {
        const ACK: u8 = 128;
        let [low, high, session, opcode] = *payload.get(3..)?.first_chunk()?;
        (opcode < ACK).then_some(Self {
            to,
            sequence: u16::from_le_bytes([low, high]),
            session,
            opcode,
        })
    }

    /// A NAK: there are no files and no directories.
    fn frame(self, sender: &mut Sender) -> Frame {
        const NAK: u8 = 129;
        const UNKNOWN_COMMAND: u8 = 7;
        const FILE_NOT_FOUND: u8 = 10;
        // ListDirectory, OpenFileRO, CreateFile, RemoveFile, CreateDirectory, RemoveDirectory,
        // OpenFileWO, TruncateFile, Rename, CalcFileCRC32.
        let names_a_file = matches!(self.opcode, 3 | 4 | 6 | 8..=14);
        let error = if names_a_file {
            FILE_NOT_FOUND
        } else {
            UNKNOWN_COMMAND
        };
        let [low, high] = self.sequence.wrapping_add(1).to_le_bytes();
        // u8 target_network, target_system, target_component; then sequence, session, opcode, size,
        // the request's opcode, two zeros, u32 offset, and `size` bytes.
        let nak = [
            0,
            self.to.system,
            self.to.component,
            low,
            high,
            self.session,
            NAK,
            1,
            self.opcode,
            0,
            0,
            0,
            0,
            0,
            0,
            error,
        ];
        let (id, extra) = (
            FILE_TRANSFER_PROTOCOL_DATA::ID,
            FILE_TRANSFER_PROTOCOL_DATA::EXTRA_CRC,
        );
        sender.frame(Version::V2, id, extra, |payload| {
            let (room, _) = payload.split_at_mut(nak.len());
            room.copy_from_slice(&nak);
            nak.len()
        })
    }
}

/// A position.
#[derive(Clone, Copy, Debug)]
struct Home {
    latitude_1e7_deg: i32,
    longitude_1e7_deg: i32,
    height_msl_mm: i32,
}

impl Home {
    /// Where it is in a local frame, and how the ground lies there, is not known, which is NaN.
    const fn message(self) -> HOME_POSITION_DATA {
        HOME_POSITION_DATA {
            latitude: self.latitude_1e7_deg,
            longitude: self.longitude_1e7_deg,
            altitude: self.height_msl_mm,
            x: f32::NAN,
            y: f32::NAN,
            z: f32::NAN,
            q: [f32::NAN; 4],
            approach_x: f32::NAN,
            approach_y: f32::NAN,
            approach_z: f32::NAN,
            ..HOME_POSITION_DATA::DEFAULT
        }
    }
}

/// What is still to be told.
#[derive(Debug)]
pub(crate) struct PendingTold {
    autopilot: Option<Version>,
    protocol: bool,
    home_asked: Option<Version>,
    /// Where the first fix was.
    home: Option<Home>,
    pub(crate) parameter: Option<FailedParameter>,
    pub(crate) mission: Option<MissionAsked>,
    pub(crate) file: Option<FileAsked>,
}

impl PendingTold {
    pub(crate) const NONE: Self = Self {
        autopilot: None,
        protocol: false,
        home_asked: None,
        home: None,
        parameter: None,
        mission: None,
        file: None,
    };

    pub(crate) const fn is_none(&self) -> bool {
        let Self {
            autopilot: None,
            protocol: false,
            home_asked: None,
            home: _,
            parameter: None,
            mission: None,
            file: None,
        } = self
        else {
            return false;
        };
        true
    }

    pub(crate) fn want(&mut self, what: Described, version: Version) {
        match what {
            Described::Autopilot => self.autopilot = Some(version),
            Described::Protocol => self.protocol = true,
            Described::Home => self.home_asked = Some(version),
        }
    }

    /// Whether it can be told now.
    pub(crate) const fn is_known(&self, what: Described) -> bool {
        match what {
            Described::Autopilot | Described::Protocol => true,
            Described::Home => self.home.is_some(),
        }
    }

    /// Keeps the first fix in three dimensions.
    pub(crate) fn note_fix(&mut self, fix: &Fix) {
        if self.home.is_none() && fix.fix_ok && matches!(fix.fix_type, 3 | 4) {
            self.home = Some(Home {
                latitude_1e7_deg: fix.latitude_1e7_deg,
                longitude_1e7_deg: fix.longitude_1e7_deg,
                height_msl_mm: fix.height_msl_mm,
            });
        }
    }

    #[inline(never)]
    pub(crate) fn poll(&mut self, sender: &mut Sender) -> Option<Frame> {
        if let Some(version) = self.autopilot.take() {
            return Some(sender.message(version, &AUTOPILOT_VERSION));
        }
        if core::mem::take(&mut self.protocol) {
            return Some(protocol_version(sender));
        }
        if let Some(version) = self.home_asked.take()
            && let Some(home) = self.home
        {
            return Some(sender.message(version, &home.message()));
        }
        if let Some(failed) = self.parameter.take() {
            return Some(sender.message(Version::V2, &parameter_error(&failed)));
        }
        if let Some(mission) = self.mission.take() {
            return Some(mission.frame(sender));
        }
        Some(self.file.take()?.frame(sender))
    }
}

impl MissionAsked {
    /// MISSION_COUNT: there is none, of whichever type.
    fn frame(self, sender: &mut Sender) -> Frame {
        let (id, extra) = (MISSION_COUNT_DATA::ID, MISSION_COUNT_DATA::EXTRA_CRC);
        let to = self.to;
        // u16 count, u8 target_system, target_component; extension: u8 mission_type. By hand, for
        // types that the enum does not have.
        let count = [0, 0, to.system, to.component, self.mission_type];
        sender.frame(self.version, id, extra, |payload| {
            let (room, _) = payload.split_at_mut(count.len());
            room.copy_from_slice(&count);
            match self.version {
                Version::V1 => 4,
                Version::V2 => count
                    .iter()
                    .rposition(|&byte| byte != 0)
                    .map_or(1, |last| last + 1),
            }
        })
    }
}

/// What this node can do, and its release; the rest is not known here, which is 0.
const AUTOPILOT_VERSION: AUTOPILOT_VERSION_DATA = AUTOPILOT_VERSION_DATA {
    capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        .union(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST)
        .union(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2),
    flight_sw_version: RELEASE,
    ..AUTOPILOT_VERSION_DATA::DEFAULT
};

/// This release as MAVLink writes one: major, minor and patch in the upper three bytes, and in the
/// lowest FIRMWARE_VERSION_TYPE_DEV, 0.
const RELEASE: u32 = {
    let [major, minor, patch] = [
        env!("CARGO_PKG_VERSION_MAJOR"),
        env!("CARGO_PKG_VERSION_MINOR"),
        env!("CARGO_PKG_VERSION_PATCH"),
    ];
    (decimal(major) << 24) | (decimal(minor) << 16) | (decimal(patch) << 8)
};

/// A number of a release, below 256.
#[expect(clippy::indexing_slicing, reason = "evaluated at compile time only")]
const fn decimal(digits: &str) -> u32 {
    let digits = digits.as_bytes();
    let (mut number, mut place) = (0, 0);
    while place < digits.len() {
        number = number * 10 + (digits[place] - b'0') as u32;
        place += 1;
    }
    assert!(number < 256);
    number
}

/// MAVLink 1.0 to 2.0, in hundredths; the hashes of definitions are not known.
fn protocol_version(sender: &mut Sender) -> Frame {
    // u16 version, min_version, max_version; the rest is trailing zeros.
    let versions = [200, 0, 100, 0, 200];
    let (id, extra) = (PROTOCOL_VERSION, PROTOCOL_VERSION_EXTRA);
    sender.frame(Version::V2, id, extra, |payload| {
        let (room, _) = payload.split_at_mut(versions.len());
        room.copy_from_slice(&versions);
        versions.len()
    })
}

fn parameter_error(failed: &FailedParameter) -> PARAM_ERROR_DATA {
    PARAM_ERROR_DATA {
        param_index: failed.index,
        target_system: failed.to.system,
        target_component: failed.to.component,
        param_id: failed.name.bytes().into(),
        error: match failed.error {
            ParameterError::DoesNotExist => MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST,
            ParameterError::ReadOnly => MavParamError::MAV_PARAM_ERROR_READ_ONLY,
        },
    }
}
