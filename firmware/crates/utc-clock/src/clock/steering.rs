//! How the clock follows a course: what it steps, what it slews, and what it publishes of it.
//!
//! *Purpose.* The bound of the slew, and the uncertainty that a reader is given.
//!
//! *Design.* Every change of course is a new model, [`UtcClock::LEAD`] after the call that makes it,
//! with a straight line of uncertainty that is above what the crystal may do until the next one.
//!
//! *Limits.* What an error means is not known here: see `discipline`.

use timebase::{CORE_HZ, ClockState, Cycles};

use super::UtcClock;
use crate::counters::bump;
use crate::discipline::Course;
use crate::model::{self, ClockModel};
use crate::outcome::{Outcome, Source};
use crate::utc::Ppb;

/// Without a mark for so long the clock is in holdover: 2 s, or 3.5 periods of a receiver that
/// speaks more seldom.
const HOLDOVER_AFTER: u64 = 2 * CORE_HZ as u64;

/// One mark may be lost, and the next be late. In halves of a period.
const HOLDOVER_HALF_PERIODS: u64 = 7;

/// From pulse to pulse is a second; without the next one the line begins anew after so long, in
/// cycles: 1.25 s. Its straight line of uncertainty is near the curve that it stands for.
const PULSE_LASTS: u64 = CORE_HZ as u64 * 5 / 4;

/// A pulse that has not come by then will not, in cycles: 1.2 s.
const PULSE_LATE: i64 = CORE_HZ as i64 * 6 / 5;

/// The line gets a new origin at least so often: 10 s, well within the
/// 25.5 s in which a reading takes the short way.
const REBASE_AFTER: u64 = 10 * CORE_HZ as u64;

/// For so long after it was set the clock may step forward: 30 s.
const SETTLING: u64 = 30 * CORE_HZ as u64;

/// An error that is slewed away in a quarter of a second is not worth a step: 100 µs.
const LEAST_STEP_NS: i64 = 100_000;

const CYCLES_PER_MS: u64 = CORE_HZ as u64 / 1_000;

/// Cycles in which [`UtcClock::MAX_SLEW`] absorbs one ns.
const CYCLES_PER_NS_AT_MAX_SLEW: u64 = CORE_HZ as u64 / UtcClock::MAX_SLEW.0 as u64;

/// A clock that may be farther off has lost its second. \[ns\]
const LOST_SECOND_NS: u64 = 500_000_000;

