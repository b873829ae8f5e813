//! What else a flight controller does while pixclock keeps time: a synthetic flight stack.
//!
//! *Purpose.* On the boards that Shim, Joo and Kim measured ran all of PX4. This crate draws when such a
//! stack keeps the core busy, for how long, and at which level, so that a board can be loaded with it
//! and a clock be measured under it.
//!
//! *Design.* A [`FlightLoad`] is a handful of sources, each with its next due moment: interrupts that read
//! sensors, sections that mask interrupts, and PX4's tasks ([`figures`] has them all, with where each
//! number is from). Whoever owns a timer asks for what is due ([`FlightLoad::poll`]) and when to ask
//! again ([`FlightLoad::poll_timeout`]). Nothing here keeps a core busy or knows a register. Times are counts of
//! a 32-bit timer that wraps, [`COUNTS_PER_US`] of them to the µs.
//!
//! ```
//! use flight_load::{COUNTS_PER_US, FlightLoad};
//!
//! let mut load = FlightLoad::new("px4".parse().unwrap(), 1, 0);
//! let mut busy = 0;
//! let mut now = 0;
//! while now < 1_000_000 * COUNTS_PER_US {
//!     now = load.poll_timeout();
//!     while let Some(job) = load.poll(now) {
//!         busy += job.counts;
//!     }
//! }
//! // More than half of the core.
//! assert!((0.5..0.6).contains(&(f64::from(busy) / f64::from(now))));
//! ```
//!
//! *Limits.* It is PX4's timing and nothing of what PX4 does: no bus, no memory, no lock that tasks wait
//! for. Sources do not know of each other. Two moments that are compared lie less than 2³¹ counts (25
//! s) apart.
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

mod chance;
mod counts;
pub mod figures;
mod lateness;
mod load;

pub use counts::COUNTS_PER_US;
pub use figures::Level;
pub use lateness::{BOUNDS_US, Lateness, PX4_AFTER, PX4_BEFORE};
pub use load::{FlightLoad, Job};
