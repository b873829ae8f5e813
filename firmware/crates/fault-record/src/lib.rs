//! What a fault leaves behind for the run after it, and when a board stops restarting.
//!
//! *Purpose.* A [`Record`] is a fault in [`WORDS`] words that outlive a reset: what happened, where, the
//! registers, and a checksum, because such words may hold anything after power-on. [`History`]
//! counts restarts for one reason, and says when there were enough.
//!
//! *Design.* Values only: where the words are kept, how the board restarts and who gets it is the
//! firmware's. A record is written once, by the fault; the run after it marks it as reported. A run that
//! finds a reported record did not follow a fault, so it forgets the history: somebody has pressed the
//! button, or turned the power off and on.
//!
//! *Limits.* Between two faults only the runs' own time is counted, not the bootloader's: it waits 5 s
//! when there is USB, so [`WINDOW_MS`] may take 10 s longer by the clock on the wall.
#![no_std]
#![forbid(unsafe_code)]

mod history;
mod reason;
mod record;

pub use history::{History, RESTARTS, WINDOW_MS};
pub use reason::{Hang, Reason};
pub use record::{Place, Record, Registers, WORDS};
