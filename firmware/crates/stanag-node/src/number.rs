//! The numbers and fields of the messages that are spoken here: one table.

use stanag_wire::Layout;

/// CUCS Authorisation Request.
pub const AUTHORISATION_REQUEST: u16 = 1;
/// VSM Authorisation Response: Time, VSM ID, Data Link ID, two of access, LOI authorised and granted,
/// six more, Vehicle Type and Subtype, …
pub const AUTHORISATION_RESPONSE: u16 = 2;
pub const AUTHORISATION_RESPONSE_LAYOUT: Layout = Layout {
    vector: 3,
    sizes: &[5, 4, 4, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 2, 2, 1, 2, 1, 2],
};
/// Vehicle ID: Time, VSM ID, Vehicle ID Update, Vehicle Type, Subtype, Owning ID, …
pub const VEHICLE_ID: u16 = 3;
pub const VEHICLE_ID_LAYOUT: Layout = Layout {
    vector: 2,
    sizes: &[5, 4, 4, 2, 2, 1, 16, 20, 32, 2],
};
/// Inertial States: Time, Latitude, Longitude, Altitude, its type, speeds north, east and down, …
pub const INERTIAL_STATES: u16 = 4_000;
pub const INERTIAL_STATES_LAYOUT: Layout = Layout {
    vector: 3,
    sizes: &[5, 4, 4, 3, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2],
};
/// Heartbeat, 1 Hz, both ways.
pub const HEARTBEAT: u16 = 16_002;
pub const HEARTBEAT_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5],
};
/// Message Acknowledgement: Time, Original Time Stamp, Original Message Type, Acknowledgement Type.
pub const ACKNOWLEDGEMENT: u16 = 17_000;
pub const ACKNOWLEDGEMENT_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 5, 2, 1],
};
/// Generic Information Request: Time, three of stations, Message Type, …
pub const INFORMATION_REQUEST: u16 = 17_002;
pub const INFORMATION_REQUEST_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 2, 2, 2, 5, 3, 2],
};
/// Ours: Clock Request: Time, Fraction, Sequence.
pub const CLOCK_REQUEST: u16 = 52_000;
pub const CLOCK_REQUEST_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 3, 4],
};
/// Ours: Clock Report: Time, Fraction, Sequence, Original Time, its Fraction, Arrival Time, its Fraction,
/// Uncertainty, State, Uptime, its Fraction.
pub const CLOCK_REPORT: u16 = 52_001;
pub const CLOCK_REPORT_LAYOUT: Layout = Layout {
    vector: 2,
    sizes: &[5, 3, 4, 5, 3, 5, 3, 4, 1, 5, 3],
};
/// Ours: Software Version: Time, Major, Minor, Patch, Git Hash, Board, IDD.
pub const SOFTWARE_VERSION: u16 = 52_002;
pub const SOFTWARE_VERSION_LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 1, 1, 1, 4, 2, 1],
};
