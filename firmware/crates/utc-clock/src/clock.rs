//! The clock: a state machine that marks steer.
//!
//! *Purpose.* Owns the time line: sets it at the first mark that passes the
//! gate, steers it at each later one, lets it run on when they stay away.
//!
//! *Design.* Without I/O and without a time of its own: `handle_mark` and
//! `handle_timeout` are told it, `poll_timeout` says when the next timeout is due.
//! The clock is the one writer of its [`Published`] line; a change is out before
//! the call that makes it returns.
//!
//! Every change of course begins [`LEAD`] after the time of the call, at the
//! point of the line where the old course is then. So nobody has been told
//! anything else about any moment: readings increase strictly with their stamps,
//! whoever takes them, except over a step.
//!
//! An error is absorbed at 1 ns a second for each ns, at most [`MAX_SLEW`], until
//! it is gone or the next mark knows better, and for no longer than marks may
//! stay away: one mark alone, however late, moves the clock by 1 ms.
//!
//! *Limits.* A call has to end within the lead of the time that it was told. What
//! a mark's residual means is the [`Discipline`]'s business; the bound of the slew
//! is kept here, whatever it says.

use core::cmp::Ordering;
use core::sync::atomic::AtomicU32;

use timebase::{CORE_HZ, Cycles, TimeMark};

use crate::counters::bump;
use crate::discipline::{Correction, Discipline, Observation};
use crate::gate::Gate;
use crate::model::{self, Quality};
use crate::published::Word;
use crate::{ClockModel, ClockState, Counters, Ppb, Published, Refusal, UtcNanos};

/// From a call to the first moment at which its change of course holds: 1 ms,
/// three orders of magnitude more than the call takes if nothing interrupts it.
pub const LEAD: u64 = CORE_HZ as u64 / 1_000;

/// The fastest slew, beside the frequency: 500 ppm, as in NTP's clock discipline.
pub const MAX_SLEW: Ppb = Ppb::from_ppm(500);

/// Without a mark for so long the clock is in holdover: 2 s.
pub const HOLDOVER_AFTER: u64 = 2 * CORE_HZ as u64;

/// The line is told from a new origin at least so often: 10 s, well within the
/// 25.5 s in which a reading takes the short way.
pub const REBASE_AFTER: u64 = 10 * CORE_HZ as u64;

/// A mark that arrived longer ago is not believed: 10 s; the 32-bit stamp it
/// came with names a moment for 25.5 s.
pub const MAX_AGE: u64 = 10 * CORE_HZ as u64;

/// Errors are absorbed with this time constant as far as the bound allows: 1 s.
const ABSORB_IN: u64 = CORE_HZ as u64;

/// Cycles in which [`MAX_SLEW`] absorbs one ns.
const CYCLES_PER_NS_AT_MAX_SLEW: u64 = CORE_HZ as u64 / MAX_SLEW.0 as u64;

/// What the clock has to be told about its receiver and its crystal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Follow only marks whose `confirmedTime` is set.
    pub require_confirmed: bool,
    /// From the epoch to the first byte on the wire, in ns. 0 until it is known:
    /// what equal boards have in common cancels between them.
    pub latency_ns: u32,
    /// How far off that may be, in ns. 120 ms, what ArduPilot assumes for the
    /// latency of an M8, as long as the latency is taken for 0.
    pub latency_doubt_ns: u32,
    /// How much faster than the crystal the clock has to run.
    pub frequency: Ppb,
    /// How far off that may be. 50 ppm while it is taken for 0: the crystals of
    /// three such boards were measured at +37, +37 and +44 ppm.
    pub frequency_doubt: Ppb,
}

impl Settings {
    /// An M8 on a Pixhawk 1 of which nothing has been learnt.
    pub const DEFAULT: Self = Self {
        require_confirmed: false,
        latency_ns: 0,
        latency_doubt_ns: 120_000_000,
        frequency: Ppb(0),
        frequency_doubt: Ppb::from_ppm(50),
    };
}

impl Default for Settings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// What a mark did to the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It set the clock, which was unset.
    Set,
    /// The clock slews.
    Slewed {
        /// UTC less the clock as the mark had it, in ns.
        error_ns: i32,
    },
    /// The clock steps, for others have to be told.
    Stepped {
        /// What was added to it, in ns.
        by_ns: i64,
    },
    /// Nothing.
    Refused(Refusal),
}

/// The clock that marks steer, and the one writer of `line`.
#[derive(Debug)]
pub struct UtcClock<'a, W = AtomicU32> {
    line: &'a Published<W>,
    settings: Settings,
    gate: Gate,
    discipline: Discipline,
    model: ClockModel,
    growth: u32,
    frequency: Ppb,
    slew: Ppb,
    /// When the error that is being absorbed will be gone.
    slew_ends: Cycles,
    last_arrival: Cycles,
    last_epoch: UtcNanos,
    counters: Counters,
}

impl<'a, W: Word> UtcClock<'a, W> {
    /// A clock that is unset and will publish to `line`, which nobody has written
    /// to yet.
    #[must_use]
    pub fn new(settings: Settings, line: &'a Published<W>) -> Self {
        Self {
            settings,
            gate: Gate {
                require_confirmed: settings.require_confirmed,
            },
            discipline: Discipline::new(settings.frequency),
            model: ClockModel::BOOT,
            line,
            growth: model::growth(settings.frequency_doubt),
            frequency: Ppb(0),
            slew: Ppb(0),
            slew_ends: Cycles::BOOT,
            last_arrival: Cycles::BOOT,
            last_epoch: UtcNanos(i64::MIN),
            counters: Counters::default(),
        }
    }

