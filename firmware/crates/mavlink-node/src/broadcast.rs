//! What a node sends without being asked.
//!
//! *Purpose.* HEARTBEAT, SYSTEM_TIME and GPS_RAW_INT, once a second each, and STATUSTEXT when
//! something happens. What ground stations plot is in [`plotted`](crate::plotted).
//!
//! *Design.* In MAVLink 1 until a frame of MAVLink 2 was received, in MAVLink 2 from then on: a
//! MAVLink 1 client may not understand MAVLink 2, and a MAVLink 2 client understands both. PX4 does
//! the same by default (MAV_PROTO_VER 0).
//!
//! *Limits.* The type is GENERIC and the autopilot GENERIC (0 and 0), for which QGroundControl
//! requests no parameters.

use mavlink::dialects::common::{
    GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType,
    STATUSTEXT_DATA, SYSTEM_TIME_DATA,
};
use node_values::{NodeTime, Severity};
use timebase::Fix;

use crate::frame::{Address, Frame, Sender, Version};
use crate::node::Node;
use crate::severity::mav_severity;

/// A GPS_RAW_INT in which nothing is known (`common.xml`).
const UNKNOWN: GPS_RAW_INT_DATA = GPS_RAW_INT_DATA {
    fix_type: GpsFixType::GPS_FIX_TYPE_NO_GPS,
    eph: u16::MAX,
    epv: u16::MAX,
    vel: u16::MAX,
    cog: u16::MAX,
    satellites_visible: u8::MAX,
    ..GPS_RAW_INT_DATA::DEFAULT
};

/// A fix in the units of GPS_RAW_INT, without its time. The dilutions of precision stay unknown:
/// NAV-PVT has only the one of all three directions together.
fn gps_raw_int(fix: &Fix) -> GPS_RAW_INT_DATA {
    GPS_RAW_INT_DATA {
        fix_type: match fix.fix_type {
            2 if fix.fix_ok => GpsFixType::GPS_FIX_TYPE_2D_FIX,
            3 | 4 if fix.fix_ok => GpsFixType::GPS_FIX_TYPE_3D_FIX,
            _ => GpsFixType::GPS_FIX_TYPE_NO_FIX,
        },
        lat: fix.latitude_1e7_deg,
        lon: fix.longitude_1e7_deg,
        alt: fix.height_msl_mm,
        vel: u16::try_from(fix.ground_speed_mm_s / 10).unwrap_or(u16::MAX),
        cog: u16::try_from(fix.heading_1e5_deg / 1_000).unwrap_or(u16::MAX),
        satellites_visible: fix.satellites,
        h_acc: fix.horizontal_accuracy_mm,
        v_acc: fix.vertical_accuracy_mm,
        ..UNKNOWN
    }
}

/// The version of the protocol in a HEARTBEAT (`common.xml`).
const MAVLINK_VERSION: u8 = 3;

impl Node {
    /// HEARTBEAT: active once the clock is set, starting up before. To be sent once a second.
    pub fn heartbeat(&mut self, time: NodeTime) -> Frame {
        let heartbeat = HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_GENERIC,
            autopilot: MavAutopilot::MAV_AUTOPILOT_GENERIC,
            base_mode: MavModeFlag::empty(),
            system_status: match time.utc_ns {
                Some(_) => MavState::MAV_STATE_ACTIVE,
                None => MavState::MAV_STATE_BOOT,
            },
            mavlink_version: MAVLINK_VERSION,
        };
        self.sender.message(self.version, &heartbeat)
    }

    /// SYSTEM_TIME: UTC is 0 unless it is set and date and second `are_proved`, because others set
    /// their clocks by it.
    pub fn system_time(&mut self, time: NodeTime, are_proved: bool) -> Frame {
        let system_time = SYSTEM_TIME_DATA {
            time_unix_usec: if are_proved { time.utc_us() } else { 0 },
            time_boot_ms: time.boot_ms(),
        };
        self.sender.message(self.version, &system_time)
    }

    /// GPS_RAW_INT; `time` is the node's time of the fix. Without one, the message says that no
    /// receiver is connected.
    pub fn gps_raw_int(&mut self, time: NodeTime, fix: Option<&Fix>) -> Frame {
        if let Some(fix) = fix {
            self.replies.note_fix(fix);
        }
        let gps_raw_int = GPS_RAW_INT_DATA {
            time_usec: time.rtos_us(),
            ..fix.map_or(UNKNOWN, gps_raw_int)
        };
        self.sender.message(self.version, &gps_raw_int)
    }

    /// STATUSTEXT: the first 50 bytes of `text`.
    pub fn statustext(&mut self, severity: Severity, text: &str) -> Frame {
        let statustext = STATUSTEXT_DATA {
            severity: mav_severity(severity),
            text: text.into(),
            ..STATUSTEXT_DATA::DEFAULT
        };
        self.sender.message(self.version, &statustext)
    }
}

/// What a board says that has no node any more: a HEARTBEAT that is critical, without which stations show
/// nothing, and a STATUSTEXT with the first 50 bytes of `text`. In MAVLink 1, which all understand.
#[must_use]
pub fn last_words(from: Address, text: &str) -> [Frame; 2] {
    let mut sender = Sender::new(from);
    let heartbeat = HEARTBEAT_DATA {
        system_status: MavState::MAV_STATE_CRITICAL,
        mavlink_version: MAVLINK_VERSION,
        ..HEARTBEAT_DATA::DEFAULT
    };
    let statustext = STATUSTEXT_DATA {
        severity: mav_severity(Severity::Error),
        text: text.into(),
        ..STATUSTEXT_DATA::DEFAULT
    };
    [
        sender.message(Version::V1, &heartbeat),
        sender.message(Version::V1, &statustext),
    ]
}
