//! A board as far as its clock can tell, under a referee.
//!
//! *Purpose.* Drives the very [`UtcClock`] of the firmware from event to event and
//! takes readings, each of which is held against the one before.
//!
//! *Design.* Time is the board's own cycles; whoever drives it knows the true time.
//! The referee demands what a clock promises: later stamps have later readings, and
//! none leaves [`MAX_BESIDE_PPB`], but for the steps that the clock's counters own
//! up to. What it finds is counted and the first is described.
//!
//! *Limits.* One reader. Events come in the order of their time.

use timebase::{CORE_HZ, Cycles, PulseForecast, PulseMark, TimeMark, Validity};
use utc_clock::{ClockState, Published, Reading, Settings, UtcClock, UtcNanos, calendar};

/// How late the firmware's timers are: a tick and a wake-up, in cycles.
const TIMER_LATE: u64 = 10_000;

/// The most that published time may run beside true time, in ppb: the slew's
/// 500 ppm, and a frequency that may be as wrong as a crystal of ±50 ppm on which
/// a ramp of 1 ppm/min has worked for 20 min.
const MAX_BESIDE_PPB: i128 = 570_000;
/// And so many ns: the rounding of two stamps and two readings.
const ROUNDING_NS: i128 = 20;

/// A board's clock, and what the referee has seen of it.
pub struct Board<'a> {
    clock: UtcClock<'a>,
    line: &'a Published,
    last: Option<Seen>,
    fouls: u32,
    first_foul: Option<String>,
}

/// A reading, at which stamp and true time it was taken, and the steps until then.
#[derive(Clone, Copy)]
struct Seen {
    stamp: Cycles,
    true_ns: i64,
    reading: Reading,
    steps: u32,
    steps_back: u32,
}

impl<'a> Board<'a> {
    /// A board whose clock publishes to `line`.
    #[must_use]
    pub fn new(settings: Settings, line: &'a Published) -> Self {
        Self {
            clock: UtcClock::new(settings, line),
            line,
            last: None,
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
            if self.clock.poll_timeout().plus(TIMER_LATE) <= due {
                // It asks for a time that is past: the next event is soon enough.
                return;
            }
        }
    }

    /// Hears that `epoch_utc_ns` was told by a message whose first byte arrived at
    /// `arrival`; says whether the clock followed it.
    pub fn hear(&mut self, arrival: Cycles, epoch_utc_ns: i64, now: Cycles) -> bool {
        self.pass_until(now);
        let Some(mark) = good_mark(arrival, epoch_utc_ns) else {
            return false;
        };
        let outcome = self.clock.handle_mark(&mark, now);
        !matches!(outcome, utc_clock::Outcome::Refused(_))
    }

    /// Hears of an edge of the time pulse.
    pub fn pulse(&mut self, pulse: &PulseMark, now: Cycles) {
        self.pass_until(now);
        let _ = pulse;
    }

    /// Hears what the receiver says about its next pulse.
    pub fn forecast(&mut self, forecast: &PulseForecast, now: Cycles) {
        self.pass_until(now);
        let _ = forecast;
    }

    /// Reads the clock, and referees; `true_ns` is the true time of the stamp
    /// `now`, from any origin.
    pub fn read(&mut self, now: Cycles, true_ns: i64) -> Reading {
        self.pass_until(now);
        let counters = self.clock.counters();
        let seen = Seen {
            stamp: now,
            true_ns,
            reading: self.line.reading_at(now),
            steps: counters.sets + counters.steps_forward + counters.steps_back,
            steps_back: counters.steps_back,
        };
        if let Some(foul) = self.last.and_then(|before| foul(&before, &seen)) {
            self.fouls += 1;
            self.first_foul.get_or_insert(foul);
        }
        self.last = Some(seen);
        seen.reading
    }

    /// How many readings broke the rules, and what the first one did.
    #[must_use]
    pub fn fouls(self) -> (u32, Option<String>) {
        (self.fouls, self.first_foul)
    }
}

/// What is wrong with a reading after the one before.
fn foul(before: &Seen, now: &Seen) -> Option<String> {
    if before.reading.state == ClockState::Unset || before.stamp >= now.stamp {
        return None;
    }
    let passed = i128::from(now.reading.utc.since(before.reading.utc));
    if passed <= 0 && before.steps_back == now.steps_back {
        return Some(format!("back or standing still at {}", now.reading.utc));
    }
    let true_passed = i128::from(now.true_ns - before.true_ns);
    let beside = (passed - true_passed).abs();
    let allowed = true_passed * MAX_BESIDE_PPB / 1_000_000_000 + ROUNDING_NS;
    (beside > allowed && before.steps == now.steps).then(|| {
        let at = now.reading.utc;
        format!("{beside} ns beside in {true_passed} ns at {at}, and no step was counted")
    })
}

/// A mark with nothing to be said against it; none where the calendar ends.
fn good_mark(arrival: Cycles, epoch_utc_ns: i64) -> Option<TimeMark> {
    Some(TimeMark {
        arrival,
        epoch: calendar::from_utc(UtcNanos(epoch_utc_ns))?,
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
