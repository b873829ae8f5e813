//! A board as far as its clock can tell, under a referee.
//!
//! *Purpose.* Drives [`UtcClock`] and [`Published`] as the firmware does, from
//! wake-up to wake-up, and looks at every reading on the way.
//!
//! *Design.* The world's time is true time in ns; a [`Crystal`] makes cycles of it.
//! Marks are heard when their frame has come in, pulses when their task has got
//! round to them, timeouts when they are due and a little late. The referee holds
//! each reading against the one before: later stamps have later readings, and the
//! clock goes at its frequency, give or take the slew limit, but for the steps that
//! it owned up to, by exactly what it owned up to. And the frequency itself must not
//! be worse than knowing nothing about the crystal, but for a margin.
//!
//! *Limits.* One reader; what several priorities do to each other is visited in
//! utc-clock's `published/preemption.rs`.
#![expect(
    clippy::missing_panics_doc,
    reason = "a panic is how the referee whistles"
)]

use comparison::board::good_mark;
use timebase::{CORE_HZ, CivilTime, Cycles, PulseForecast, PulseMark, TimeMark};
use utc_clock::{
    ClockState, Outcome, Published, PulseOutcome, Reading, Settings, UtcClock, UtcNanos,
};
use world::{Crystal, CrystalSettings, WorldNanos};

/// ns.
pub const US: i64 = 1_000;
/// ns.
pub const MS: i64 = 1_000 * US;
/// ns.
pub const SECOND: i64 = 1_000 * MS;

/// 2026-11-22T01:02:03Z, where the world's time begins.
pub const START: UtcNanos = UtcNanos(1_795_309_323 * SECOND);

/// 100 bytes at 115200 baud, and the task that gets round to them, in ns.
pub const FRAME_NS: i64 = 8_700_000;
/// From a pulse's edge to its handling, in ns.
const PULSE_TASK_NS: i64 = 20_000;
/// How late the firmware's timers are: a tick and a wake-up.
const TIMER_LATE: u64 = 10_000;
/// How much faster or slower than its frequency the clock may go, in ppb.
const SLEW_PPB: i128 = 500_000;
/// How much worse than nothing a frequency may be, in ppb: a learner of 50 ppm
/// needs that much room.
const MARGIN_PPB: f64 = 100_000.0;

/// What a reader was told, beside the truth.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The world's time, in ns.
    pub at_ns: i64,
    /// The reading less UTC, in ns.
    pub error_ns: i64,
    /// How far off the clock said that it may be, in ns.
    pub uncertainty_ns: u32,
    /// Set, or in holdover.
    pub state: ClockState,
}

/// How the line goes on from a moment.
#[derive(Clone, Copy, Debug)]
struct Course {
    at: Cycles,
    frequency_ppb: i32,
    /// What it owned up to.
    step: Step,
}

#[derive(Clone, Copy, Debug)]
enum Step {
    No,
    /// By so many ns.
    By(i64),
    /// From nothing.
    Set,
}

/// A board and the world's time.
pub struct Board<'a> {
    /// What the firmware's task owns.
    pub clock: UtcClock<'a>,
    /// What its readers see.
    pub line: &'a Published,
    /// ns since the start, true time.
    pub now_ns: i64,
    /// Readings so many ns apart while time passes.
    pub read_every_ns: i64,
    /// By how much the frequency may be off, in ppb, beyond what the crystal is.
    pub margin_ppb: f64,
    /// Every reading since the clock was set.
    pub samples: Vec<Sample>,
    crystal: Crystal,
    last: Option<(Cycles, Reading)>,
    courses: Vec<Course>,
}

impl<'a> Board<'a> {
    /// A board that starts now, with a crystal that is always so many ppb fast.
    pub fn new(settings: Settings, crystal_ppb: f64, line: &'a Published) -> Self {
        Self::with_crystal(settings, CrystalSettings::quiet(crystal_ppb), 0, line)
    }

