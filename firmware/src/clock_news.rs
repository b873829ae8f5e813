//! What is new about the clock, in the log and as [`ClockEvent`]s.
//!
//! *Purpose.* What the clock knows and does not know is reported when it changes: the proof of its second,
//! its source, and that it runs on by itself.
//!
//! *Design.* The GNSS task shows the clock after each change; what differs from the last time is
//! reported. That it is set and that it steps are reported by the task itself, because no two states show it.

use timebase::ClockState;
use utc_clock::{SecondProof, Source, UtcClock};

use crate::clock_events::{self, ClockEvent};

/// What was reported last.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ClockNews {
    state: ClockState,
    second: SecondProof,
    source: Source,
}

impl ClockNews {
    /// Nothing has been reported of a clock that is unset.
    pub const fn new() -> Self {
        Self {
            state: ClockState::Unset,
            second: SecondProof::Open,
            source: Source::Nothing,
        }
    }

    /// Tells what has changed; `state` is what readers of `clock` are given now.
    pub fn note(&mut self, clock: &UtcClock<'_>, state: ClockState) {
        let before = *self;
        *self = Self {
            state,
            second: clock.second_proof(),
            source: clock.source(),
        };
        if *self != before {
            self.report(before);
        }
    }

    #[inline(never)]
    fn report(self, before: Self) {
        if self.state != before.state || self.second != before.second {
            self.report_state(before);
        }
        match (before.source == Source::Pulse, self.source == Source::Pulse) {
            (false, true) => {
                defmt::info!("the pulse steers the clock");
                clock_events::push(ClockEvent::PulseFollowed);
            }
            (true, false) => {
                defmt::warn!("the pulse does not steer the clock any more");
                clock_events::push(ClockEvent::PulseLost);
            }
            _ => {}
        }
    }

    fn report_state(self, before: Self) {
        let event = match (before.state, self.state) {
            (_, ClockState::Unset) => return,
            (_, ClockState::Unproved)
                if self.second == SecondProof::Contradicted && self.second != before.second =>
            {
                defmt::warn!("the receiver contradicts the second");
                ClockEvent::SecondContradicted
            }
            (ClockState::Unproved, ClockState::Unproved) => return,
            (_, ClockState::Unproved) => {
                defmt::warn!("the second is not proved");
                ClockEvent::SecondUnproved
            }
            (ClockState::Unproved | ClockState::Unset, _) => {
                defmt::info!("the second is proved");
                ClockEvent::SecondProved
            }
            (ClockState::Set, ClockState::Holdover) => {
                defmt::warn!("no receiver steers the clock any more");
                ClockEvent::Holdover
            }
            (ClockState::Holdover, ClockState::Set) => {
                defmt::info!("a receiver steers the clock again");
                ClockEvent::SteeredAgain
            }
            _ => return,
        };
        clock_events::push(event);
    }
}
