//! What a test measures: one small record for each PING, and the file that they make.
//!
//! *Purpose.* In the experiment of Shim, Joo, Kim 2021 each flight controller stores its own time
//! at the arrival of a PING beside the PING's, and writes all of them to its SD card at the end.
//! This is that store, and that file.
//!
//! *Design.* [`sample`] packs a [`Sample`] into 16 bytes. [`SampleLog`] keeps them in memory that
//! it is given, in two pieces, since the board's spare memory is in two places; it says how many
//! found it full, and once frozen it does not change. [`csv`] makes any stretch of the file from the
//! samples in it, so that a card and a radio link can ask for pieces in any order.
//!
//! *Limits.* A PING's time is kept as µs since the first one's, modulo 2³²: for a test of up to
//! 71 minutes by one sender. A sequence number is kept modulo 2²⁴.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

pub mod csv;
mod log;
pub mod sample;

pub use log::{Kept, SampleLog, Test};
pub use sample::{Record, Sample};
