//! Time since boot, and the words in which the rooms of the firmware tell each
//! other what happened when.
//!
//! *Purpose.* One unit for everything that is stamped: [`Cycles`] of the core
//! clock since boot. A UART byte, a pulse capture and a tick are all told in it,
//! exactly and without a division.
//!
//! *Design.* [`tick`] extends a 24-bit down-counter (SysTick) to 64 bits and
//! repairs the ticks that were lost while interrupts were masked, with a second
//! counter of the same clock (TIM5) as witness. [`cycles`] has the unit and its
//! conversions. [`capture`] extends a 16-bit input capture to it. [`mark`] has what
//! the receiver's line and its pulse tell the clock.
//! [`ClockState`] is whether a clock may be believed.
//!
//! *Limits.* Pure values and arithmetic: registers are reached through the
//! trait [`tick::CounterPair`], which the firmware's time driver implements.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

pub mod capture;
pub mod cycles;
mod division;
mod fix;
pub mod mark;
mod state;
pub mod tick;

pub use cycles::{CORE_HZ, Cycles, Stamp, StampedByte};
pub use division::divide;
pub use fix::Fix;
pub use mark::{CivilTime, PulseForecast, PulseMark, TimeMark, Validity};
pub use state::ClockState;
