//! A board: a crystal and the clock that counts its cycles.
//!
//! *Design.* True time in ns stands outside; the [`Crystal`] makes cycles of it, and the clock sees
//! nothing else. Timeouts are handled when they are due and a little late, as the firmware's timers
//! are. A timeline lives as long as the process, as the firmware's does, which is a static.

use timebase::{CORE_HZ, Cycles, Polarity, PulseEdge, TimeMark};
use utc_clock::{
    ClockState, Outcome, Published, PulseOutcome, Reading, Settings, UtcClock, UtcNanos,
};
use world::{Crystal, CrystalSettings};

use crate::invariants::{Checked, Invariants, OnViolation, Step};
use crate::time::{
    FORECAST_AHEAD_NS, FRAME_NS, MS, PULSE_TASK_NS, PULSE_WIDTH_NS, SECOND, START, TIMER_LATE,
    moment,
};
use crate::{Sample, Scenario, good_forecast, good_mark, leap_seconds};

/// The readings of a run beat with no rate of marks or pulses. \[ns\]
const READ_EVERY_NS: i64 = 37_000_100;

/// A board, and true time.
pub struct Board {
    /// The clock that the firmware's task owns.
    pub clock: UtcClock<'static>,
    /// What its readers see.
    pub timeline: &'static Published,
    /// True time since the start. \[ns\]
    pub now_ns: i64,
    /// From reading to reading while time passes; `None` for no reading. \[ns\]
    pub read_every_ns: Option<i64>,
    /// Every reading since the clock was set.
    pub samples: Vec<Sample>,
    /// What its readings have to fulfil.
    pub invariants: Invariants,
    utc_at_start: UtcNanos,
    crystal: Crystal,
}

impl Board {
    /// A board that starts at [`START`] with a crystal without noise, `crystal_ppb` fast. It is
    /// read each 10 ms, and a violation is a panic.
    #[must_use]
    pub fn new(settings: Settings, crystal_ppb: f64) -> Self {
        let crystal = Crystal::new(CrystalSettings::quiet(crystal_ppb), 0);
        Self {
            read_every_ns: Some(10 * MS),
            ..Self::with(settings, crystal, START)
        }
    }

    /// The board of a scenario.
    pub(crate) fn of(scenario: &Scenario) -> Self {
        let receiver = &scenario.receiver;
        let crystal = Crystal::new(scenario.crystal, receiver.seed);
        let utc_at_start = UtcNanos(receiver.utc_at_start_ns);
        Self::with(scenario.settings, crystal, utc_at_start)
    }

    fn with(settings: Settings, crystal: Crystal, utc_at_start: UtcNanos) -> Self {
        let timeline: &'static Published = Box::leak(Box::default());
        let writer = timeline.take_writer().expect("the first one");
        let mut clock = UtcClock::new(settings, writer);
        clock.handle_pulse_width(Some((PULSE_WIDTH_NS / 1_000) as u32));
        clock.handle_leap_seconds(&leap_seconds(Cycles::BOOT), Cycles::BOOT);
        Self {
            clock,
            timeline,
            now_ns: 0,
            read_every_ns: Some(READ_EVERY_NS),
            samples: Vec::new(),
            invariants: Invariants::new(OnViolation::Panic),
            utc_at_start,
            crystal,
        }
    }

    /// The board's counter at a moment of true time.
    pub fn cycles(&mut self, world_ns: i64) -> Cycles {
        Cycles(self.crystal.cycles_at(moment(world_ns)))
    }

    /// UTC now.
    #[must_use]
    pub const fn truth(&self) -> UtcNanos {
        UtcNanos(self.utc_at_start.0 + self.now_ns)
    }

    /// Lets time pass until `world_ns`, with readings and timeouts on the way. A moment that is
    /// past changes nothing.
    pub fn pass_until(&mut self, world_ns: i64) {
        while self.now_ns < world_ns {
            let step_ns = self.read_every_ns.unwrap_or(i64::MAX);
            self.now_ns = self.now_ns.saturating_add(step_ns).min(world_ns);
            self.handle_timeouts();
            if self.read_every_ns.is_some() {
                self.read();
            }
        }
    }

    /// Handles the timeouts that are due by now, each in its time.
    fn handle_timeouts(&mut self) {
        let now = self.cycles(self.now_ns);
        loop {
            let due = self.clock.poll_timeout().plus(TIMER_LATE);
            if due > now {
                return;
            }
            let before = self.clock.counters();
            self.clock.handle_timeout(due);
            let after = self.clock.counters();
            // A timeout steps by an announced leap second alone.
            let step = if after.steps_forward != before.steps_forward {
                Step::By(SECOND)
            } else if after.steps_back != before.steps_back {
                Step::By(-SECOND)
            } else {
                Step::None
            };
            self.invariants.push(&self.clock, step);
            if self.clock.poll_timeout().plus(TIMER_LATE) <= due {
                // It asks for a time that is past: the next event is soon enough.
                return;
            }
        }
    }

