//! How large and how long: numbers that often are the ends of what is allowed.

use fastrand::Rng;

use crate::chance::even;

/// Anywhere between two ends.
pub(super) fn between(rng: &mut Rng, least: f64, most: f64) -> f64 {
    least + (most - least) * even(rng)
}

/// Between two ends, and often one of them; small ones are as frequent as large ones
/// where the ends are decades apart.
pub(super) fn reach(rng: &mut Rng, least: f64, most: f64) -> f64 {
    match rng.u32(..60) {
        0..10 => most,
        10..16 => least,
        16..38 if least > 0.0 => least * (most / least).powf(even(rng)),
        _ => between(rng, least, most),
    }
}

pub(super) fn either_sign(rng: &mut Rng, size: f64) -> f64 {
    if rng.bool() { size } else { -size }
}

/// To a ms, so that what is printed is what was played.
pub(super) fn whole(s: f64) -> f64 {
    (s * 1e3).round() / 1e3
}
