//! The clock of PX4 1.9 on NuttX 7, as Shim, Joo and Kim measured it.
//!
//! *Purpose.* Their paper, "Minimizing GPS Clock Synchronization Error for PX4-Based Unmanned
//! Aircraft" (2021), is what pixclock is compared with. This crate has the paper's clock, so that both
//! can run on the same board with the same receiver.
//!
//! *Design.* Four parts, each after the source that it names:
//!
//! * [`RateSearch`]: how PX4 finds the receiver's rate where none is set;
//! * [`Wait`]: how long PX4 sleeps between the first bytes of a message and its read;
//! * [`wakes_at`]: how long such a sleep is on NuttX, in whole ticks;
//! * [`PaperClock`]: the clock that every NAV-PVT sets, with [`BaseTime`] for its readers.
//!
//! ```
//! use paper_clock::{Outcome, PaperClock, Wait, wakes_at};
//! use timebase::{CivilTime, Cycles, TimeMark, Validity};
//!
//! // Ticks of 1 ms. The first byte of a NAV-PVT is seen after the tick at 200 ms.
//! const PERIOD: u32 = 168_000;
//! let seen = Cycles::from_micros(200_000);
//! let sleep_us = Wait::ForCharacters { baud: 115_200 }.before_read(1).unwrap();
//! let read_at = wakes_at(seen, sleep_us, PERIOD);
//! assert_eq!(read_at, Cycles::from_micros(204_000));
//!
//! // Two such sleeps later the message is complete. Its epoch becomes the time of the last tick:
//! // the clock is late by all that has passed since.
//! let mark = TimeMark {
//!     arrival: Cycles::from_micros(200_300),
//!     busy_us: 0,
//!     epoch: CivilTime { year: 2026, month: 11, day: 22, hour: 4, minute: 0, second: 0, nano: 0 },
//!     t_acc_ns: 20,
//!     validity: Validity { date: true, time: true, fully_resolved: true, ..Validity::default() },
//! };
//! let last_tick = Cycles::from_micros(212_000);
//! let mut clock = PaperClock::new();
//! assert_eq!(clock.handle_mark(&mark, last_tick), Outcome::Set);
//! let reading = clock.base_time().reading_at(last_tick);
//! assert_eq!(reading.utc.to_string(), "2026-11-22T04:00:00.000000000Z");
//! ```
//!
//! *Limits.* What would make a PX4 worse is left out: the messages that it asks for beside NAV-PVT, and the
//! chip's RTC, which `clock_settime` sets too. Ticks that are lost and tasks that are late are the board's.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod clock;
mod search;
mod sleep;
mod wait;

pub use clock::{BaseTime, Outcome, PaperClock, Refusal};
pub use search::{RATES, RateSearch};
pub use sleep::wakes_at;
pub use wait::{CHARACTERS, Wait};
