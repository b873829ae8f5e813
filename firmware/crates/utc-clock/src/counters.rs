//! What became of the marks and pulses, counted by kind.
//!
//! *Purpose.* For the status line, the log and the tests.
//!
//! *Design.* One field for each kind, `u32`, wrapping: a reader compares two readings.

use crate::refusal::{PulseRefusal, Refusal};

/// Events of the clock since boot; each field wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Marks that the clock followed, those that set or stepped it included.
    pub accepted: u32,
    /// Times that the clock was set from unset.
    pub sets: u32,
    /// Steps forward of a clock that was set.
    pub steps_forward: u32,
    /// Steps back of a clock that was set.
    pub steps_back: u32,
    /// Times that the clock went into holdover.
    pub holdovers: u32,
    /// [`Refusal::Date`].
    pub date: u32,
    /// [`Refusal::Time`].
    pub time: u32,
    /// [`Refusal::Unresolved`].
    pub unresolved: u32,
    /// [`Refusal::Unconfirmed`].
    pub unconfirmed: u32,
    /// [`Refusal::Inaccurate`].
    pub inaccurate: u32,
    /// [`Refusal::Calendar`].
    pub calendar: u32,
    /// [`Refusal::TooOld`].
    pub too_old: u32,
    /// [`Refusal::LeapSecond`].
    pub leap_second: u32,
    /// [`Refusal::Stamp`].
    pub stamp: u32,
    /// [`Refusal::Backlog`].
    pub backlog: u32,
    /// [`Refusal::DuplicateEpoch`].
    pub duplicate_epoch: u32,
    /// [`Refusal::EpochBack`].
    pub epoch_back: u32,
    /// [`Refusal::Outlier`].
    pub outlier: u32,
    /// [`Refusal::Late`].
    pub late: u32,
    /// [`Refusal::Early`].
    pub early: u32,
    /// [`Refusal::Drift`].
    pub drift: u32,
    /// [`Refusal::Waited`].
    pub waited: u32,
    /// [`Refusal::Crystal`].
    pub crystal: u32,
    /// Pulses that were followed.
    pub pulses: u32,
    /// Times that the pulse began to be followed.
    pub pulse_locks: u32,
    /// [`PulseRefusal::Unnumbered`].
    pub pulse_unnumbered: u32,
    /// [`PulseRefusal::Width`].
    pub pulse_width: u32,
    /// [`PulseRefusal::Unproved`].
    pub pulse_unproved: u32,
    /// [`PulseRefusal::OffSecond`].
    pub pulse_off_second: u32,
    /// [`PulseRefusal::OffLine`].
    pub pulse_off_line: u32,
    /// [`PulseRefusal::Doubled`].
    pub pulse_doubled: u32,
    /// [`PulseRefusal::Stamp`].
    pub pulse_stamp: u32,
    /// [`PulseRefusal::Backlog`].
    pub pulse_backlog: u32,
    /// A qErr that no receiver can have, in a TIM-TP.
    pub pulse_q_err: u32,
    /// Times that the second was contradicted.
    pub contradictions: u32,
}

impl Counters {
    /// Marks that were refused, for any reason.
    #[must_use]
    pub fn refused(&self) -> u32 {
        [
            self.date,
            self.time,
            self.unresolved,
            self.unconfirmed,
            self.inaccurate,
            self.calendar,
            self.too_old,
            self.leap_second,
            self.stamp,
            self.backlog,
            self.duplicate_epoch,
            self.epoch_back,
            self.outlier,
            self.late,
            self.early,
            self.drift,
            self.waited,
            self.crystal,
        ]
        .into_iter()
        .fold(0, u32::wrapping_add)
    }

    pub(crate) fn count_refusal(&mut self, refusal: Refusal) {
        let field = match refusal {
            Refusal::Date => &mut self.date,
            Refusal::Time => &mut self.time,
            Refusal::Unresolved => &mut self.unresolved,
            Refusal::Unconfirmed => &mut self.unconfirmed,
            Refusal::Inaccurate => &mut self.inaccurate,
            Refusal::Calendar(_) => &mut self.calendar,
            Refusal::TooOld => &mut self.too_old,
            Refusal::LeapSecond => &mut self.leap_second,
            Refusal::Stamp => &mut self.stamp,
            Refusal::Backlog => &mut self.backlog,
            Refusal::DuplicateEpoch => &mut self.duplicate_epoch,
            Refusal::EpochBack => &mut self.epoch_back,
            Refusal::Outlier => &mut self.outlier,
            Refusal::Late => &mut self.late,
            Refusal::Early => &mut self.early,
            Refusal::Drift => &mut self.drift,
            Refusal::Waited => &mut self.waited,
            Refusal::Crystal => &mut self.crystal,
        };
        bump(field);
    }

    pub(crate) const fn count_pulse_refusal(&mut self, refusal: PulseRefusal) {
        bump(match refusal {
            PulseRefusal::Unnumbered => &mut self.pulse_unnumbered,
            PulseRefusal::Width => &mut self.pulse_width,
            PulseRefusal::Unproved => &mut self.pulse_unproved,
            PulseRefusal::OffSecond => &mut self.pulse_off_second,
            PulseRefusal::OffLine => &mut self.pulse_off_line,
            PulseRefusal::Doubled => &mut self.pulse_doubled,
            PulseRefusal::Stamp => &mut self.pulse_stamp,
            PulseRefusal::Backlog => &mut self.pulse_backlog,
        });
    }
}

/// One event more.
pub(crate) const fn bump(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
