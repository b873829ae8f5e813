//! The clock: a state machine that marks steer.
//!
//! *Purpose.* Owns the time line: sets it at the first mark that passes the
//! gate, steers it at each later one, lets it run on when they stay away.
//!
//! *Design.* Without I/O and without a time of its own: `handle_mark` and
//! `handle_timeout` take it, `poll_timeout` says when the next timeout is due.
//! The clock is the one writer of its [`Published`] line; a change is out before
//! the call that makes it returns.
//!
//! Every change of course begins [`UtcClock::LEAD`] after the time of the call, at the
//! point of the line where the old course is then. So no reader has seen
//! anything else about any moment: readings increase strictly with their stamps,
//! who takes them, except over a step.
//!
//! An error is absorbed at the rate that the [`Discipline`] asks for, at most [`UtcClock::MAX_SLEW`], until
//! it is gone or somebody knows better; one mark alone moves the clock by 0.8 ms at most. Lateness is
//! one-sided, so a clock that was set by a late mark is behind: within `SETTLING` of being set it
//! steps *forward* instead, by what is more than `LEAST_STEP_NS`. To a pulse that is followed anew
//! it steps, either way, by what is more than [`LEAST_PULSE_STEP_NS`].
//!
//! *Limits.* A call has to end within the lead of the time that it was given. What
//! a mark's residual means is the [`Discipline`]'s business; the bound of the slew
//! is kept here, whatever it says.

mod steering;

use core::cmp::Ordering;

use timebase::{CORE_HZ, ClockState, Cycles, LeapSeconds, PulseEdge, PulseForecast, TimeMark};

use crate::counters::{Counters, bump};
use crate::discipline::{Correction, Course, Discipline, Observation};
use crate::gate::Gate;
use crate::holdover::Uncertainty;
use crate::model::{self, ClockModel};
use crate::outcome::{Outcome, PulseOutcome, SecondProof, Source};
use crate::published::Writer;
use crate::refusal::{PulseRefusal, Refusal};
use crate::settings::Settings;
use crate::utc::{Ppb, UtcNanos};

/// A receiver that speaks more seldom than each 3 s is one that is silent. \[ns\]
const LONGEST_PERIOD_NS: u32 = 3_000_000_000;

/// Without a pulse for so long the messages are what confirms the clock, in cycles: 3.5 s.
const PULSE_LOST: i64 = CORE_HZ as i64 * 7 / 2;

/// A mark that arrived longer ago is not believed: 10 s; the 32-bit stamp it
/// came with names a moment for 25.5 s.
const MAX_AGE: u64 = 10 * CORE_HZ as u64;

/// To a pulse that is followed anew the clock steps, back too, where a slew would take longer than
/// 1 s: 400 µs.
const LEAST_PULSE_STEP_NS: i64 = 400_000;

/// The clock that marks and pulses steer.
#[derive(Debug)]
pub struct UtcClock<'a> {
    timeline: Writer<'a>,
    gate: Gate,
    discipline: Discipline,
    model: ClockModel,
    /// Where the model before the newest one began, or begins.
    before_at: Cycles,
    frequency: Ppb,
    slew: Ppb,
    /// When the error that is being absorbed will be gone.
    slew_ends: Cycles,
    /// What is still to be absorbed when a slew begins, in ns: uncertainty, until it ends.
    unabsorbed_ns: u32,
    /// So much of that the slew absorbs until it ends. \[ns\]
    absorbs_ns: u32,
    uncertainty: Uncertainty,
    latency_uncertainty_ns: u32,
    turned_ppb: f32,
    /// What the line says of the second: how far it may be off, in ns, and whether it is proved.
    second: (u64, bool),
    /// Unset, set or in holdover, whatever the second.
    state: ClockState,
    set_at: Cycles,
    /// From mark to mark, the least of late, in cycles.
    period: u64,
    /// The last mark or pulse that was believed.
    last_accepted: Cycles,
    last_pulse: Cycles,
    steered_by: Source,
    last_epoch: UtcNanos,
    counters: Counters,
}

// Each method is inlined where it is called, and so built for the caller's speed: the crate itself
// is built for size, and a pulse has a budget of instructions.
impl<'a> UtcClock<'a> {
    /// From a call to the first moment at which its change of course holds: 1 ms,
    /// three orders of magnitude more than the call takes if nothing interrupts it. \[cycles\]
    pub const LEAD: u64 = CORE_HZ as u64 / 1_000;

