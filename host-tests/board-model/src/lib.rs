//! A simulated board: a crystal, the firmware's clock and the invariants that it must keep.
//!
//! *Purpose.* Hours of a board's life in a second, for the tests of the clock and for
//! `comparison`.
//!
//! *Design.* A [`Scenario`] is data: crystal, receiver, pulse, losses. It becomes a [`Run`], which
//! hands the [`Event`]s of that world to a [`Board`] in the order of their handling. The board
//! drives the very [`UtcClock`](utc_clock::UtcClock) of the firmware, and its [`Invariants`] check
//! every reading.
//!
//! *Limits.* One reader, at one priority; every interleaving of readers and writer is visited in
//! `utc-clock` (`published/preemption.rs`). The tasks of a board are never late.
#![forbid(unsafe_code)]

mod board;
mod event;
mod invariants;
mod mark;
mod run;
mod sample;
mod scenario;
mod time;

pub use board::Board;
pub use event::{Event, EventKind};
pub use invariants::{Invariants, OnViolation};
pub use mark::{good_forecast, good_mark, leap_seconds};
pub use run::Run;
pub use sample::{Sample, coverage, worst_ns};
pub use scenario::Scenario;
pub use time::{BYTE_NS, FRAME_NS, MS, PULSE_WIDTH_NS, SECOND, START, US, at_s, nominal_ns};
