//! #4000: where the receiver is and how it moves.

use stanag_wire::Builder;

/// Altitude Type of heights above the ellipsoid. The standard's words for it are open to both the
/// ellipsoid and the geoid; this is the receiver's `height`.
const WGS_84: u64 = 3;
/// Degrees of half a turn. \[1e-7°\]
const HALF_TURN: i64 = 1_800_000_000;

/// Position and velocity in the receiver's units, those of NAV-PVT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// \[1e-7°\]
    pub latitude: i32,
    /// \[1e-7°\]
    pub longitude: i32,
    /// Above the ellipsoid. \[mm\]
    pub height_mm: i32,
    /// North, east, down. \[mm/s\]
    pub velocity_mm_s: [i32; 3],
}

impl Position {
    /// The data of #4000. What no field has room for is left out.
    pub(crate) fn write(&self, data: &mut Builder) {
        data.integer(1, angle(self.latitude));
        data.integer(2, angle(self.longitude));
        let height_2cm = nearest(self.height_mm.into(), 20);
        if (-(1 << 23)..1 << 23).contains(&height_2cm) {
            data.integer(3, height_2cm);
            data.unsigned(4, WGS_84);
        }
        for (field, mm_s) in (5..).zip(self.velocity_mm_s) {
            let speed = nearest(mm_s.into(), 50);
            if i16::try_from(speed).is_ok() {
                data.integer(field, speed);
            }
        }
    }
}

/// The nearest BAM of 32 bits. Half a turn east is half a turn west.
fn angle(units: i32) -> i64 {
    nearest(i64::from(units) << 31, HALF_TURN)
}

/// The nearest whole quotient, a half away from 0.
fn nearest(value: i64, unit: i64) -> i64 {
    let half = if value < 0 { -unit / 2 } else { unit / 2 };
    (value + half) / unit
}
