//! A run: a scenario as it happens.

use std::iter::Peekable;

use timebase::{Polarity, PulseEdge};
use utc_clock::{ClockState, Outcome, PulseOutcome};

use crate::board::Board;
use crate::event::{self, Event, EventKind};
use crate::time::SECOND;
use crate::{Sample, Scenario, good_forecast, good_mark};

/// A scenario that is being run.
pub struct Run {
    /// The board.
    pub board: Board,
    /// The stamp of each mark, and what it did. \[ns\]
    pub marks: Vec<(i64, Outcome)>,
    /// The stamp of each pulse, and what it did. \[ns\]
    pub pulses: Vec<(i64, PulseOutcome)>,
    floor_ns: i64,
    events: Peekable<Box<dyn Iterator<Item = Event>>>,
}

impl Scenario {
    /// A run of it from the start, read each 37 ms; a violation is a panic.
    #[must_use]
    pub fn start(&self) -> Run {
        Run {
            board: Board::of(self),
            marks: Vec::new(),
            pulses: Vec::new(),
            floor_ns: self.floor_ns(),
            events: event::events(self).peekable(),
        }
    }
}

impl Run {
    /// Runs on until `world_ns`.
    pub fn until(&mut self, world_ns: i64) {
        while self.next_until(world_ns).is_some() {}
        self.board.pass_until(world_ns);
    }

    /// Handles the next event that is handled by `world_ns`, if there is one.
    pub fn next_until(&mut self, world_ns: i64) -> Option<Event> {
        let event = self.events.next_if(|event| event.handled_ns <= world_ns)?;
        self.handle(&event);
        Some(event)
    }

    /// Handles the next event, `late_ns` later than the scenario has it.
    pub fn next_late_by(&mut self, late_ns: i64) {
        if let Some(event) = self.events.next() {
            self.handle(&Event {
                stamped_ns: event.stamped_ns + late_ns,
                handled_ns: event.handled_ns + late_ns,
                ..event
            });
        }
    }

    fn handle(&mut self, event: &Event) {
        self.board.pass_until(event.handled_ns);
        let stamped_ns = event.stamped_ns;
        match event.kind {
            EventKind::Mark { epoch } => {
                let arrival = self.board.cycles(stamped_ns);
                if let Some(mark) = good_mark(arrival, epoch) {
                    self.marks.push((stamped_ns, self.board.handle_mark(&mark)));
                }
            }
            EventKind::Rise => {
                self.handle_edge(stamped_ns, Polarity::Rise);
            }
            EventKind::Fall { rose_ns } => {
                let outcome = self.handle_edge(stamped_ns, Polarity::Fall);
                self.pulses.push((rose_ns, outcome));
            }
            EventKind::Forecast { late_ps } => {
                let arrival = self.board.cycles(stamped_ns);
                let forecast = good_forecast(arrival, late_ps);
                self.board.clock.handle_forecast(&forecast);
            }
        }
    }

    fn handle_edge(&mut self, stamped_ns: i64, polarity: Polarity) -> PulseOutcome {
        let at = self.board.cycles(stamped_ns);
        self.board.handle_edge(&PulseEdge { at, polarity })
    }

    /// Runs on for `seconds`.
    pub fn pass_s(&mut self, seconds: i64) {
        self.until(self.board.now_ns + seconds * SECOND);
    }

    /// The clock's error against floor time now. \[ns\]
    pub fn floor_error_ns(&mut self) -> i64 {
        self.board.error_ns() + self.floor_ns
    }

    /// The samples from `from_ns` on, with their errors against floor time.
    pub fn since(&self, from_ns: i64) -> impl Iterator<Item = Sample> {
        self.utc_since(from_ns).map(|sample| Sample {
            error_ns: sample.error_ns + self.floor_ns,
            ..sample
        })
    }

    /// The samples from `from_ns` on, with their errors against UTC.
    pub fn utc_since(&self, from_ns: i64) -> impl Iterator<Item = Sample> {
        let samples = &self.board.samples;
        let first = samples.partition_point(|sample| sample.at_ns < from_ns);
        samples[first..].iter().copied()
    }

    /// How many marks since `from_ns` had such an outcome.
    pub fn count_marks(&self, from_ns: i64, is: impl Fn(&Outcome) -> bool) -> usize {
        let since = self.marks.iter().filter(|(at, _)| *at >= from_ns);
        since.filter(|(_, outcome)| is(outcome)).count()
    }

    /// How many pulses since `from_ns` had such an outcome.
    pub fn count_pulses(&self, from_ns: i64, is: impl Fn(&PulseOutcome) -> bool) -> usize {
        let since = self.pulses.iter().filter(|(at, _)| *at >= from_ns);
        since.filter(|(_, outcome)| is(outcome)).count()
    }

    /// Runs on until `until_s` and returns the largest error of the clock's frequency, looked at
    /// once a second. \[ppb\]
    pub fn frequency_until_ppb(&mut self, until_s: i64) -> f64 {
        let mut worst = 0.0_f64;
        while self.board.now_ns < until_s * SECOND {
            self.pass_s(1);
            worst = worst.max(self.board.frequency_error_ppb().abs());
        }
        worst
    }

    /// Whether the clock is set.
    pub fn is_set(&mut self) -> bool {
        self.board.read().state == ClockState::Set
    }
}
