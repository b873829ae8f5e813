//! UTC: the calendar, the gate, and the clock of base time plus elapsed cycles.
//!
//! *Purpose.* Marks and pulses of a receiver go in, a clock that every priority can
//! read comes out.
//!
//! *Design.* `calendar` turns the receiver's fields into [`UtcNanos`], `gate`
//! decides whether a mark may be believed. `envelope` follows what marks have in
//! common, `pulse` the time pulse; `discipline` decides which of them says how far
//! the clock is off, `clock` how it follows: it owns the time line, a chain of
//! `model`s, each an affine map from cycles to UTC, with a uncertainty that grows as in
//! `holdover`. `published` shares that line with readers of any priority, without
//! a lock.
//! `counters` has the kinds of refusal and how often each occurred.
//!
//! ```text
//! TimeMark ─▶ gate ─▶ envelope ─┐
//! PulseMark ────────▶ pulse ────┴▶ discipline ─▶ clock ─▶ Published ─▶ readers
//! ```
//!
//! *Limits.* No I/O and no time of its own: time is an argument. The firmware
//! calls [`UtcClock::handle_timeout`] when [`UtcClock::poll_timeout`] says.
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

mod calendar;
mod clock;
mod counters;
mod discipline;
mod drift_guard;
mod envelope;
mod gate;
mod holdover;
mod kalman;
mod model;
mod outcome;
mod published;
mod pulse;
mod refusal;
mod settings;
mod utc;

pub use calendar::CalendarError;
pub use clock::UtcClock;
pub use counters::Counters;
pub use model::Reading;
pub use outcome::{Outcome, PulseOutcome, Source};
pub use published::{Published, Writer};
pub use refusal::{PulseRefusal, Refusal};
pub use settings::Settings;
#[doc(inline)]
pub use timebase::ClockState;
pub use utc::{Ppb, UtcNanos};