    /// A board that starts now.
    pub fn with_crystal(
        settings: Settings,
        crystal: CrystalSettings,
        seed: u64,
        line: &'a Published,
    ) -> Self {
        let boot = Course {
            at: Cycles::BOOT,
            frequency_ppb: 0,
            step: Step::No,
        };
        Self {
            clock: UtcClock::new(settings, line.take_writer().expect("a line of its own")),
            line,
            now_ns: 0,
            read_every_ns: 10 * MS,
            margin_ppb: MARGIN_PPB,
            samples: Vec::new(),
            crystal: Crystal::new(crystal, seed),
            last: None,
            courses: vec![boot],
        }
    }

    /// What the board's counter says at a moment of the world.
    pub fn cycles(&mut self, world_ns: i64) -> Cycles {
        Cycles(self.crystal.cycles_at(moment(world_ns)))
    }

    /// UTC now.
    pub fn truth(&self) -> UtcNanos {
        UtcNanos(START.0 + self.now_ns)
    }

    /// Lets time pass until `world_ns`: readings on the way, and timers as they
    /// come due.
    pub fn pass_until(&mut self, world_ns: i64) {
        while self.now_ns < world_ns {
            let next = (self.now_ns + self.read_every_ns).min(world_ns);
            self.now_ns = next;
            let now = self.cycles(next);
            // Timers that came due on the way, each at its own time.
            for _ in 0..8 {
                let due = self.clock.poll_timeout().plus(TIMER_LATE);
                if due > now {
                    break;
                }
                self.clock.handle_timeout(due);
                self.note(Step::No);
            }
            self.read();
        }
    }

    /// A mark whose first byte arrives at `arrival_ns`, and whose last byte's
    /// time is not before now.
    pub fn handle_arrival(&mut self, epoch: UtcNanos, arrival_ns: i64) -> Outcome {
        self.handle_mark(mark(epoch), arrival_ns)
    }

    /// The same with a mark of one's own; its arrival is filled in.
    pub fn handle_mark(&mut self, mut mark: TimeMark, arrival_ns: i64) -> Outcome {
        self.pass_until((arrival_ns + FRAME_NS).max(self.now_ns));
        mark.arrival = self.cycles(arrival_ns);
        self.handle(&mark)
    }

    /// A mark as it is, now.
    pub fn handle(&mut self, mark: &TimeMark) -> Outcome {
        let now = self.cycles(self.now_ns);
        let outcome = self.clock.handle_mark(mark, now);
        self.note(match outcome {
            Outcome::Set => Step::Set,
            Outcome::Stepped { by_ns } => Step::By(by_ns),
            _ => Step::No,
        });
        outcome
    }

    /// An edge of the pulse at `edge_ns`.
    pub fn handle_edge(&mut self, edge_ns: i64) -> PulseOutcome {
        self.pass_until((edge_ns + PULSE_TASK_NS).max(self.now_ns));
        let edge = self.cycles(edge_ns);
        self.handle_pulse(&PulseMark { edge })
    }

    /// A pulse as it is, now.
    pub fn handle_pulse(&mut self, pulse: &PulseMark) -> PulseOutcome {
        let now = self.cycles(self.now_ns);
        let outcome = self.clock.handle_pulse(pulse, now);
        self.note(match outcome {
            PulseOutcome::Stepped { by_ns } => Step::By(by_ns),
            _ => Step::No,
        });
        outcome
    }

    /// What the receiver says of its next pulse, at `arrival_ns`.
    pub fn handle_forecast(&mut self, late_ps: i32, arrival_ns: i64) {
        self.pass_until(arrival_ns.max(self.now_ns));
        let arrival = self.cycles(arrival_ns);
        self.clock
            .handle_forecast(&PulseForecast { arrival, late_ps });
    }

    /// Reads the clock, and referees.
    pub fn read(&mut self) -> Reading {
        let now = self.cycles(self.now_ns);
        let reading = self.line.reading_at(now);
        assert_eq!(
            reading.utc,
            self.line.utc_of(now.stamp()),
            "both ways agree"
        );
        self.referee(now, &reading);
        self.last = Some((now, reading));
        if reading.state != ClockState::Unset {
            self.samples.push(Sample {
                at_ns: self.now_ns,
                error_ns: reading.utc.since(self.truth()),
                uncertainty_ns: reading.uncertainty_ns,
                state: reading.state,
            });
        }
        reading
    }

    /// The clock's error now: its reading less UTC.
    pub fn error_ns(&mut self) -> i64 {
        let truth = self.truth();
        self.read().utc.since(truth)
    }