    /// Hears a mark, at most [`MAX_AGE`] after its arrival.
    pub fn handle_mark(&mut self, mark: &TimeMark, now: Cycles) -> Outcome {
        let outcome = match self.admit(mark, now) {
            Ok(epoch) => self.follow(mark, epoch, now),
            Err(refusal) => Outcome::Refused(refusal),
        };
        match outcome {
            Outcome::Refused(refusal) => self.counters.count_refusal(refusal),
            _ => bump(&mut self.counters.accepted),
        }
        outcome
    }

    /// Does what is due: ends a slew, begins holdover, tells the line anew.
    /// Nothing before [`Self::poll_timeout`].
    pub fn handle_timeout(&mut self, now: Cycles) {
        if now < self.poll_timeout() {
            return;
        }
        let mut line = self.model;
        if self.slew_ends <= now.plus(LEAD) {
            self.slew = Ppb(0);
        }
        if line.quality.state == ClockState::Set && self.holdover_begins() <= now {
            // The last mark's opinion is not worth more than this.
            self.slew = Ppb(0);
            line.quality.state = ClockState::Holdover;
            bump(&mut self.counters.holdovers);
        }
        self.steer(&line, now);
    }

    /// When [`Self::handle_timeout`] is due.
    #[must_use]
    pub fn poll_timeout(&self) -> Cycles {
        let mut due = self.model.at.plus(REBASE_AFTER);
        if self.slew != Ppb(0) {
            due = due.min(Cycles(self.slew_ends.0.saturating_sub(LEAD)));
        }
        if self.model.quality.state == ClockState::Set {
            due = due.min(self.holdover_begins());
        }
        due
    }

    /// The newest piece of the time line.
    #[must_use]
    pub const fn model(&self) -> &ClockModel {
        &self.model
    }

    /// What became of the marks.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// The epoch of a mark that is in itself and in its row worth hearing.
    fn admit(&mut self, mark: &TimeMark, now: Cycles) -> Result<UtcNanos, Refusal> {
        let epoch = self.gate.judge(mark)?;
        let age = now.0.checked_sub(mark.arrival.0);
        if age.is_none_or(|age| age > MAX_AGE) {
            return Err(Refusal::Stamp);
        }
        let before = core::mem::replace(&mut self.last_epoch, epoch);
        match epoch.cmp(&before) {
            Ordering::Greater => Ok(epoch),
            Ordering::Equal => Err(Refusal::DuplicateEpoch),
            Ordering::Less => Err(Refusal::EpochBack),
        }
    }

    fn follow(&mut self, mark: &TimeMark, epoch: UtcNanos, now: Cycles) -> Outcome {
        let told = epoch.plus_nanos(i64::from(self.settings.latency_ns));
        // The course that is to be corrected is the newest one, even if another
        // one still held when the mark arrived.
        let (base, fraction) = self.model.point(mark.arrival);
        let mut line = ClockModel {
            at: mark.arrival,
            base,
            fraction,
            ..self.model
        };
        let outcome;
        let uncertainty_ns;
        if line.quality.state == ClockState::Unset {
            self.frequency = self.settings.frequency;
            line.base = told;
            line.fraction = 0;
            line.mult = model::mult(self.frequency);
            uncertainty_ns = mark.t_acc_ns;
            outcome = Outcome::Set;
            bump(&mut self.counters.sets);
        } else {
            match self.discipline.update(&Observation {
                told,
                published: line.base,
                t_acc_ns: mark.t_acc_ns,
            }) {
                Correction::Slew {
                    error_ns,
                    frequency,
                    uncertainty_ns: doubt_ns,
                } => {
                    self.frequency = frequency;
                    self.absorb(error_ns, now);
                    uncertainty_ns = doubt_ns;
                    outcome = Outcome::Slewed { error_ns };
                }
                Correction::Step {
                    by_ns,
                    uncertainty_ns: doubt_ns,
                } => {
                    self.slew = Ppb(0);
                    line.base = line.base.plus_nanos(by_ns);
                    uncertainty_ns = doubt_ns;
                    outcome = Outcome::Stepped { by_ns };
                    bump(if by_ns > 0 {
                        &mut self.counters.steps_forward
                    } else {
                        &mut self.counters.steps_back
                    });
                }
                Correction::Ignore => return Outcome::Refused(Refusal::Outlier),
            }
        }
        line.quality = Quality {
            state: ClockState::Set,
            leap_seconds_known: mark.validity.leap_seconds_known,
            uncertainty_ns: uncertainty_ns.saturating_add(self.settings.latency_doubt_ns),
            growth: self.growth,
        };
        self.last_arrival = mark.arrival;
        self.steer(&line, now);
        outcome
    }

    /// Sets the slew that absorbs an error.
    fn absorb(&mut self, error_ns: i32, now: Cycles) {
        self.slew = Ppb(error_ns.clamp(-MAX_SLEW.0, MAX_SLEW.0));
        let needed = u64::from(error_ns.unsigned_abs()) * CYCLES_PER_NS_AT_MAX_SLEW;
        self.slew_ends = now.plus(LEAD).plus(needed.clamp(ABSORB_IN, HOLDOVER_AFTER));
    }

    /// From [`LEAD`] after `now` on, follows `line` with the rate of the hour.
    fn steer(&mut self, line: &ClockModel, now: Cycles) {
        // Never before the model that may have been read already.
        let at = now.plus(LEAD).max(self.model.at);
        let rate = Ppb(self.frequency.0.saturating_add(self.slew.0));
        self.model = ClockModel {
            mult: model::mult(rate),
            ..line.rebased(at)
        };
        self.line.publish(&self.model);
    }

    const fn holdover_begins(&self) -> Cycles {
        self.last_arrival.plus(HOLDOVER_AFTER)
    }
}
