//! What says a route on the wire: the data of STANAG 4586's messages and ours, and MAVLink's items.
//!
//! *Design.* A message is a value with `read` and `write`; the frame around its data is `stanag_wire`'s.
//! Of #13001 and #13002 the fields are read that a route needs. Three forms of a curve: ours as Edition 3
//! would have it ([`CurveMessage`], #52010 flat and #52012 with altitudes), that of the study which
//! proposed curves ([`StudyCurve`], #52011), and two items before a waypoint in MAVLink
//! ([`MissionItem`]).

mod curve;
mod mission_item;
mod route;
mod study;
mod waypoint;

pub use curve::{CurveMessage, Handles};
pub use mission_item::{MissionItem, curve_items, curve_of_items};
pub use route::RouteMessage;
pub use study::StudyCurve;
pub use waypoint::{Altitude, Speed, Waypoint};
