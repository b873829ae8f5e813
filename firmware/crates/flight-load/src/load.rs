//! Which piece of the load is due when.
//!
//! *Design.* A source is due once in each of its periods: a task at the period's end, after a phase that the
//! seed draws; a stretch of interrupts or masks anywhere from 0 to two mean gaps after the one before. The
//! load's level scales every rate alike. What is due is handed out source by source, however late it is asked
//! for.
//!
//! *Limits.* Who asks late gets the backlog at once: nothing is left out, since what a task has to do does not
//! become less while it waits.

use variant::{Load, LoadParts};

use crate::chance::Chance;
use crate::counts::COUNTS_PER_US;
use crate::figures::{INTERRUPTS, LONGER_IN, Level, MASKED, Stretches, TASKS, Tail, Task};

/// A piece of the load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Where.
    pub level: Level,
    /// For how long the core is kept busy. \[counts of the timer\]
    pub counts: u32,
}

/// The most sources: [`INTERRUPTS`], [`MASKED`] and [`TASKS`].
const SOURCES: usize = 2 + TASKS.len();

/// The load of a board.
#[derive(Clone, Debug)]
pub struct FlightLoad {
    sources: [Source; SOURCES],
    /// The earliest of what is due next.
    due: u32,
}

#[derive(Clone, Copy, Debug)]
struct Source {
    kind: Kind,
    /// The mean time from one to the next; `None`: it never is due. \[counts\]
    period: Option<u32>,
    due: u32,
    chance: Chance,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Stretches(Level, Tail),
    Task(&'static Task),
}

/// From look to look where nothing is due, in counts: 10 s.
const IDLE: u32 = 10_000_000 * COUNTS_PER_US;

impl FlightLoad {
    /// The load `load`, drawn from `seed`, beginning at `now`.
    #[must_use]
    pub fn new(load: Load, seed: u32, now: u32) -> Self {
        let mut streams = 0..;
        let mut source = |kind, rate_hz, is_part: bool| {
            let mut chance = Chance::new(seed, streams.next().unwrap_or_default());
            let period = is_part.then(|| period(rate_hz, load.percent())).flatten();
            let phase = chance.below(period.unwrap_or_default());
            Source {
                kind,
                period,
                due: now.wrapping_add(phase),
                chance,
            }
        };
        let LoadParts {
            interrupts,
            masked,
            tasks,
        } = load.parts();
        let stretches = |level, of: &Stretches| (Kind::Stretches(level, of.tail), of.rate_hz);
        let (first, first_hz) = stretches(Level::Interrupt, &INTERRUPTS);
        let (second, second_hz) = stretches(Level::Masked, &MASKED);
        let mut sources = [
            source(first, first_hz, interrupts),
            source(second, second_hz, masked),
        ]
        .into_iter();
        let mut of_tasks = TASKS.iter();
        let all = [(); SOURCES].map(|()| {
            sources.next().or_else(|| {
                let task = of_tasks.next()?;
                Some(source(Kind::Task(task), task.rate_hz, tasks))
            })
        });
        let never = Source {
            kind: first,
            period: None,
            due: now,
            chance: Chance::new(seed, 0),
        };
        let mut load = Self {
            sources: all.map(|source| source.unwrap_or(never)),
            due: now,
        };
        load.find_due(now);
        load
    }

    /// What is due by `now`, one piece a call. Call until it is `None`.
    pub fn poll(&mut self, now: u32) -> Option<Job> {
        if is_before(now, self.due) {
            return None;
        }
        for source in &mut self.sources {
            let Some(period) = source.period else {
                continue;
            };
            if !is_before(now, source.due) {
                return Some(source.take(period));
            }
        }
        self.find_due(now);
        None
    }

    /// When to call [`Self::poll`] again. After it has returned `None`.
    #[must_use]
    pub const fn poll_timeout(&self) -> u32 {
        self.due
    }

