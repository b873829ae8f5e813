//! A clock that shows UTC on a board with a GNSS receiver; it counts cycles of 168 MHz.
//!
//! *Purpose.* A receiver sends what time it was some ms ago and, if the wire is there, a pulse at
//! each second. This makes of them a clock that code of any interrupt priority can read, with
//! the uncertainty of each reading. The types that matter:
//!
//! - [`UtcClock`] is a state machine: time marks and pulses go in, and what they did comes out;
//! - [`Published`] has a [`Reading`] for any moment that was stamped, and takes no lock for it;
//! - [`Settings`] is what is known before the first mark.
//!
//! ```
//! use timebase::{CORE_HZ, CivilTime, Cycles, TimeMark, Validity};
//! use utc_clock::{ClockState, Outcome, Published, Settings, UtcClock};
//!
//! static TIMELINE: Published = Published::new();
//! const SECOND: u64 = CORE_HZ as u64;
//!
//! // One task owns the clock, and with it the only writer of the timeline.
//! let mut clock = UtcClock::new(Settings::DEFAULT, TIMELINE.take_writer().unwrap());
//!
//! // A NAV-PVT of 04:00:00 has arrived 3 s after boot, and is handled 9 ms later.
//! let mark = TimeMark {
//!     arrival: Cycles(3 * SECOND),
//!     epoch: CivilTime { year: 2026, month: 11, day: 22, hour: 4, minute: 0, second: 0, nano: 0 },
//!     t_acc_ns: 20,
//!     validity: Validity { date: true, time: true, fully_resolved: true, ..Validity::default() },
//! };
//! let now = mark.arrival.plus(SECOND * 9 / 1_000);
//! assert_eq!(clock.handle_mark(&mark, now), Outcome::Set);
//!
//! // An interrupt reads the time of something that happened 1.5 s after the arrival.
//! let reading = TIMELINE.reading_at(mark.arrival.plus(SECOND * 3 / 2));
//! assert_eq!(format!("{:.0}", reading.utc), "2026-11-22T04:00:01Z");
//! assert_eq!(reading.state, ClockState::Set);
//! // As long as the receiver's latency is not known, the clock may be off by as much.
//! assert!(reading.uncertainty_ns >= Settings::DEFAULT.latency_uncertainty_ns);
//!
//! // Two seconds without another mark: the clock runs on by itself.
//! while clock.poll_timeout() <= Cycles(6 * SECOND) {
//!     clock.handle_timeout(clock.poll_timeout());
//! }
//! assert_eq!(TIMELINE.reading_at(Cycles(6 * SECOND)).state, ClockState::Holdover);
//! ```
//!
//! *Design.*
//!
//! ```text
//! TimeMark ─▶ gate ─▶ envelope ─┐
//! PulseMark ────────▶ pulse ────┴▶ discipline ─▶ clock ─▶ Published ─▶ readers
//! ```
//!
//! `calendar` makes an instant of the receiver's fields, and `gate` decides whether a mark may be
//! believed. `envelope` follows the least latency of the marks, `pulse` the time pulse;
//! `discipline` decides which of the two says how far the clock is off, and `clock` how the
//! clock follows. It owns the timeline: a chain of `model`s, each an affine map from cycles to
//! UTC, with an uncertainty that grows as `holdover` says. `published` shares it.
//!
//! *Limits.* No I/O, and time is an argument. [`UtcClock::handle_timeout`] has to be called when
//! [`UtcClock::poll_timeout`] says. The rate of 168 MHz is [`timebase::CORE_HZ`], a constant and no
//! parameter: it is in the factors that spare the readers every division, and as a parameter it
//! would be in the type of each stamp of each crate.
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
mod refusal;
mod second;
mod settings;
mod track;
mod train;
mod utc;

pub use calendar::CalendarError;
pub use clock::UtcClock;
pub use counters::Counters;
pub use model::Reading;
pub use outcome::{Outcome, PulseOutcome, SecondProof, Source};
pub use published::{Published, Writer};
pub use refusal::{PulseRefusal, Refusal};
pub use settings::Settings;
#[doc(inline)]
pub use timebase::ClockState;
pub use utc::{Ppb, UtcNanos};
