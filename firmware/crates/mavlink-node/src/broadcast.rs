//! What a node tells without being asked.
//!
//! *Purpose.* HEARTBEAT, SYSTEM_TIME and GPS_RAW_INT, once a second each, and
//! STATUSTEXT when something happens.
//!
//! *Design.* In MAVLink 1 until a frame of MAVLink 2 was heard on the line, in
//! MAVLink 2 from then on: a MAVLink 1 client understands everything as long as
//! nobody else speaks 2, a MAVLink 2 client understands both. PX4 did the same by
//! default (MAV_PROTO_VER 0).
//!
//! *Limits.* The type is GENERIC and the autopilot GENERIC (0 and 0), with which
//! QGroundControl asks for no parameters.

use mavlink::dialects::common::{
    GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavSeverity, MavState,
    MavType, STATUSTEXT_DATA, SYSTEM_TIME_DATA,
};

use crate::frame::Frame;
use crate::node::Node;
use crate::node_time::NodeTime;

/// A position as the receiver told it, in the units of GPS_RAW_INT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpsFix {
    /// What kind of fix it is.
    pub fix: Fix,
    /// Latitude, in 10^-7 degrees.
    pub latitude_e7: i32,
    /// Longitude, in 10^-7 degrees.
    pub longitude_e7: i32,
    /// Height above mean sea level, in mm.
    pub altitude_msl_mm: i32,
    /// Height above the ellipsoid, in mm.
    pub altitude_ellipsoid_mm: i32,
    /// Dilution of precision, horizontal, times 100; `u16::MAX` if unknown.
    pub hdop_e2: u16,
    /// Dilution of precision, vertical, times 100; `u16::MAX` if unknown.
    pub vdop_e2: u16,
    /// Speed over ground, in cm/s; `u16::MAX` if unknown.
    pub ground_speed_cm_s: u16,
    /// Course over ground, in 10^-2 degrees; `u16::MAX` if unknown.
    pub course_e2: u16,
    /// Satellites in the solution; 255 if unknown.
    pub satellites: u8,
    /// Horizontal accuracy, in mm; 0 if unknown.
    pub horizontal_accuracy_mm: u32,
    /// Vertical accuracy, in mm; 0 if unknown.
    pub vertical_accuracy_mm: u32,
    /// Accuracy of the speed, in mm/s; 0 if unknown.
    pub speed_accuracy_mm_s: u32,
}

impl GpsFix {
    /// No receiver is heard.
    pub const NONE: Self = Self {
        fix: Fix::NoReceiver,
        latitude_e7: 0,
        longitude_e7: 0,
        altitude_msl_mm: 0,
        altitude_ellipsoid_mm: 0,
        hdop_e2: u16::MAX,
        vdop_e2: u16::MAX,
        ground_speed_cm_s: u16::MAX,
        course_e2: u16::MAX,
        satellites: u8::MAX,
        horizontal_accuracy_mm: 0,
        vertical_accuracy_mm: 0,
        speed_accuracy_mm_s: 0,
    };
}

/// The kind of a fix (GPS_FIX_TYPE).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fix {
    /// No receiver is connected.
    NoReceiver,
    /// No position.
    None,
    /// Two dimensions.
    TwoD,
    /// Three dimensions.
    ThreeD,
    /// Three dimensions with differential corrections.
    Differential,
    /// Carrier phase, ambiguities floating.
    RtkFloat,
    /// Carrier phase, ambiguities fixed.
    RtkFixed,
}

impl From<Fix> for GpsFixType {
    fn from(fix: Fix) -> Self {
        match fix {
            Fix::NoReceiver => Self::GPS_FIX_TYPE_NO_GPS,
            Fix::None => Self::GPS_FIX_TYPE_NO_FIX,
            Fix::TwoD => Self::GPS_FIX_TYPE_2D_FIX,
            Fix::ThreeD => Self::GPS_FIX_TYPE_3D_FIX,
            Fix::Differential => Self::GPS_FIX_TYPE_DGPS,
            Fix::RtkFloat => Self::GPS_FIX_TYPE_RTK_FLOAT,
            Fix::RtkFixed => Self::GPS_FIX_TYPE_RTK_FIXED,
        }
    }
}

/// How much a text matters (MAV_SEVERITY, RFC 5424).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Something failed.
    Error,
    /// Something may fail.
    Warning,
    /// Unusual, but no fault.
    Notice,
    /// Ordinary operation.
    Info,
}

impl From<Severity> for MavSeverity {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Error => Self::MAV_SEVERITY_ERROR,
            Severity::Warning => Self::MAV_SEVERITY_WARNING,
            Severity::Notice => Self::MAV_SEVERITY_NOTICE,
            Severity::Info => Self::MAV_SEVERITY_INFO,
        }
    }
}

/// The version of the protocol that HEARTBEAT names (`common.xml`).
const MAVLINK_VERSION: u8 = 3;

impl Node {
    /// HEARTBEAT: active once the clock is set, starting up before. To be sent once a
    /// second; it is also the moment at which a frame is given up whose line has
    /// been silent since the last one (no host pauses that long inside a frame).
    pub fn heartbeat(&mut self, time: NodeTime) -> Frame {
        self.give_up_if_silent();
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

    /// SYSTEM_TIME: UTC is 0 until the clock is set.
    pub fn system_time(&mut self, time: NodeTime) -> Frame {
        let system_time = SYSTEM_TIME_DATA {
            time_unix_usec: time.utc_us(),
            time_boot_ms: time.boot_ms(),
        };
        self.sender.message(self.version, &system_time)
    }

    /// GPS_RAW_INT; `time` is the node's time of the fix.
    pub fn gps_raw_int(&mut self, time: NodeTime, fix: &GpsFix) -> Frame {
        let gps_raw_int = GPS_RAW_INT_DATA {
            time_usec: time.rtos_us(),
            lat: fix.latitude_e7,
            lon: fix.longitude_e7,
            alt: fix.altitude_msl_mm,
            eph: fix.hdop_e2,
            epv: fix.vdop_e2,
            vel: fix.ground_speed_cm_s,
            cog: fix.course_e2,
            fix_type: fix.fix.into(),
            satellites_visible: fix.satellites,
            alt_ellipsoid: fix.altitude_ellipsoid_mm,
            h_acc: fix.horizontal_accuracy_mm,
            v_acc: fix.vertical_accuracy_mm,
            vel_acc: fix.speed_accuracy_mm_s,
            hdg_acc: 0,
            yaw: 0,
        };
        self.sender.message(self.version, &gps_raw_int)
    }

    /// STATUSTEXT: the first 50 bytes of `text`.
    pub fn statustext(&mut self, severity: Severity, text: &str) -> Frame {
        let statustext = STATUSTEXT_DATA {
            severity: severity.into(),
            text: text.into(),
            ..STATUSTEXT_DATA::DEFAULT
        };
        self.sender.message(self.version, &statustext)
    }
}