    fn find_due(&mut self, now: u32) {
        let mut due = now.wrapping_add(IDLE);
        for source in &self.sources {
            if source.period.is_some() && is_before(source.due, due) {
                due = source.due;
            }
        }
        self.due = due;
    }
}

impl Source {
    /// The piece that is due, and when the next is.
    fn take(&mut self, period: u32) -> Job {
        match self.kind {
            Kind::Stretches(level, tail) => {
                let gap = self.chance.below(period.saturating_mul(2));
                self.due = self.due.wrapping_add(gap);
                let counts = draw(tail, &mut self.chance);
                Job { level, counts }
            }
            Kind::Task(task) => {
                self.due = self.due.wrapping_add(period);
                let us = run_time_us(task, &mut self.chance);
                Job {
                    level: task.level,
                    counts: us.saturating_mul(COUNTS_PER_US),
                }
            }
        }
    }
}

/// The period of `rate_hz` at `px4`, at `percent`; `None` if that is never. \[counts\]
fn period(rate_hz: u32, percent: u8) -> Option<u32> {
    let at_px4 = u64::from(1_000_000 * COUNTS_PER_US) * u64::from(Load::PX4_PERCENT);
    let period = at_px4.checked_div(u64::from(rate_hz) * u64::from(percent))?;
    u32::try_from(period).ok()
}

/// A length from its tail. \[counts\]
fn draw(tail: Tail, chance: &mut Chance) -> u32 {
    let share = chance.next() as f32 / u32::MAX as f32;
    for pair in tail.windows(2) {
        if let &[(from, above), (to, below)] = pair
            && share >= below
        {
            let span = ((to - from) * COUNTS_PER_US) as f32;
            let beyond = span * (above - share) / (above - below);
            return from * COUNTS_PER_US + beyond.clamp(0.0, span) as u32;
        }
    }
    0
}

/// How long a task runs this time. \[µs\]
fn run_time_us(task: &Task, chance: &mut Chance) -> u32 {
    if chance.below(LONGER_IN) > 0 {
        return task.mean_us;
    }
    let span = task.largest_us.saturating_sub(task.mean_us);
    // The lesser of two falls to 0 at the largest.
    let beyond = chance.below(span).min(chance.below(span));
    task.mean_us.saturating_add(beyond)
}

/// Whether `one` lies before `other`, less than 2³¹ counts.
const fn is_before(one: u32, other: u32) -> bool {
    one.wrapping_sub(other).cast_signed() < 0
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::lateness::{BOUNDS_US, Lateness, PX4_BEFORE};

    const SECOND: u64 = 1_000_000 * COUNTS_PER_US as u64;

    /// Everything that is due in so many seconds, with its moment in counts, from a timer that is about to
    /// wrap.
    fn played(load: &str, seed: u32, seconds: u64) -> Vec<(u64, Job)> {
        let begin = u32::MAX - 1_000;
        let mut load = FlightLoad::new(load.parse().unwrap(), seed, begin);
        let (mut now, mut at) = (begin, 0_u64);
        let mut jobs = Vec::new();
        while at < seconds * SECOND {
            at += u64::from(load.poll_timeout().wrapping_sub(now));
            now = load.poll_timeout();
            while let Some(job) = load.poll(now) {
                jobs.push((at, job));
            }
        }
        jobs
    }

    fn share(jobs: &[(u64, Job)], seconds: u64) -> f64 {
        let busy: u64 = jobs.iter().map(|(_, job)| u64::from(job.counts)).sum();
        busy as f64 / (seconds * SECOND) as f64
    }

    #[test]
    fn the_core_is_kept_busy_as_much_as_was_asked_for() {
        for (load, asked) in [("px4", 0.55), ("20", 0.20), ("80", 0.80), ("0", 0.0)] {
            for seed in 0..4 {
                let is = share(&played(load, seed, 20), 20);
                assert!((is - asked).abs() < 0.03, "{load}, seed {seed}: {is}");
            }
        }
        let parts = ["interrupts", "masked", "tasks"];
        let each = parts.map(|part| share(&played(&std::format!("px4,{part}"), 1, 20), 20));
        let all = share(&played("px4", 1, 20), 20);
        assert!((each.iter().sum::<f64>() - all).abs() < 0.02, "{each:?}");
        assert!(each.iter().all(|share| *share > 0.05), "{each:?}");
    }

    #[test]
    fn the_same_seed_draws_the_same_and_another_does_not() {
        assert_eq!(played("px4", 5, 1), played("px4", 5, 1));
        assert_ne!(played("px4", 5, 1), played("px4", 6, 1));
        assert!(played("0", 5, 1).is_empty());
    }

    #[test]
    fn a_task_runs_no_longer_than_its_largest_and_once_a_period() {
        let jobs = played("px4,tasks", 2, 10);
        for (level, hz) in [
            (Level::Above, 580),
            (Level::Between, 460),
            (Level::Below, 170),
        ] {
            let counts: Vec<_> = jobs
                .iter()
                .filter(|(_, job)| job.level == level)
                .map(|(_, job)| job.counts)
                .collect();
            assert!(
                counts.len().abs_diff(hz * 10) <= 3,
                "{level:?}: {}",
                counts.len()
            );
            let largest = TASKS.iter().filter(|task| task.level == level);
            let largest = largest.map(|task| task.largest_us).max().unwrap();
            assert!(
                counts
                    .iter()
                    .all(|&counts| counts <= largest * COUNTS_PER_US)
            );
        }
    }

    /// Interrupts and masks on one core, where an event at any moment waits for the stretch that it falls into.
    #[test]
    fn the_stretches_make_the_histogram_that_they_are_drawn_after() {
        let mut jobs = played("px4,interrupts", 3, 60);
        jobs.extend(played("px4,masked", 4, 60));
        jobs.sort_by_key(|(at, _)| *at);
        let mut free = 0;
        let mut shares = [0.0; 7];
        for (at, job) in jobs {
            let begins = at.max(free);
            free = begins + u64::from(job.counts);
            // Who comes while it lasts waits for what is left.
            for us in 0..job.counts / COUNTS_PER_US {
                shares[Lateness::bucket(us + 1)] += 1.0;
            }
        }
        let all = 60e6;
        shares[0] = all - shares.iter().skip(1).sum::<f64>();
        for ((is, px4), bound_us) in shares.iter().zip(PX4_BEFORE.shares()).zip(BOUNDS_US) {
            let ratio = is / all / px4;
            assert!((1.0 / 1.2..1.2).contains(&ratio), "{bound_us} µs: {ratio}");
        }
        assert_eq!(shares[6], 0.0);
    }
}