    /// The fastest slew, beside the frequency: 400 ppm, so that with a frequency that is up to
    /// 100 ppm wrong the clock stays within 500 ppm of true time, the limit of NTP's clock
    /// discipline. In the first minutes a frequency that was learnt from a wandering floor can be
    /// more than that wrong: 209 ppm were seen (`compare`, case `correlated`).
    pub const MAX_SLEW: Ppb = Ppb::from_ppm(400);

    /// A clock that is unset and will publish through `timeline`.
    #[must_use]
    #[inline]
    pub fn new(settings: Settings, timeline: Writer<'a>) -> Self {
        Self {
            gate: Gate {
                require_confirmed: settings.require_confirmed,
                date_floor: settings.date_floor,
            },
            discipline: Discipline::new(&settings),
            model: ClockModel::BOOT,
            before_at: Cycles::BOOT,
            timeline,
            frequency: Ppb(0),
            slew: Ppb(0),
            slew_ends: Cycles::BOOT,
            unabsorbed_ns: 0,
            absorbs_ns: 0,
            uncertainty: Uncertainty {
                at: Cycles::BOOT,
                phase_ns: f32::MAX,
                frequency_ppb: 0.0,
            },
            latency_uncertainty_ns: 0,
            turned_ppb: 0.0,
            second: (u64::MAX, false),
            state: ClockState::Unset,
            set_at: Cycles::BOOT,
            period: 0,
            last_accepted: Cycles::BOOT,
            last_pulse: Cycles::BOOT,
            steered_by: Source::Nothing,
            last_epoch: UtcNanos(i64::MIN),
            counters: Counters::default(),
        }
    }

    /// Takes a mark, at most 10 s after its arrival.
    #[inline(never)] // Five times a second: it may be small.
    pub fn handle_mark(&mut self, mark: &TimeMark, now: Cycles) -> Outcome {
        let outcome = match self.admit(mark, now) {
            Ok(epoch) => self.follow(mark, epoch, now),
            Err(refusal) => Outcome::Refused(refusal),
        };
        match outcome {
            Outcome::Refused(refusal) => self.counters.count_refusal(refusal),
            _ => bump(&mut self.counters.accepted),
        }
        if self.discipline.is_crystal_beyond() && self.state != ClockState::Unset {
            self.unset(now);
        }
        self.publish_second(now);
        outcome
    }

    /// Takes an edge of the pulse's wire, at most 10 s after it.
    #[inline(never)] // The bench counts its calls.
    pub fn handle_edge(&mut self, edge: &PulseEdge, now: Cycles) -> PulseOutcome {
        let outcome = self.follow_edge(edge, now);
        if let PulseOutcome::Refused(refusal) = outcome {
            self.counters.count_pulse_refusal(refusal);
        }
        outcome
    }

    /// Takes what the receiver says about its next pulse.
    pub fn handle_forecast(&mut self, forecast: &PulseForecast) {
        if self.discipline.handle_forecast(forecast) {
            bump(&mut self.counters.pulse_q_err);
        }
    }

    /// Takes an answer to NAV-TIMELS.
    #[inline(never)] // Seldom: it may be small.
    pub fn handle_leap_seconds(&mut self, received: &LeapSeconds, now: Cycles) {
        let utc = (self.state != ClockState::Unset).then(|| self.model.utc_at(received.arrival));
        self.discipline.handle_leap_seconds(received, utc);
        self.publish_second(now);
    }

    /// The receiver has acknowledged that its pulse is high for `width_us` from the top of the
    /// second on; `None` while it has acknowledged none, so that no pulse is its. \[µs\]
    pub fn handle_pulse_width(&mut self, width_us: Option<u32>) {
        self.discipline.handle_pulse_width(width_us);
    }

    /// Whether the receiver is to be asked for NAV-TIMELS now: each 10 s until the leap count is
    /// believed and the second proved, then each 600 s, around an announced leap second, and at
    /// once when the second is contradicted. To be called at each wake-up;
    /// [`Self::poll_timeout`] does not wait for it.
    pub fn poll_leap_seconds(&mut self, now: Cycles) -> bool {
        if !self.discipline.second().may_ask(now) {
            return false;
        }
        let utc = self.model.utc_at(now);
        self.discipline.second_mut().poll_ask(now, utc)
    }

