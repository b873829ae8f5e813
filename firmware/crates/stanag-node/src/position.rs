//! #4000: where the receiver is and how it moves.

use stanag_wire::Builder;
use timebase::Fix;

/// Altitude Type of heights above the ellipsoid. The standard's words for it are open to both the
/// ellipsoid and the geoid; this is the receiver's `height`.
const WGS_84: u64 = 3;
/// Degrees of half a turn. \[1e-7°\]
const HALF_TURN: i64 = 1_800_000_000;

/// Adds what is known of `fix`. What no field has room for is left out, and so is the height of a fix
/// that has none.
pub(crate) fn write(fix: &Fix, data: &mut Builder) {
    if !fix.fix_ok || !(2..=4).contains(&fix.fix_type) {
        return;
    }
    data.integer(1, angle(fix.latitude_1e7_deg));
    data.integer(2, angle(fix.longitude_1e7_deg));
    let height_2cm = nearest(fix.height_ellipsoid_mm.into(), 20);
    if fix.fix_type != 2 && (-(1 << 23)..1 << 23).contains(&height_2cm) {
        data.integer(3, height_2cm);
        data.unsigned(4, WGS_84);
    }
    for (field, mm_s) in (5..).zip(fix.velocity_mm_s) {
        let speed = nearest(mm_s.into(), 50);
        if i16::try_from(speed).is_ok() {
            data.integer(field, speed);
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
