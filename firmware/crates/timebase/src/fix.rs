//! The position of the receiver.
//!
//! The receiver's line has it from a NAV-PVT and MAVLink passes it on; the clock does not use it.
//! It is here because those two crates do not depend on each other.

/// Position and movement as they stand in a NAV-PVT, unchecked (u-blox M8 receiver description,
/// UBX-NAV-PVT).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fix {
    /// `fixType`: 0 none, 1 dead reckoning, 2 2D, 3 3D, 4 both, 5 time only.
    pub fix_type: u8,
    /// `gnssFixOK`: within the receiver's own limits.
    pub fix_ok: bool,
    /// `numSV`: satellites used.
    pub satellites: u8,
    /// `lat`, in 10⁻⁷ degrees.
    pub latitude_1e7_deg: i32,
    /// `lon`, in 10⁻⁷ degrees.
    pub longitude_1e7_deg: i32,
    /// `height`: height above the ellipsoid, in mm.
    pub height_ellipsoid_mm: i32,
    /// `hMSL`: height above mean sea level, in mm.
    pub height_msl_mm: i32,
    /// `hAcc`: horizontal accuracy, in mm.
    pub horizontal_accuracy_mm: u32,
    /// `vAcc`: vertical accuracy, in mm.
    pub vertical_accuracy_mm: u32,
    /// `gSpeed`: speed over ground, in mm/s.
    pub ground_speed_mm_s: i32,
    /// `velN`, `velE`, `velD`: velocity north, east and down, in mm/s.
    pub velocity_mm_s: [i32; 3],
    /// `headMot`: heading of motion, in 10⁻⁵ degrees.
    pub heading_1e5_deg: i32,
}
