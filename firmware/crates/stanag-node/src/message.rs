//! The numbers and fields of the messages that are spoken here: one table, for both ends.
//!
//! *Sources.* #4000 is Edition 3's; the others below 50000 are as implementations have them, the size of
//! #16000's text as Edition 2. From 52000 on they are ours.

use stanag_wire::Layout;

/// CUCS Authorisation Request.
pub const AUTHORISATION_REQUEST: u16 = 1;
/// VSM Authorisation Response: Time, VSM ID, Data Link ID, two of access, LOI authorised and granted,
/// six more, Vehicle Type and Subtype, …
pub const AUTHORISATION_RESPONSE: u16 = 2;
/// Its fields.
pub const AUTHORISATION_RESPONSE_LAYOUT: Layout = Layout {
    vector: 3,
    sizes: &[5, 4, 4, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 2, 2, 1, 2, 1, 2],
};
/// Vehicle ID: Time, VSM ID, Vehicle ID Update, Vehicle Type, Subtype, Owning ID, …
pub const VEHICLE_ID: u16 = 3;
/// Its fields.
pub const VEHICLE_ID_LAYOUT: Layout = Layout {
    vector: 2,
    sizes: &[5, 4, 4, 2, 2, 1, 16, 20, 32, 2],
};
/// CUCS Authorisation Request: Time, VSM ID, Data Link ID, Vehicle Type and Subtype, Requested LOI, …
pub const AUTHORISATION_REQUEST_LAYOUT: Layout = Layout {
    vector: 3,
    sizes: &[5, 4, 4, 2, 2, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 2, 1, 2],
};
/// Inertial States: Time, Latitude, Longitude, Altitude, its type, speeds north, east and down, …
pub const INERTIAL_STATES: u16 = 4_000;
/// Its fields.
pub const INERTIAL_STATES_LAYOUT: Layout = Layout {
    vector: 3,
    sizes: &[5, 4, 4, 3, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2],
};
/// Subsystem Status Alert: Time, Data Link ID, Priority, Report Reference, Subsystem ID, Alert Group, three
/// of stations, Type, Alert ID, Text.
pub const ALERT: u16 = 16_000;
/// The length of an alert's text with its NUL. \[bytes\]
pub const ALERT_TEXT: usize = 80;
/// Its fields.
pub const ALERT_LAYOUT: Layout = Layout {
    vector: 3,
    sizes: &[5, 4, 1, 4, 1, 1, 2, 2, 2, 1, 4, ALERT_TEXT as u8],
};
/// Heartbeat, 1 Hz, both ways.
pub const HEARTBEAT: u16 = 16_002;
/// Its fields.
pub const HEARTBEAT_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5],
};
/// Message Acknowledgement: Time, Original Time Stamp, Original Message Type, Acknowledgement Type.
pub const ACKNOWLEDGEMENT: u16 = 17_000;
/// Its fields.
pub const ACKNOWLEDGEMENT_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 5, 2, 1],
};
/// Schedule Message Update: Time, Requested Type, Frequency, Activity ID.
pub const SCHEDULE: u16 = 17_001;
/// Its fields.
pub const SCHEDULE_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 2, 3],
};
/// Generic Information Request: Time, three of stations, Message Type, …
pub const INFORMATION_REQUEST: u16 = 17_002;
/// Its fields.
pub const INFORMATION_REQUEST_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 2, 2, 2, 5, 3, 2],
};
/// Ours: Clock Request: Time, Fraction, Sequence.
pub const CLOCK_REQUEST: u16 = 52_000;
/// Its fields.
pub const CLOCK_REQUEST_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 3, 4],
};
/// Ours: Clock Report: Time, Fraction, Sequence, Original Time, its Fraction, Arrival Time, its Fraction,
/// Uncertainty, State, Uptime, its Fraction.
pub const CLOCK_REPORT: u16 = 52_001;
/// Its fields.
pub const CLOCK_REPORT_LAYOUT: Layout = Layout {
    vector: 2,
    sizes: &[5, 3, 4, 5, 3, 5, 3, 4, 1, 5, 3],
};
/// Ours: Software Version: Time, Major, Minor, Patch, Git Hash, Board, IDD.
pub const SOFTWARE_VERSION: u16 = 52_002;
/// Its fields.
pub const SOFTWARE_VERSION_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 1, 1, 1, 4, 2, 1],
};
/// Ours: Message Interval: Time, Message Type, Interval.
pub const MESSAGE_INTERVAL: u16 = 52_003;
/// Its fields.
pub const MESSAGE_INTERVAL_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 4],
};
/// The interval of a message that only asks for it.
pub const ASKS: u32 = u32::MAX;
/// Ours: Parameter Request: Time, Index, Name.
pub const PARAMETER_REQUEST: u16 = 52_004;
/// Its fields.
pub const PARAMETER_REQUEST_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 17],
};
/// The index of a request by name.
pub const BY_NAME: u16 = u16::MAX;
/// Ours: Parameter Value: Time, Index, Count, Name, Kind, Value.
pub const PARAMETER_VALUE: u16 = 52_005;
/// Its fields.
pub const PARAMETER_VALUE_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 2, 17, 1, 4],
};
/// The kind of a value that is a Float.
pub const KIND_FLOAT: u32 = 2;
/// The numbers that our own messages have: 52000 to 52015.
pub const OURS: core::ops::RangeInclusive<u16> = 52_000..=52_015;
/// Answers and reports: an answer to one of them could be answered again.
pub const ANSWERS: [u16; 7] = [
    AUTHORISATION_RESPONSE,
    VEHICLE_ID,
    INERTIAL_STATES,
    ALERT,
    ACKNOWLEDGEMENT,
    CLOCK_REPORT,
    SOFTWARE_VERSION,
];
