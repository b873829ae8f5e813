//! Binary angular measurement.

use core::f64::consts::PI;

/// Half a turn in units. \[BAM\]
const HALF_TURN: f64 = 2_147_483_648.0;

/// An angle of 32 bits: the whole range is one turn, a unit 1.463e-9 rad, which is 9.3 mm of latitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Bam(pub i32);

impl Bam {
    /// The nearest to an angle, which may have any number of turns. \[rad\]
    ///
    /// What is no angle (NaN, infinities) gives 0.
    #[must_use]
    pub fn from_radians(radians: f64) -> Self {
        let turns = radians / (2.0 * PI);
        let part = turns - libm::floor(turns);
        // From 0 to a whole turn, so that the 64 bits keep it and the lowest 32 are the angle.
        Self(libm::round(part * 2.0 * HALF_TURN) as i64 as i32)
    }

    /// From −π to below π. \[rad\]
    #[must_use]
    pub fn radians(self) -> f64 {
        f64::from(self.0) * (PI / HALF_TURN)
    }

    /// The short way from `other` to here.
    #[must_use]
    pub const fn from(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_itself_again_after_any_turns() {
        for bam in [0, 1, -1, i32::MAX, i32::MIN, 0x1a85_958f, -0x0bf2_58bf] {
            for turns in [-3.0, 0.0, 2.0] {
                let radians = Bam(bam).radians() + turns * 2.0 * PI;
                assert_eq!(Bam::from_radians(radians), Bam(bam), "{bam} {turns}");
            }
        }
        assert_eq!(Bam::from_radians(PI), Bam(i32::MIN));
        assert_eq!(Bam::from_radians(f64::NAN), Bam(0));
    }

    #[test]
    fn the_short_way_crosses_the_antimeridian() {
        let (west, east) = (Bam(0x7ffd_1660_u32 as i32), Bam(0x8000_12fa_u32 as i32));
        assert_eq!(east.from(west), Bam(0x2fc9a));
        assert_eq!(west.from(east), Bam(-0x2fc9a));
    }
}
