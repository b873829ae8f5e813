//! Time since boot in cycles of a 168 MHz core clock, exact to one cycle.
//!
//! *Purpose.* One unit for everything that happens on the board. A received byte, an edge of the
//! time pulse and a tick each carry the moment at which they happened, so that no other crate has
//! to ask what time it is. The types that matter:
//!
//! - [`Cycles`], 64 bits since boot, and [`Stamp`], its low word, which an interrupt can afford;
//! - [`tick::CounterPair`], the two hardware counters from which they are read;
//! - [`TimeMark`] and [`PulseEdge`], what the receiver's line and its time pulse give to the clock.
//!
//! *Design.* [`tick`] extends a 24-bit down-counter (SysTick) to 64 bits, with a second counter of
//! the same clock (TIM5) as a witness of the ticks that were lost while interrupts were masked.
//! [`capture`] extends a 16-bit input capture (TIM4). [`divide`] converts units without a 64-bit
//! division, which this core does not have.
//!
//! *Limits.* The rate is [`CORE_HZ`], a constant: conversions are then products with constants. For
//! a core of another rate, change it there. The crate has no registers and no globals;
//! values that other crates exchange ([`ClockState`], [`Fix`]) are here because those crates do not
//! depend on each other.
//!
//! ```
//! use core::cell::Cell;
//! use timebase::tick::{self, CounterPair, Word};
//! use timebase::{CORE_HZ, Cycles, StampedByte};
//!
//! /// Hardware that has run for some cycles, and the words that the tick interrupt shares.
//! #[derive(Default)]
//! struct Board(Cell<u64>, [Cell<u32>; 4]);
//!
//! impl CounterPair for Board {
//!     const PERIOD: u32 = CORE_HZ / 1_000;
//!     const RATIO: u32 = 2;
//!
//!     fn read_pair(&self) -> (u32, u32) {
//!         let since_wrap = (self.0.get() % u64::from(Self::PERIOD)) as u32;
//!         (self.read_witness(), (Self::PERIOD - since_wrap) % Self::PERIOD)
//!     }
//!     fn read_witness(&self) -> u32 {
//!         (self.0.get() / 2) as u32
//!     }
//!     fn load(&self, word: Word) -> u32 {
//!         self.1[word as usize].get()
//!     }
//!     fn store(&self, word: Word, value: u32) {
//!         self.1[word as usize].set(value);
//!     }
//!     fn masked<R>(&self, section: impl FnOnce() -> R) -> R {
//!         section()
//!     }
//! }
//!
//! let board = Board::default();
//! tick::start(&board);
//! // No tick interrupt runs for 5.25 ms, yet no cycle is lost.
//! board.0.set(5_250 * 168 + 1);
//! assert_eq!(tick::now(&board), Cycles(5_250 * 168 + 1));
//! assert_eq!(tick::now(&board).as_micros(), 5_250);
//!
//! // An interrupt stamps a byte, and a task finds out later when that was.
//! let byte = StampedByte { stamp: tick::stamp(&board), byte: 0xb5 };
//! let later = tick::now(&board).plus(u64::from(CORE_HZ));
//! assert_eq!(byte.stamp.extend(later), Cycles(5_250 * 168 + 1));
//! ```
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
pub use mark::{
    CivilTime, LeapEvent, LeapSeconds, Polarity, PulseEdge, PulseForecast, TimeMark, Validity,
};
pub use state::ClockState;
