//! What a clock promises, checked at every reading.
//!
//! *Purpose.* Later stamps have later readings. The clock runs at its own frequency and at most
//! [`UtcClock::MAX_SLEW`] beside it, except over the steps that it reported, which are as large as reported.
//! Its frequency is no worse than the crystal's own error and a margin. An uncertainty is never 0.
//!
//! *Design.* The board reports the clock's course after each call ([`Invariants::push`]).
//! A reading is held against the one before over the courses in between.
//!
//! *Limits.* Readings come in the order of their stamps.

use timebase::{CORE_HZ, Cycles};
use utc_clock::{ClockState, Reading, UtcClock, UtcNanos};

use crate::time::SECOND;

/// How much worse than the crystal's own error a frequency may be: an estimator of ±50 ppm needs
/// that much to learn. \[ppb\]
const MARGIN_PPB: f64 = 100_000.0;
/// The rounding of two readings. \[ns\]
const ROUNDING_NS: i128 = 2;

/// What a violation does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnViolation {
    /// It is a panic that describes it: for tests.
    Panic,
    /// It is counted, and the first is kept: for statistics.
    Count,
}

/// Whether the clock steps where a course begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step {
    /// No.
    None,
    /// By that much, as reported. \[ns\]
    By(i64),
    /// From being unset.
    Set,
}

/// How the timeline goes on from a moment.
#[derive(Clone, Copy, Debug)]
struct Course {
    at: Cycles,
    /// How much faster than nominal cycles the clock runs from there, slews apart. \[ppb\]
    frequency_ppb: i32,
    step: Step,
}

/// A reading to be checked, and what stands beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Checked {
    /// The stamp of the reading.
    pub now: Cycles,
    /// True time since the start. \[ns\]
    pub at_ns: i64,
    /// The whole reading.
    pub reading: Reading,
    /// UTC of the same stamp, the short way.
    pub utc: UtcNanos,
    /// The clock's frequency. \[ppb\]
    pub frequency_ppb: i32,
    /// The frequency that compensates the crystal. \[ppb\]
    pub right_ppb: f64,
}

/// The invariants of one clock, and what became of them.
#[derive(Debug)]
pub struct Invariants {
    /// How much worse than the crystal's own error the frequency may be, 100 ppm unless it is set;
    /// infinite where the crystal is not known. \[ppb\]
    pub margin_ppb: f64,
    on_violation: OnViolation,
    last: Option<Checked>,
    courses: Vec<Course>,
    violations: u32,
    first: Option<String>,
}

impl Invariants {
    /// Those of a clock that was just started.
    #[must_use]
    pub fn new(on_violation: OnViolation) -> Self {
        let boot = Course {
            at: Cycles::BOOT,
            frequency_ppb: 0,
            step: Step::None,
        };
        Self {
            margin_ppb: MARGIN_PPB,
            on_violation,
            last: None,
            courses: vec![boot],
            violations: 0,
            first: None,
        }
    }

    /// How many readings broke an invariant, and what the first did.
    #[must_use]
    pub fn violations(&self) -> (u32, Option<&str>) {
        (self.violations, self.first.as_deref())
    }

    /// Takes the course that the clock is on since the last call.
    pub(crate) fn push(&mut self, clock: &UtcClock<'_>, step: Step) {
        self.push_course(Course {
            at: clock.course_begins(),
            frequency_ppb: clock.frequency().0,
            step,
        });
    }

    fn push_course(&mut self, course: Course) {
        // Courses before the one in force at the last reading matter no more.
        if let Some(last) = self.last {
            let in_force = self.in_force(last.now);
            self.courses.drain(..in_force);
        }
        self.courses.push(course);
    }

    /// The index of the course that was in force at `then`.
    fn in_force(&self, then: Cycles) -> usize {
        let index = self.courses.iter().rposition(|course| course.at <= then);
        index.unwrap_or(0)
    }

    /// Checks a reading.
    ///
    /// # Panics
    ///
    /// At a violation, with [`OnViolation::Panic`].
    pub(crate) fn check(&mut self, checked: &Checked) {
        if let Err(violation) = self.judge(checked) {
            let described = format!("at {} ns {violation}", checked.at_ns);
            assert!(self.on_violation == OnViolation::Count, "{described}");
            self.violations += 1;
            self.first.get_or_insert(described);
        }
        self.last = Some(*checked);
    }

    fn judge(&self, checked: &Checked) -> Result<(), String> {
        let reading = &checked.reading;
        if reading.utc != checked.utc {
            return Err("UTC differs from the whole reading".to_owned());
        }
        if reading.state != ClockState::Unset {
            if reading.uncertainty_ns == 0 {
                return Err("the uncertainty is 0".to_owned());
            }
            let off_ppb = f64::from(checked.frequency_ppb) - checked.right_ppb;
            if off_ppb.abs() > checked.right_ppb.abs() + self.margin_ppb {
                return Err(format!("the frequency is off by {off_ppb} ppb"));
            }
        }
        match self.last {
            Some(before) if before.now < checked.now => self.judge_advance(&before, checked),
            _ => Ok(()),
        }
    }

