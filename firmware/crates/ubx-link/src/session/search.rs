//! At which rate the receiver is looked for.
//!
//! *Design.* A *round* tries each of [`BAUDS`] once. After more than 100 framing errors in a second an M8
//! ignores its line for the rest of it (it reports "More than 100 frame errors, UART RX was
//! disabled"), so an attempt at a wrong rate may spoil the next one at the right rate. Therefore a round
//! that follows one without success begins one rate later.

use crate::config::{BAUD, BAUDS};

/// The search; see the [module](self).
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// The rate that both ends of the line are to have, in baud.
    own_baud: u32,
    /// Which of [`BAUDS`] the attempt is for, with our rate in the place of [`BAUD`].
    rate: usize,
    /// Attempts of this round, this one included.
    attempts: usize,
}

impl Search {
    pub(super) const fn at(own_baud: u32) -> Self {
        Self {
            own_baud,
            rate: 0,
            attempts: 1,
        }
    }

    /// In the last attempt of a round, which is for our rate.
    pub(super) const fn last_at(own_baud: u32) -> Self {
        Self {
            own_baud,
            rate: 0,
            attempts: BAUDS.len(),
        }
    }

    pub(super) const fn own_baud(&self) -> u32 {
        self.own_baud
    }

    /// The rate that the attempt is for, in baud: our rate and [`BAUD`] change places.
    pub(super) fn baud(&self) -> u32 {
        match BAUDS.get(self.rate).copied().unwrap_or(BAUD) {
            BAUD => self.own_baud,
            own if own == self.own_baud => BAUD,
            other => other,
        }
    }

    /// Whether the attempt is for our own rate.
    pub(super) fn is_at_own(&self) -> bool {
        self.baud() == self.own_baud
    }

    /// Begins the next attempt of this round; `false` if it was the last.
    pub(super) const fn begin_attempt(&mut self) -> bool {
        if self.attempts >= BAUDS.len() {
            return false;
        }
        self.attempts = self.attempts.wrapping_add(1);
        self.next_rate();
        true
    }

    /// Begins a round, after one in which the receiver was found or not.
    pub(super) const fn begin_round(&mut self, was_found: bool) {
        self.attempts = 1;
        if was_found {
            self.rate = 0;
        } else {
            // Beyond the last rate of the round before, and beyond its first.
            self.next_rate();
            self.next_rate();
        }
    }

    const fn next_rate(&mut self) {
        let next = self.rate.wrapping_add(1);
        self.rate = if next < BAUDS.len() { next } else { 0 };
    }
}
