//! Flights: what a board saw, played on the firmware's clock, and a judge of what
//! the clock said.
//!
//! *Purpose.* The question of integrity: was the clock ever beyond what it claimed?
//!
//! *Design.* A [`Flight`] is a list of [`Event`]s in true time with what the truth is
//! ([`Header`]); it is read from a file or drawn by `world`. [`player`] gives it to
//! the clock as the firmware's task does and yields a [`Reading`] each 37 ms.
//! [`judge`] and [`demands`] know readings and the truth alone, so that they judge
//! any clock.
//!
//! ```text
//! file ─▶ Flight ─▶ player ─▶ Reading ─▶ judge ─▶ Tally ─▶ demands
//! world ───┘                     truth ────┘
//! ```
#![forbid(unsafe_code)]

mod columns;
mod crystal;
pub mod demands;
mod error;
mod file;
mod header;
pub mod integrity;
pub mod judge;
pub mod player;
mod reading;
mod replayed;
mod scheduled;

pub use crystal::{Crystal, Knot};
pub use error::{Error, Problem};
pub use file::Flight;
pub use header::{Header, LeapStep, PulseShape, Window};
pub use reading::{READ_EVERY, Reading, UNSET};
pub use replayed::{Point, Replayed, replay};
pub use world::{Event, EventKind, PulseName, WorldPicos};
