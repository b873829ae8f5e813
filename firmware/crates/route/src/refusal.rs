//! What is no route.

use core::fmt;

/// Why points make no curve, or messages no route.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A point is beyond 85° north or south: near a pole the plane of latitude and longitude says
    /// little of the ground.
    Latitude,
    /// The waypoint that a curve leaves names another one as its next than the one it arrives at.
    NotNext,
    /// A waypoint or handle without a place, or with one that is relative to something else.
    NoPlace,
    /// The data are not as their message has them.
    Data,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Latitude => "a point beyond 85 degrees of latitude",
            Self::NotNext => "the curve's last waypoint is not the next of its first",
            Self::NoPlace => "a waypoint or handle without a place of its own",
            Self::Data => "the data are not as their message has them",
        })
    }
}

impl core::error::Error for Refusal {}
