//! The u-blox receiver: what it says, and how it is told what to say.
//!
//! *Purpose.* Bytes off the line become [`Event`]s, a NAV-PVT among them a
//! [`TimeMark`](timebase::TimeMark), a TIM-TP a
//! [`PulseForecast`](timebase::PulseForecast); and the receiver is brought to 115200
//! baud and NAV-PVT alone at 5 Hz, with TIM-TP beside it when it is wanted.
//!
//! *Design.* [`Link`] finds frames by its own search and hands each whole one to
//! the crate `ublox` once. [`Session`] is the configuration: which bytes leave
//! when, at which speed, and what to do without an answer. Both are state
//! machines without I/O; time is an argument. `ublox` is not in the
//! interface.
//!
//! *Limits.* u-blox M8, protocol 15 to 23, over a UART. Only NAV-PVT, TIM-TP,
//! ACK-ACK and ACK-NAK are understood; anything else on the line is scanned through.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

pub mod config;
mod event;
mod fletcher;
mod kind;
pub mod link;
pub mod session;
mod window;

pub use event::Event;
pub use link::{Link, LinkCounters};
pub use session::{Action, Session, SessionCounters};
pub use timebase::Fix;
