//! Thread level: the log of a test goes to the SD card, when it is asked for.
//!
//! *Design.* What may block does so below every interrupt. Whatever happens to the card, the log stays
//! in memory, and asking again tries again.

use crate::shared::{NEWS, News};
use crate::{board, samples};

/// Why a log is not on the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum NotSaved {
    /// This board has no slot for one.
    NoSlot,
}

/// Runs for ever.
pub fn run() -> ! {
    loop {
        board::sleep_until(samples::is_save_wanted);
        samples::begin_save();
        let why = NotSaved::NoSlot;
        defmt::warn!("the log is not saved: {}", why);
        // A full queue means that nobody listens; the log has it.
        let _ = NEWS.try_send(News::NotSaved(why));
    }
}
