//! A board as far as its clock can tell, under a referee.
//!
//! *Purpose.* Drives the very [`UtcClock`] of the firmware from event to event and
//! takes readings, each of which is held against the one before.
//!
//! *Design.* Time is the board's own cycles; whoever drives it knows the true time.
//! The referee demands what a clock promises: later stamps have later readings, and
//! none leaves the slew's limit, but for the steps that the clock's counters own
//! up to. What it finds is counted and the first is described.
//!
//! *Limits.* One reader. Events come in the order of their time.

use timebase::{CORE_HZ, Cycles, PulseForecast, PulseMark, TimeMark, Validity};
use utc_clock::{ClockState, Published, Reading, Settings, UtcClock, UtcNanos};

/// How late the firmware's timers are: a tick and a wake-up, in cycles.
const TIMER_LATE: u64 = 10_000;

/// The most that published time may run beside true time, in ppb: the slew's
/// 500 ppm, and a frequency that is no worse than a crystal of ±50 ppm of which
/// nothing is known, but for the room of 100 ppm that a learner needs.
const MAX_BESIDE_PPB: i128 = 650_000;
/// And so many ns: the rounding of two stamps and two readings.
const ROUNDING_NS: i128 = 20;

/// A board's clock, and what the referee has seen of it.
pub struct Board<'a> {
    clock: UtcClock<'a>,
    line: &'a Published,
    last: Option<Seen>,
    /// Steps that the clock has owned up to, and those of them that went back.
    steps: u32,
    steps_back: u32,
    /// Where on the line the last one began, and whether it went back.
    stepped_at: Cycles,
    stepped_back: bool,
    fouls: u32,
    first_foul: Option<String>,
}

/// A reading, and at which stamp and true time it was taken.
#[derive(Clone, Copy)]
struct Seen {
    stamp: Cycles,
    true_ns: i64,
    reading: Reading,
}

impl<'a> Board<'a> {
    /// A board whose clock publishes to `line`.
    ///
    /// # Panics
    ///
    /// Another board's clock publishes to it already.
    #[must_use]
    pub fn new(settings: Settings, line: &'a Published) -> Self {
        Self {
            clock: UtcClock::new(settings, line.take_writer().expect("a line of its own")),
            line,
            last: None,
            steps: 0,
            steps_back: 0,
            stepped_at: Cycles::BOOT,
            stepped_back: false,
            fouls: 0,
            first_foul: None,
        }
    }

    /// The clock, to look at.
    #[must_use]
    pub const fn clock(&self) -> &UtcClock<'a> {
        &self.clock
    }

    /// Lets time pass: handles the timers that are due by `now`, each in its time.
    pub fn pass_until(&mut self, now: Cycles) {
        loop {
            let due = self.clock.poll_timeout().plus(TIMER_LATE);
            if due > now {
                return;
            }
            self.clock.handle_timeout(due);
            self.note_steps();
            if self.clock.poll_timeout().plus(TIMER_LATE) <= due {
                // It asks for a time that is past: the next event is soon enough.
                return;
            }
        }
    }

    /// Hears that `epoch_utc_ns` was told by a message whose first byte arrived at
    /// `arrival`; says whether the clock followed it.
    pub fn handle_arrival(&mut self, arrival: Cycles, epoch_utc_ns: i64, now: Cycles) -> bool {
        self.pass_until(now);
        let Some(mark) = good_mark(arrival, epoch_utc_ns) else {
            return false;
        };
        let outcome = self.clock.handle_mark(&mark, now);
        self.note_steps();
        !matches!(outcome, utc_clock::Outcome::Refused(_))
    }

    /// Hears of an edge of the time pulse.
    pub fn pulse(&mut self, pulse: &PulseMark, now: Cycles) {
        self.pass_until(now);
        let _ = self.clock.handle_pulse(pulse, now);
        self.note_steps();
    }

    /// Hears what the receiver says about its next pulse.
    pub fn forecast(&mut self, forecast: &PulseForecast, now: Cycles) {
        self.pass_until(now);
        self.clock.handle_forecast(forecast);
    }

    /// Reads the clock, and referees; `true_ns` is the true time of the stamp
    /// `now`, from any origin.
    pub fn read(&mut self, now: Cycles, true_ns: i64) -> Reading {
        self.pass_until(now);
        let seen = Seen {
            stamp: now,
            true_ns,
            reading: self.line.reading_at(now),
        };
        if let Some(foul) = self.last.and_then(|before| self.foul(&before, &seen)) {
            self.fouls += 1;
            self.first_foul.get_or_insert(foul);
        }
        self.last = Some(seen);
        seen.reading
    }

    /// A step begins a little after the call that makes it, at the newest model's
    /// begin.
    fn note_steps(&mut self) {
        let counters = self.clock.counters();
        let steps = counters.sets + counters.steps_forward + counters.steps_back;
        if steps != self.steps {
            self.stepped_at = self.clock.course_begins();
            self.stepped_back = counters.steps_back != self.steps_back;
            self.steps_back = counters.steps_back;
            self.steps = steps;
        }
    }

    /// What is wrong with a reading after the one before.
    fn foul(&self, before: &Seen, now: &Seen) -> Option<String> {
        if before.reading.state == ClockState::Unset || before.stamp >= now.stamp {
            return None;
        }
        let stepped = before.stamp < self.stepped_at && self.stepped_at <= now.stamp;
        let passed = i128::from(now.reading.utc.since(before.reading.utc));
        let at = now.reading.utc;
        if passed <= 0 && !(stepped && self.stepped_back) {
            return Some(format!("back or standing still at {at}"));
        }
        let true_passed = i128::from(now.true_ns - before.true_ns);
        let beside = (passed - true_passed).abs();
        let allowed = true_passed * MAX_BESIDE_PPB / 1_000_000_000 + ROUNDING_NS;
        (beside > allowed && !stepped)
            .then(|| format!("{beside} ns beside in {true_passed} ns at {at}, without a step"))
    }

    /// How many readings broke the rules, and what the first one did.
    #[must_use]
    pub fn fouls(self) -> (u32, Option<String>) {
        (self.fouls, self.first_foul)
    }
}

/// A mark with nothing to be said against it; none where the calendar ends.
#[must_use]
pub fn good_mark(arrival: Cycles, epoch_utc_ns: i64) -> Option<TimeMark> {
    Some(TimeMark {
        arrival,
        epoch: UtcNanos(epoch_utc_ns).to_civil()?,
        t_acc_ns: 25,
        validity: Validity {
            date: true,
            time: true,
            fully_resolved: true,
            confirmed: true,
            leap_seconds_known: true,
        },
    })
}

/// What a board takes its counter for, in ns: cycles at the nominal rate.
#[must_use]
pub fn nominal_ns(cycles: Cycles) -> i64 {
    let ns = u128::from(cycles.0) * 1_000_000_000 / u128::from(CORE_HZ);
    i64::try_from(ns).unwrap_or(i64::MAX)
}