    /// How far the clock's frequency is from the one that makes up for the crystal,
    /// in ppb.
    pub fn frequency_error_ppb(&mut self) -> f64 {
        f64::from(self.clock.frequency().0) - self.wanted_ppb()
    }

    /// Until a new course holds.
    pub fn pass_lead(&mut self) {
        let lead = i64::try_from(UtcClock::LEAD).expect("1 ms") * SECOND / i64::from(CORE_HZ);
        self.pass_until(self.now_ns + 2 * lead);
    }

    /// How much faster than the crystal a clock has to run to be right, in ppb.
    fn wanted_ppb(&mut self) -> f64 {
        let fast = self.crystal.frequency_ppb_at(moment(self.now_ns)) * 1e-9;
        -fast / (1.0 + fast) * 1e9
    }

    /// Notes the course that the clock is on since the last call.
    fn note(&mut self, step: Step) {
        let course = Course {
            at: self.clock.course_begins(),
            frequency_ppb: self.clock.frequency().0,
            step,
        };
        // What no reading can see any more.
        if let Some((then, _)) = self.last
            && let Some(in_force) = self.courses.iter().rposition(|course| course.at <= then)
        {
            self.courses.drain(..in_force);
        }
        self.courses.push(course);
    }

    fn referee(&mut self, now: Cycles, reading: &Reading) {
        if reading.state != ClockState::Unset {
            assert!(reading.uncertainty_ns > 0, "nothing is that certain");
            let wanted_ppb = self.wanted_ppb();
            let off_ppb = (f64::from(self.clock.frequency().0) - wanted_ppb).abs();
            assert!(
                off_ppb <= wanted_ppb.abs() + self.margin_ppb,
                "at {} ns the frequency is {off_ppb} ppb off",
                self.now_ns
            );
        }
        let Some((then, before)) = self.last.filter(|(then, _)| *then < now) else {
            return;
        };
        let since = self.courses.iter().rposition(|course| course.at <= then);
        let in_force = &self.courses[since.expect("since boot")..];
        let mut steps_ns = 0;
        let mut is_set_meanwhile = false;
        let (mut slowest_ppb, mut fastest_ppb) = (i32::MAX, i32::MIN);
        for course in in_force.iter().take_while(|course| course.at <= now) {
            slowest_ppb = slowest_ppb.min(course.frequency_ppb);
            fastest_ppb = fastest_ppb.max(course.frequency_ppb);
            match course.step {
                Step::By(ns) if course.at > then => steps_ns += ns,
                Step::Set if course.at > then => is_set_meanwhile = true,
                _ => {}
            }
        }
        let passed_ns = reading.utc.since(before.utc);
        assert!(
            passed_ns > 0 || steps_ns < 0,
            "back or standing still at {}",
            reading.utc
        );
        if is_set_meanwhile {
            return;
        }
        let cycles = i128::from(now.since(then));
        let nominal_ns = cycles * i128::from(SECOND) / i128::from(CORE_HZ);
        let beside_ns = i128::from(passed_ns) - nominal_ns - i128::from(steps_ns);
        let slowest_ns = nominal_ns * (i128::from(slowest_ppb) - SLEW_PPB) / i128::from(SECOND);
        let fastest_ns = nominal_ns * (i128::from(fastest_ppb) + SLEW_PPB) / i128::from(SECOND);
        assert!(
            (slowest_ns - 2..=fastest_ns + 2).contains(&beside_ns),
            "at {} ns: {beside_ns} ns in {nominal_ns} ns, for {slowest_ns} to {fastest_ns}",
            self.now_ns
        );
    }
}

fn moment(world_ns: i64) -> WorldNanos {
    WorldNanos(u64::try_from(world_ns).expect("after the start"))
}

/// A good mark of `epoch`; its arrival is to be filled in.
pub fn mark(epoch: UtcNanos) -> TimeMark {
    good_mark(Cycles::BOOT, epoch.0).expect("an epoch of this century")
}

/// The leap second's own notation.
pub fn leap_second(date: (u16, u8, u8), nano: i32) -> CivilTime {
    CivilTime {
        year: date.0,
        month: date.1,
        day: date.2,
        hour: 23,
        minute: 59,
        second: 60,
        nano,
    }
}