    /// Handles a mark of `epoch` whose first byte is in at `arrival_ns`, once its last one is.
    ///
    /// # Panics
    ///
    /// If the calendar does not have that epoch.
    pub fn handle_arrival(&mut self, epoch: UtcNanos, arrival_ns: i64) -> Outcome {
        let mark = good_mark(Cycles::BOOT, epoch).expect("an epoch of this century");
        self.handle_mark_at(mark, arrival_ns)
    }

    /// Handles `mark` in the same way; its arrival is filled in.
    pub fn handle_mark_at(&mut self, mark: TimeMark, arrival_ns: i64) -> Outcome {
        self.pass_until(arrival_ns + FRAME_NS);
        let arrival = self.cycles(arrival_ns);
        self.handle_mark(&TimeMark { arrival, ..mark })
    }

    /// Handles `mark` as it is, now.
    pub fn handle_mark(&mut self, mark: &TimeMark) -> Outcome {
        let now = self.cycles(self.now_ns);
        let outcome = self.clock.handle_mark(mark, now);
        let step = match outcome {
            Outcome::Set => Step::Set,
            Outcome::Stepped { by_ns } => Step::By(by_ns),
            _ => Step::None,
        };
        self.invariants.push(&self.clock, step);
        outcome
    }

    /// Handles a pulse that rises at `edge_ns`: its TIM-TP, its rise, and its fall.
    pub fn handle_pulse(&mut self, edge_ns: i64) -> PulseOutcome {
        self.handle_pulse_of(edge_ns, PULSE_WIDTH_NS)
    }

    /// Handles one that is high for `width_ns` in the same way.
    pub fn handle_pulse_of(&mut self, edge_ns: i64, width_ns: i64) -> PulseOutcome {
        let announced = self.cycles((edge_ns - FORECAST_AHEAD_NS).max(0));
        self.clock.handle_forecast(&good_forecast(announced, None));
        self.handle_edge_at(edge_ns, Polarity::Rise);
        self.handle_edge_at(edge_ns + width_ns, Polarity::Fall)
    }

    /// Handles an edge of the pulse's wire at `edge_ns`, once the task has it.
    pub fn handle_edge_at(&mut self, edge_ns: i64, polarity: Polarity) -> PulseOutcome {
        self.pass_until(edge_ns + PULSE_TASK_NS);
        let at = self.cycles(edge_ns);
        self.handle_edge(&PulseEdge { at, polarity })
    }

    /// Handles `edge` as it is, now.
    pub fn handle_edge(&mut self, edge: &PulseEdge) -> PulseOutcome {
        let now = self.cycles(self.now_ns);
        let outcome = self.clock.handle_edge(edge, now);
        let step = match outcome {
            PulseOutcome::Stepped { by_ns } => Step::By(by_ns),
            _ => Step::None,
        };
        self.invariants.push(&self.clock, step);
        outcome
    }

    /// Reads the clock now, and checks the reading.
    pub fn read(&mut self) -> Reading {
        let now = self.cycles(self.now_ns);
        let reading = self.timeline.reading_at(now);
        let checked = Checked {
            now,
            at_ns: self.now_ns,
            reading,
            utc: self.timeline.utc_of(now.stamp()),
            frequency_ppb: self.clock.frequency().0,
            right_ppb: self.right_ppb(),
        };
        self.invariants.check(&checked);
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

    /// The clock's error now: its reading less UTC. \[ns\]
    pub fn error_ns(&mut self) -> i64 {
        let truth = self.truth();
        self.read().utc.since(truth)
    }

    /// The clock's frequency less the one that compensates the crystal. \[ppb\]
    pub fn frequency_error_ppb(&mut self) -> f64 {
        f64::from(self.clock.frequency().0) - self.right_ppb()
    }

    /// Lets time pass until a new course holds.
    pub fn pass_lead(&mut self) {
        let lead_ns = UtcClock::LEAD.cast_signed() * SECOND / i64::from(CORE_HZ);
        self.pass_until(self.now_ns + 2 * lead_ns);
    }

    /// How much faster than the crystal a clock has to run to be right. \[ppb\]
    fn right_ppb(&mut self) -> f64 {
        let fast = self.crystal.frequency_ppb_at(moment(self.now_ns)) * 1e-9;
        -fast / (1.0 + fast) * 1e9
    }
}