    /// Judges how far the clock went from one reading to a later one.
    fn judge_advance(&self, before: &Checked, after: &Checked) -> Result<(), String> {
        let (then, now) = (before.now, after.now);
        let courses = &self.courses[self.in_force(then)..];
        let mut steps_ns = 0;
        let mut is_set_meanwhile = false;
        let (mut slowest_ppb, mut fastest_ppb) = (i32::MAX, i32::MIN);
        for course in courses.iter().take_while(|course| course.at <= now) {
            slowest_ppb = slowest_ppb.min(course.frequency_ppb);
            fastest_ppb = fastest_ppb.max(course.frequency_ppb);
            match course.step {
                Step::By(ns) if course.at > then => steps_ns += ns,
                Step::Set if course.at > then => is_set_meanwhile = true,
                _ => {}
            }
        }
        let passed_ns = after.utc.since(before.utc);
        // A clock that became unset, because its crystal is beyond its promise, is set to any time.
        if passed_ns <= 0 && steps_ns >= 0 && !is_set_meanwhile {
            let utc = after.utc;
            return Err(format!("the reading {utc} is no later than the one before"));
        }
        if is_set_meanwhile {
            return Ok(());
        }
        let in_ns = i128::from(now.since(then)) * i128::from(SECOND) / i128::from(CORE_HZ);
        let ahead_ns = i128::from(passed_ns) - in_ns - i128::from(steps_ns);
        let of_ppb = |ppb: i64| in_ns * i128::from(ppb) / i128::from(SECOND);
        let slew_ppb = i64::from(UtcClock::MAX_SLEW.0);
        let least = of_ppb(i64::from(slowest_ppb) - slew_ppb) - ROUNDING_NS;
        let most = of_ppb(i64::from(fastest_ppb) + slew_ppb) + ROUNDING_NS;
        if !(least..=most).contains(&ahead_ns) {
            return Err(format!(
                "the clock is ahead by {ahead_ns} ns in {in_ns} ns, {least} to {most} ns are allowed"
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::{MS, START};

    const PERIOD_NS: i64 = 10 * MS;

    /// Readings of a clock that runs `ppb` beside a frequency of `frequency_ppb` on a right
    /// crystal, each 10 ms for a second, and steps by `step_ns` in the middle; `reported` of it
    /// are.
    fn run(ppb: i64, frequency_ppb: i32, step_ns: i64, reported: Step) -> Invariants {
        let mut invariants = Invariants::new(OnViolation::Count);
        let course = |at: Cycles, step| Course {
            at,
            frequency_ppb,
            step,
        };
        invariants.push_course(course(Cycles::BOOT, Step::Set));
        for number in 1..=100 {
            let at_ns = number * PERIOD_NS;
            let now = Cycles::from_nanos(at_ns.unsigned_abs());
            if number == 50 {
                invariants.push_course(course(now, reported));
            }
            let stepped_ns = if number >= 50 { step_ns } else { 0 };
            let rate_ppb = ppb + i64::from(frequency_ppb);
            let utc = START.plus_nanos(at_ns + at_ns * rate_ppb / SECOND + stepped_ns);
            invariants.check(&Checked {
                now,
                at_ns,
                reading: Reading {
                    utc,
                    state: ClockState::Set,
                    uncertainty_ns: 1_000,
                    leap_seconds_known: true,
                },
                utc,
                frequency_ppb,
                right_ppb: 0.0,
            });
        }
        invariants
    }

    fn first(invariants: &Invariants) -> String {
        invariants.violations().1.unwrap_or_default().to_owned()
    }

    #[test]
    fn a_clock_may_slew_by_400_ppm_and_by_450_it_may_not() {
        for ppb in [400_000, -400_000] {
            for frequency_ppb in [0, 37_000, -90_000] {
                let allowed = run(ppb, frequency_ppb, 0, Step::None);
                assert_eq!(allowed.violations(), (0, None));
                let fast = run(ppb / 8 * 9, frequency_ppb, 0, Step::None);
                // All but the first reading, which has none before it.
                assert_eq!(fast.violations().0, 99, "{}", first(&fast));
            }
        }
        let described = first(&run(450_000, 0, 0, Step::None));
        assert_eq!(
            described,
            "at 20000000 ns the clock is ahead by 4500 ns in 10000000 ns, -4002 to 4002 ns are allowed"
        );
    }

    #[test]
    fn a_step_has_to_be_reported_as_it_is() {
        for step_ns in [-18 * SECOND, -MS, MS, 18 * SECOND] {
            let reported = run(0, 0, step_ns, Step::By(step_ns));
            assert_eq!(reported.violations(), (0, None));
            for wrong in [Step::None, Step::By(step_ns + 10 * MS)] {
                assert_eq!(run(0, 0, step_ns, wrong).violations().0, 1, "{step_ns}");
            }
        }
        assert!(first(&run(0, 0, -SECOND, Step::None)).contains("no later than"));
    }

    #[test]
    fn a_frequency_may_be_100_ppm_worse_than_none() {
        assert_eq!(run(0, 100_000, 0, Step::None).violations(), (0, None));
        assert_eq!(run(0, -100_001, 0, Step::None).violations().0, 100);
    }

    #[test]
    #[should_panic(expected = "the uncertainty is 0")]
    fn a_violation_is_a_panic_where_it_has_to_be() {
        let reading = Reading {
            utc: START,
            state: ClockState::Set,
            uncertainty_ns: 0,
            leap_seconds_known: true,
        };
        Invariants::new(OnViolation::Panic).check(&Checked {
            now: Cycles::BOOT,
            at_ns: 0,
            reading,
            utc: START,
            frequency_ppb: 0,
            right_ppb: 0.0,
        });
    }
}
