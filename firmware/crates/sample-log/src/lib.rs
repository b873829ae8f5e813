//! What a test measures: one small record for each PING, and the file that they make.
//!
//! *Purpose.* In the experiment of Shim, Joo, Kim 2021 each flight controller stores its own time
//! at the arrival of a PING beside the PING's, and writes all of them to its SD card at the end.
//! This is that store, and that file. The types that matter:
//!
//! - [`Sample`], one PING as the board saw it, and [`Record`], the 16 bytes in which it is kept;
//! - [`SampleLog`], the samples of a test, in memory that it is given;
//! - [`Test`], the command that begins or ends a test, and [`BeginGuard`], which asks back before a
//!   log is lost by one.
//!
//! *Design.* The log has two pieces of memory, because the board's spare memory is in two places.
//! It counts the samples for which there was no room, and does not change once it is frozen.
//! [`csv`] makes any stretch of the file from the samples in it, so that a card and a radio link
//! can ask for pieces in any order, and there is no second copy.
//!
//! *Limits.* A PING's time is kept as µs since the first one's, modulo 2³²: for a test of up to
//! 71 minutes by one sender. A sequence number is kept modulo 2²⁴.
//!
//! ```
//! use sample_log::{Kept, Record, Sample, SampleLog, Test, csv};
//! use timebase::ClockState;
//!
//! let (mut first, mut second) = ([Record::EMPTY; 2], [Record::EMPTY; 1]);
//! let mut log = SampleLog::new(&mut first, &mut second);
//! log.handle_test(Test::Begins);
//! let sample = |sequence: u32| Sample {
//!     board_ns: 1_795_309_322_961_327_001 + i64::from(sequence),
//!     ping_us: 1_795_309_322_000_000,
//!     sequence,
//!     state: ClockState::Set,
//!     uncertainty_ns: 64,
//! };
//! let kept = [0, 1, 2, 3].map(|sequence| log.record(&sample(sequence)));
//! assert_eq!(kept, [Kept::Kept, Kept::Kept, Kept::Last, Kept::Full]);
//! log.handle_test(Test::Ends);
//! assert_eq!(log.record(&sample(4)), Kept::Frozen);
//!
//! // Its file has a header and three lines. Any stretch can be read, in any order.
//! assert_eq!(log.file_len() as usize, 4 * csv::LINE);
//! let mut line = [0; csv::LINE];
//! log.read_file(3 * csv::LINE as u32, &mut line);
//! assert_eq!(
//!     str::from_utf8(&line),
//!     Ok("0000000000002,1795309322000000,1795309322961327003,set,00000000000000000064\r\n")
//! );
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod begin;
pub mod csv;
mod log;
pub mod sample;

pub use begin::BeginGuard;
pub use log::{Kept, SampleLog, Test};
pub use sample::{Record, Sample};