    /// Does what is due: ends a slew, begins holdover or the line anew.
    /// Nothing before [`Self::poll_timeout`].
    #[inline]
    pub fn handle_timeout(&mut self, now: Cycles) {
        if now < self.poll_timeout() {
            return;
        }
        let mut line = self.model;
        if self.slew_ends <= now.plus(Self::LEAD) {
            self.end_slew();
        }
        if self.state == ClockState::Set && self.holdover_begins() <= now {
            if let Some(frequency) = self.discipline.steady_frequency() {
                // If the crystal was not steady after all, the last one was right.
                let apart_ppb = frequency.0.saturating_sub(self.frequency.0);
                self.uncertainty.frequency_ppb += apart_ppb.unsigned_abs() as f32;
                self.frequency = frequency;
            }
            self.state = ClockState::Holdover;
            bump(&mut self.counters.holdovers);
        }
        if self.steered_by == Source::Pulse && now.since(self.last_pulse) > PULSE_LOST {
            self.steered_by = Source::Message;
        }
        if self.leap_begins().is_some_and(|at| at <= now)
            && let Some(by_ns) = self.discipline.take_leap_event()
        {
            line.base = line.base.plus_nanos(by_ns);
            self.last_epoch = self.last_epoch.plus_nanos(by_ns);
            self.count_step(by_ns);
        }
        self.steer(&line, now);
    }

    /// When [`Self::handle_timeout`] is due.
    #[must_use]
    #[inline]
    pub fn poll_timeout(&self) -> Cycles {
        let mut due = self.model.at.plus(self.lasts());
        if self.slew != Ppb(0) {
            due = due.min(Cycles(self.slew_ends.0.saturating_sub(Self::LEAD)));
        }
        if self.state == ClockState::Set {
            due = due.min(self.holdover_begins());
        }
        if let Some(at) = self.leap_begins() {
            due = due.min(at);
        }
        due.max(self.before_at)
    }

    /// When the step of an announced leap second has to be on its way, if that is near.
    fn leap_begins(&self) -> Option<Cycles> {
        let left_ns = self.discipline.second().event_due()?.since(self.model.base);
        let left_us = u64::try_from(left_ns / 1_000).unwrap_or(0);
        Some(Cycles(
            self.model
                .at
                .plus(Cycles::from_micros(left_us).0)
                .0
                .saturating_sub(Self::LEAD),
        ))
    }

    /// When the newest change of course begins, or began: [`Self::LEAD`] after the call that
    /// made it.
    #[must_use]
    pub const fn course_begins(&self) -> Cycles {
        self.model.at
    }

    /// What became of the marks and pulses.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How much faster than the crystal the clock runs, slews apart.
    #[must_use]
    pub const fn frequency(&self) -> Ppb {
        self.frequency
    }

    /// The receiver's latency that is corrected, in ns: set, or learnt under the pulse.
    #[must_use]
    pub const fn latency_ns(&self) -> i64 {
        self.discipline.latency_ns()
    }

    /// What is known about which second it is.
    #[must_use]
    pub fn second_proof(&self) -> SecondProof {
        self.discipline.second().proof()
    }

    /// What the clock is steered by.
    #[must_use]
    #[inline]
    pub fn source(&self) -> Source {
        match self.state {
            ClockState::Set => self.steered_by,
            _ => Source::Nothing,
        }
    }

    /// The epoch of a mark that is in itself and in its row worth hearing.
    #[inline]
    fn admit(&mut self, mark: &TimeMark, now: Cycles) -> Result<UtcNanos, Refusal> {
        let epoch = self.gate.judge(mark)?;
        if !is_recent(mark.arrival, now) {
            return Err(Refusal::Stamp);
        }
        if self.is_crowded(now) {
            return Err(Refusal::Backlog);
        }
        let before = core::mem::replace(&mut self.last_epoch, epoch);
        self.note_period(epoch.since(before));
        match epoch.cmp(&before) {
            Ordering::Greater => Ok(epoch),
            Ordering::Equal => Err(Refusal::DuplicateEpoch),
            Ordering::Less => Err(Refusal::EpochBack),
        }
    }

    /// How long a receiver takes from mark to mark, so that one that is lost is no alarm.
    fn note_period(&mut self, gap_ns: i64) {
        // In 32 bits, which divide by a multiplication.
        let gap_ns = gap_ns.clamp(0, LONGEST_PERIOD_NS.into()) as u32;
        let gap = Cycles::from_micros((gap_ns / 1_000).into()).0;
        if gap > 0 {
            self.period = gap
                .min(self.period.saturating_add(self.period / 4))
                .max(u64::from(CORE_HZ) / 100);
        }
    }

