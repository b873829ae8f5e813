//! Places.

use crate::bam::Bam;

/// A place on the ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Place {
    /// North of the equator. Beyond a quarter turn it is no latitude.
    pub latitude: Bam,
    /// East of Greenwich.
    pub longitude: Bam,
}
