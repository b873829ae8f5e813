//! Routes with curves: waypoints, cubic Bézier segments between them, and the messages that say these.
//!
//! *Purpose.* Neither STANAG 4586 nor MAVLink can say a curve by its ends and two handles. Here such a
//! curve is a value: what it is long, where it leads, how it is divided, checked and flown by one that
//! knows straight lines alone.
//!
//! *Design.* A [`Place`] is two angles as STANAG 4586 has them, [`Bam`]: their wrapping difference is
//! the short way round, so that the antimeridian needs no code. A [`Curve`] is B(t) in the plane of
//! latitude and longitude, both in radians and the longitudes from P1's (`lyon_geom`); what is in metres
//! is measured on the WGS-84 [ellipsoid]. [`message`] has its wire forms.
//!
//! ```
//! use route::{Bam, Curve, Place};
//!
//! let place = |latitude, longitude| Place { latitude: Bam(latitude), longitude: Bam(longitude) };
//! // A corner of 50 m: north, then east.
//! let curve = Curve::new([
//!     place(0x1a85958f, 0x5a744594),
//!     place(0x1a85a127, 0x5a744594),
//!     place(0x1a85aa8e, 0x5a745158),
//!     place(0x1a85aa8e, 0x5a745fdc),
//! ])
//! .unwrap();
//! assert!((curve.length_m() - 78.551_710_6).abs() < 1e-6);
//! let heading = curve.heading(0.5).unwrap().to_degrees();
//! assert!((heading - 44.997_446).abs() < 1e-6);
//! // Straight pieces that stay within 0.1 m.
//! assert_eq!(curve.pieces(0.1), Some(14));
//! ```
//!
//! *Limits.* Latitudes to 85°; a curve that spans more than half a turn of longitude cannot be said.
//! Altitudes are carried, not flown.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

#[cfg(test)]
extern crate std;

mod bam;
mod curve;
pub mod ellipsoid;
mod integral;
pub mod message;
mod place;
mod refusal;

pub use bam::Bam;
pub use curve::{Bounds, Curve};
pub use place::Place;
pub use refusal::Refusal;