    fn follow(&mut self, mark: &TimeMark, epoch: UtcNanos, now: Cycles) -> Outcome {
        let mut line = self.line_from(mark.arrival);
        line.quality.leap_seconds_known = mark.validity.leap_seconds_known;
        let observed = self.observe(mark.arrival, &line);
        let correction =
            match self
                .discipline
                .handle_mark(&observed, epoch, mark.t_acc_ns, mark.busy_us)
            {
                Ok(correction) => correction,
                Err(refusal) => return Outcome::Refused(refusal),
            };
        let outcome = match correction {
            Correction::First(course) => {
                line.fraction = 0;
                self.set_at = now;
                self.step(&mut line, &course);
                bump(&mut self.counters.sets);
                Outcome::Set
            }
            Correction::Follow(course) if self.may_step(&course, now) => {
                self.step(&mut line, &course)
            }
            Correction::Step(course) => self.step(&mut line, &course),
            Correction::Follow(course) => {
                self.absorb(&course, observed.uncertainty_ns, now);
                Outcome::Slewed {
                    error_ns: course.error_ns,
                }
            }
            Correction::Renumber(by_ns) => {
                self.last_accepted = mark.arrival;
                line.base = line.base.plus_nanos(by_ns);
                self.count_step(by_ns);
                self.steer(&line, now);
                return Outcome::Stepped { by_ns };
            }
            Correction::Nothing => {
                self.last_accepted = mark.arrival;
                return Outcome::Confirmed;
            }
        };
        self.state = ClockState::Set;
        self.last_accepted = mark.arrival;
        self.steered_by = Source::Message;
        self.steer(&line, now);
        outcome
    }

    fn follow_edge(&mut self, edge: &PulseEdge, now: Cycles) -> PulseOutcome {
        if !is_recent(edge.at, now) {
            return PulseOutcome::Refused(PulseRefusal::Stamp);
        }
        if self.is_crowded(now) {
            return PulseOutcome::Refused(PulseRefusal::Backlog);
        }
        let mut line = self.model;
        let (uncertainty, rest_ns) = (self.uncertainty, self.rest_ns());
        let is_set = self.state != ClockState::Unset;
        let observe = |at: Cycles| Observation {
            at,
            published: line.utc_at(at),
            uncertainty_ns: is_set.then(|| uncertainty.at(at) + rest_ns),
        };
        let followed = match self.discipline.handle_edge(edge, observe) {
            Ok(Some(followed)) => followed,
            Ok(None) => return PulseOutcome::Candidate,
            Err(refusal) => return PulseOutcome::Refused(refusal),
        };
        let rise = followed.observed.at;
        let mut course = followed.course;
        course.error_ns = self.at_begin(&course, rise, now);
        let outcome = if followed.is_new && course.error_ns.abs() > LEAST_PULSE_STEP_NS {
            self.step(&mut line, &course);
            PulseOutcome::Stepped {
                by_ns: course.error_ns,
            }
        } else {
            self.absorb(&course, followed.observed.uncertainty_ns, now);
            PulseOutcome::Slewed {
                error_ns: course.error_ns,
            }
        };
        if self.steered_by != Source::Pulse {
            bump(&mut self.counters.pulse_locks);
        }
        bump(&mut self.counters.pulses);
        self.state = ClockState::Set;
        self.last_accepted = rise;
        self.last_pulse = rise;
        self.steered_by = Source::Pulse;
        self.steer(&line, now);
        outcome
    }

    /// A pulse is known by its fall, so that what it says holds from a tenth of a second after its
    /// rise on: by then a clock of the wrong frequency has moved. The error then, in ns.
    #[inline]
    fn at_begin(&self, course: &Course, rise: Cycles, now: Cycles) -> i64 {
        let passed = now.plus(Self::LEAD).max(self.model.at).since(rise);
        let faster = i64::from(model::mult(course.frequency)) - i64::from(self.model.mult);
        let by_ns = faster.saturating_mul(passed) >> model::SHIFT;
        course.error_ns.saturating_add(by_ns)
    }

    /// The clock as something that happened finds it.
    fn observe(&self, at: Cycles, line: &ClockModel) -> Observation {
        Observation {
            at,
            published: line.base,
            uncertainty_ns: (self.state != ClockState::Unset)
                .then(|| self.uncertainty.at(at) + self.rest_ns()),
        }
    }

    /// How far the clock may be off beside what its crystal's uncertainty says. \[ns\]
    #[inline]
    fn rest_ns(&self) -> f32 {
        self.unabsorbed_ns
            .saturating_add(self.latency_uncertainty_ns) as f32
    }
}

/// Whether something that happened at `at` is recent enough to count `now`.
fn is_recent(at: Cycles, now: Cycles) -> bool {
    now.0.checked_sub(at.0).is_some_and(|age| age <= MAX_AGE)
}
