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

use node_values::Name;
use timebase::Fix;

use crate::frame::{Address, Frame, Sender, Version};

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
        let kind = (
            FILE_TRANSFER_PROTOCOL_DATA::ID,
            FILE_TRANSFER_PROTOCOL_DATA::EXTRA_CRC,
        );
        sender.bytes(Version::V2, kind, &nak, nak.len())
    }
}

/// Bytes of a HOME_POSITION without its extension.
const HOME_LEN: usize = 52;

/// A position.
#[derive(Clone, Copy, Debug)]
struct Home {
    latitude_1e7_deg: i32,
    longitude_1e7_deg: i32,
    height_msl_mm: i32,
}

impl Home {
    fn frame(self, sender: &mut Sender, version: Version) -> Frame {
        // i32 latitude, longitude, altitude; then ten floats: where it is in a local frame, and how the
        // ground lies there, is not known, which is NaN. The extension is a time.
        let mut payload = [0; HOME_LEN];
        let known = [
            self.latitude_1e7_deg.to_le_bytes(),
            self.longitude_1e7_deg.to_le_bytes(),
            self.height_msl_mm.to_le_bytes(),
        ];
        let fields = known.into_iter().chain([f32::NAN.to_le_bytes(); 10]);
        for (place, field) in payload.as_chunks_mut().0.iter_mut().zip(fields) {
            *place = field;
        }
        let kind = (HOME_POSITION_DATA::ID, HOME_POSITION_DATA::EXTRA_CRC);
        sender.bytes(version, kind, &payload, HOME_LEN)
    }
}

/// What still has to be answered.
#[derive(Debug)]
pub(crate) struct PendingReplies {
    unique_id: [u8; 12],
    autopilot: Option<Version>,
    protocol: bool,
    home_asked: Option<Version>,
    /// Where the first fix was.
    home: Option<Home>,
    pub(crate) parameter: Option<FailedParameter>,
    pub(crate) mission: Option<MissionAsked>,
    pub(crate) file: Option<FileAsked>,
}

impl PendingReplies {
    /// There is nothing to answer.
    pub(crate) const fn new(unique_id: [u8; 12]) -> Self {
        Self {
            unique_id,
            autopilot: None,
            protocol: false,
            home_asked: None,
            home: None,
            parameter: None,
            mission: None,
            file: None,
        }
    }

    pub(crate) const fn is_none(&self) -> bool {
        let Self {
            unique_id: _,
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

    /// Whether it can be answered now.
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
            let kind = (
                AUTOPILOT_VERSION_DATA::ID,
                AUTOPILOT_VERSION_DATA::EXTRA_CRC,
            );
            return Some(sender.bytes(version, kind, &autopilot_version(&self.unique_id), 60));
        }
        if core::mem::take(&mut self.protocol) {
            return Some(protocol_version(sender));
        }
        if let Some(version) = self.home_asked.take()
            && let Some(home) = self.home
        {
            return Some(home.frame(sender, version));
        }
        if let Some(failed) = self.parameter.take() {
            return Some(failed.frame(sender));
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
        let kind = (MISSION_COUNT_DATA::ID, MISSION_COUNT_DATA::EXTRA_CRC);
        let to = self.to;
        // u16 count, u8 target_system, target_component; extension: u8 mission_type.
        let count = [0, 0, to.system, to.component, self.mission_type];
        sender.bytes(self.version, kind, &count, 4)
    }
}

/// AUTOPILOT_VERSION: u64 capabilities, u64 uid, u32 release; extension at 60: uid2. The rest is not known
/// here, which is 0. All of the unique number is in uid2, its beginning in uid.
fn autopilot_version(unique_id: &[u8; 12]) -> [u8; 72] {
    const CAPABILITIES: u64 = MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        .union(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST)
        .union(MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2)
        .bits();
    let [c0, c1, c2, c3, c4, c5, c6, c7] = CAPABILITIES.to_le_bytes();
    let [r0, r1, r2, r3] = RELEASE.to_le_bytes();
    let [u0, u1, u2, u3, u4, u5, u6, u7, ..] = *unique_id;
    let known = [
        c0, c1, c2, c3, c4, c5, c6, c7, u0, u1, u2, u3, u4, u5, u6, u7, r0, r1, r2, r3,
    ];
    let mut payload = [0; 72];
    if let Some(place) = payload.first_chunk_mut() {
        *place = known;
    }
    if let Some(place) = payload.last_chunk_mut() {
        *place = *unique_id;
    }
    payload
}

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
    let kind = (PROTOCOL_VERSION, PROTOCOL_VERSION_EXTRA);
    sender.bytes(Version::V2, kind, &[200, 0, 100, 0, 200], 22)
}

impl FailedParameter {
    /// PARAM_ERROR: i16 index, u8 target_system, target_component, 16 bytes of name, u8 error.
    fn frame(&self, sender: &mut Sender) -> Frame {
        let error = match self.error {
            ParameterError::DoesNotExist => MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST,
            ParameterError::ReadOnly => MavParamError::MAV_PARAM_ERROR_READ_ONLY,
        };
        let [low, high] = self.index.to_le_bytes();
        let head = [low, high, self.to.system, self.to.component];
        let fields = head.into_iter().chain(self.name.bytes());
        let mut payload = [error as u8; 21];
        for (place, byte) in payload.iter_mut().zip(fields) {
            *place = byte;
        }
        let kind = (PARAM_ERROR_DATA::ID, PARAM_ERROR_DATA::EXTRA_CRC);
        sender.bytes(Version::V2, kind, &payload, payload.len())
    }
}
