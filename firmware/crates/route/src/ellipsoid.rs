//! WGS-84: how many metres a radian is.

/// Half the equator's diameter. \[m\]
pub const A_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// The first eccentricity, squared.
const E2: f64 = FLATTENING * (2.0 - FLATTENING);

/// Metres to the radian at a latitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Of latitude: the meridian's radius of curvature, M. \[m/rad\]
    pub north_m: f64,
    /// Of longitude: the parallel's radius, N cos φ. \[m/rad\]
    pub east_m: f64,
}

/// The scale at `latitude`. \[rad\]
#[must_use]
pub fn scale(latitude: f64) -> Scale {
    let sine = libm::sin(latitude);
    let w2 = 1.0 - E2 * sine * sine;
    let w = libm::sqrt(w2);
    Scale {
        north_m: A_M * (1.0 - E2) / (w2 * w),
        east_m: A_M / w * libm::cos(latitude),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equator_and_pole() {
        let equator = scale(0.0);
        assert!((equator.north_m - 6_335_439.327).abs() < 1e-3);
        assert!((equator.east_m - A_M).abs() < 1e-3);
        let pole = scale(core::f64::consts::FRAC_PI_2);
        assert!((pole.north_m - 6_399_593.626).abs() < 1e-3);
        assert!(pole.east_m.abs() < 1e-8);
    }
}