// Inlined where it is called, as the rest of the clock.
impl UtcClock<'_> {
    /// Nothing is true any more of what was published.
    pub(super) fn unset(&mut self, now: Cycles) {
        if self.is_crowded(now) {
            // The next mark does it.
            return;
        }
        self.end_slew();
        self.unabsorbed_ns = 0;
        self.turned_ppb = 0.0;
        self.state = ClockState::Unset;
        self.steered_by = Source::Nothing;
        let line = ClockModel {
            quality: ClockModel::BOOT.quality,
            ..self.line_from(now)
        };
        self.steer(&line, now);
    }

    /// Tells the line anew where something is known about the second that it does not say.
    pub(super) fn publish_second(&mut self, now: Cycles) {
        let utc = self.model.utc_at(now);
        self.discipline.second_mut().tie_event(now, utc);
        let second = self.discipline.second();
        let news = (second.uncertainty_ns(), second.is_proved());
        if news.0 > self.second.0 && second.is_contradicted() {
            bump(&mut self.counters.contradictions);
        }
        if news != self.second && self.state != ClockState::Unset && !self.is_crowded(now) {
            let line = self.line_from(now);
            self.steer(&line, now);
        }
    }

    /// The course that is to be corrected, seen from a moment: the newest one, even if
    /// another one still held then.
    #[inline]
    pub(super) fn line_from(&self, at: Cycles) -> ClockModel {
        self.model.rebased(at)
    }

    #[inline]
    pub(super) fn may_step(&self, course: &Course, now: Cycles) -> bool {
        // Nobody has been promised a second before one is proved.
        let is_worth_it = course.error_ns > LEAST_STEP_NS
            || (course.error_ns < -LEAST_STEP_NS && self.discipline.second().is_open());
        is_worth_it && now < self.set_at.plus(SETTLING)
    }

    #[inline]
    pub(super) fn step(&mut self, line: &mut ClockModel, course: &Course) -> Outcome {
        self.take(course);
        self.slew = Ppb(0);
        self.unabsorbed_ns = 0;
        self.absorbs_ns = 0;
        line.base = line.base.plus_nanos(course.error_ns);
        if self.state != ClockState::Unset {
            self.count_step(course.error_ns);
        }
        Outcome::Stepped {
            by_ns: course.error_ns,
        }
    }

    pub(super) fn count_step(&mut self, by_ns: i64) {
        bump(if by_ns > 0 {
            &mut self.counters.steps_forward
        } else {
            &mut self.counters.steps_back
        });
    }

    /// Sets the slew that absorbs an error of a clock that may have been off by `before_ns`.
    #[inline]
    pub(super) fn absorb(&mut self, course: &Course, before_ns: Option<f32>, now: Cycles) {
        let before_ns = before_ns.unwrap_or(f32::MAX);
        self.take(course);
        let error_ns = course.error_ns.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        let most = error_ns.unsigned_abs().min(2_000_000);
        // ns in so many ms are so many ppb: ns · 1000 / ms.
        let rate = most * 1_000 / course.absorb_ms.max(1);
        let slew = rate.min(Self::MAX_SLEW.0.unsigned_abs()).cast_signed();
        self.slew = Ppb(if error_ns < 0 { -slew } else { slew });
        let least = u64::from(course.absorb_ms) * CYCLES_PER_MS;
        let needed = u64::from(error_ns.unsigned_abs()) * CYCLES_PER_NS_AT_MAX_SLEW;
        let lasts = needed.max(least).min(course.longest_slew);
        self.slew_ends = now.plus(Self::LEAD).plus(lasts);
        self.absorbs_ns = if needed <= lasts {
            u32::MAX
        } else {
            (lasts / CYCLES_PER_NS_AT_MAX_SLEW) as u32
        };
        // Until then the clock is no farther off than it was, if what it said was true.
        let news_ns = course.uncertainty.phase_ns + course.latency_uncertainty_ns as f32;
        let left_ns = error_ns.unsigned_abs() as f32;
        let most_ns = if left_ns > before_ns {
            left_ns
        } else {
            (before_ns - news_ns).max(0.0)
        };
        self.unabsorbed_ns = left_ns.min(most_ns) as u32;
    }

    /// The slew is over; what it could not absorb is left, and doubted.
    #[inline]
    pub(super) fn end_slew(&mut self) {
        self.slew = Ppb(0);
        self.unabsorbed_ns = self.unabsorbed_ns.saturating_sub(self.absorbs_ns);
        self.absorbs_ns = 0;
    }

    #[inline]
    fn take(&mut self, course: &Course) {
        self.frequency = course.frequency;
        self.uncertainty = course.uncertainty;
        self.latency_uncertainty_ns = course.latency_uncertainty_ns;
        self.turned_ppb = course.turned_ppb;
    }

    /// Whether the line has no room for a change of course: it keeps three models, and with two
    /// that are still to begin the third is the one in force.
    #[inline]
    pub(super) fn is_crowded(&self, now: Cycles) -> bool {
        self.before_at > now
    }

    /// From [`UtcClock::LEAD`] after `now` on, follows `line` with the rate of the hour.
    #[inline]
    pub(super) fn steer(&mut self, line: &ClockModel, now: Cycles) {
        // Never before the model that may have been read already.
        let at = now.plus(Self::LEAD).max(self.model.at);
        let rate = Ppb(self.frequency.0.saturating_add(self.slew.0));
        let mut model = ClockModel {
            mult: model::mult(rate),
            ..line.rebased(at)
        };
        if self.state != ClockState::Unset {
            self.appraise(&mut model);
        }
        self.before_at = self.model.at;
        self.model = model;
        self.timeline.publish(&self.model);
    }

    /// Writes the uncertainty into a model: what it is where that begins, and a straight line that is
    /// above it until the model is replaced.
    fn appraise(&mut self, model: &mut ClockModel) {
        let second = self.discipline.second();
        self.second = (second.uncertainty_ns(), second.is_proved());
        if self.turned_ppb > 0.0 && model.at.since(self.last_pulse) > PULSE_LATE {
            self.uncertainty.frequency_ppb += core::mem::take(&mut self.turned_ppb);
        }
        let lasts_s = (self.lasts() / CYCLES_PER_MS) as u32 as f32 * 1e-3;
        let begins_s = self.uncertainty.since_s(model.at);
        let begins_ns = self.uncertainty.after_s(begins_s);
        let ends_ns = self.uncertainty.after_s(begins_s + lasts_s);
        let phase_ns = (begins_ns as u64)
            .saturating_add(1)
            .saturating_add(self.unabsorbed_ns.into())
            .saturating_add(self.latency_uncertainty_ns.into());
        let (second_ns, is_proved) = self.second;
        model.quality.uncertainty_ns = phase_ns.saturating_add(second_ns);
        model.quality.state = if is_proved && phase_ns < LOST_SECOND_NS {
            self.state
        } else {
            ClockState::Unproved
        };
        let growth_ppb = libm::ceilf((ends_ns - begins_ns) / lasts_s) as i32;
        model.quality.growth = model::growth(Ppb(growth_ppb));
    }

    /// For how long a model is published at most before it begins anew, with the uncertainty of then.
    pub(super) const fn lasts(&self) -> u64 {
        match (self.state, self.steered_by) {
            (ClockState::Set, Source::Pulse) => PULSE_LASTS,
            (ClockState::Set, _) => HOLDOVER_AFTER,
            _ => REBASE_AFTER,
        }
    }

    pub(super) fn holdover_begins(&self) -> Cycles {
        let period = match self.steered_by {
            Source::Pulse => CORE_HZ.into(),
            _ => self.period,
        };
        let after = (HOLDOVER_HALF_PERIODS * period / 2).max(HOLDOVER_AFTER);
        self.last_accepted.plus(after)
    }
}
