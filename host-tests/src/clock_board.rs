//! A board as far as its clock can tell, under a referee.
//!
//! *Purpose.* Drives [`UtcClock`] and [`Published`] as the firmware does, from
//! wake-up to wake-up, and looks at every reading on the way.
//!
//! *Design.* The world's time is true time in ns; the crystal makes cycles of it.
//! Marks are heard when their frame has come in, timeouts when they are due and
//! a little late. The referee holds each reading against the one before: later
//! stamps have later readings, and the rate stays within the slew limit of the
//! crystal's, but for the steps that the clock owned up to.
//!
//! *Limits.* One reader; what several priorities do to each other is visited in
//! `clock_published`.
#![expect(
    clippy::missing_panics_doc,
    reason = "a panic is how the referee whistles"
)]

use timebase::{CORE_HZ, CivilTime, Cycles, TimeMark, Validity};
use utc_clock::clock::LEAD;
use utc_clock::{ClockState, Outcome, Published, Reading, Settings, UtcClock, UtcNanos, calendar};

/// ns.
pub const MS: i64 = 1_000_000;
/// ns.
pub const SECOND: i64 = 1_000 * MS;

/// 2026-11-22T01:02:03Z, where the world's time begins.
pub const START: UtcNanos = UtcNanos(1_795_309_323 * SECOND);

/// 100 bytes at 115200 baud, and the task that gets round to them, in ns.
pub const FRAME_NS: i64 = 8_700_000;
/// How late the firmware's timers are: a tick and a wake-up.
const TIMER_LATE: u64 = 10_000;

/// A board and the world's time.
pub struct Board<'a> {
    /// What the firmware's task owns.
    pub clock: UtcClock<'a>,
    /// What its readers see.
    pub line: &'a Published,
    /// ns since the start, true time.
    pub now_ns: i64,
    /// How much faster than it should the crystal runs.
    pub crystal_ppb: i64,
    /// Readings so many ns apart while time passes.
    pub read_every_ns: i64,
    /// Every reading's error (reading less UTC) goes here while the clock is set.
    pub errors_ns: Vec<i64>,
    last: Option<(Cycles, Reading)>,
    steps: Vec<Cycles>,
}

impl<'a> Board<'a> {
    /// A board that starts now.
    pub fn new(settings: Settings, crystal_ppb: i64, line: &'a Published) -> Self {
        Self {
            clock: UtcClock::new(settings, line),
            line,
            now_ns: 0,
            crystal_ppb,
            read_every_ns: 10 * MS,
            errors_ns: Vec::new(),
            last: None,
            steps: Vec::new(),
        }
    }

    /// What the board's counter says at a moment of the world.
    pub fn cycles(&self, world_ns: i64) -> Cycles {
        let rate = i128::from(CORE_HZ) * i128::from(SECOND + self.crystal_ppb);
        let cycles = i128::from(world_ns) * rate / i128::from(SECOND) / i128::from(SECOND);
        Cycles(u64::try_from(cycles).expect("after the start"))
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
            }
            self.read();
        }
    }

    /// A mark whose first byte arrives at `arrival_ns`, and whose last byte's
    /// time is not before now.
    pub fn hear(&mut self, epoch: UtcNanos, arrival_ns: i64) -> Outcome {
        self.hear_mark(mark(epoch), arrival_ns)
    }

    /// The same with a mark of one's own; its arrival is filled in.
    pub fn hear_mark(&mut self, mut mark: TimeMark, arrival_ns: i64) -> Outcome {
        self.pass_until((arrival_ns + FRAME_NS).max(self.now_ns));
        mark.arrival = self.cycles(arrival_ns);
        self.handle(&mark)
    }

    /// A mark as it is, now.
    pub fn handle(&mut self, mark: &TimeMark) -> Outcome {
        let outcome = self.clock.handle_mark(mark, self.cycles(self.now_ns));
        if matches!(outcome, Outcome::Set | Outcome::Stepped { .. }) {
            self.steps.push(self.clock.model().at());
        }
        outcome
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
        if let Some((then, before)) = self.last
            && then < now
            && !self.steps.iter().any(|step| then < *step && *step <= now)
        {
            let passed = reading.utc.since(before.utc);
            let cycles = i128::from(now.since(then));
            let nominal = cycles * i128::from(SECOND) / i128::from(CORE_HZ);
            let beside = (i128::from(passed) - nominal).abs();
            assert!(passed > 0, "back or standing still at {}", reading.utc);
            assert!(
                beside <= nominal / 2_000 + 2,
                "{beside} ns in {nominal} ns are more than 500 ppm"
            );
        }
        self.last = Some((now, reading));
        if reading.state != ClockState::Unset {
            self.errors_ns.push(reading.utc.since(self.truth()));
        }
        reading
    }

    /// The clock's error now: its reading less UTC.
    pub fn error_ns(&mut self) -> i64 {
        let truth = self.truth();
        self.read().utc.since(truth)
    }

    /// Until a new course holds.
    pub fn pass_lead(&mut self) {
        let lead = i64::try_from(LEAD).expect("1 ms") * SECOND / i64::from(CORE_HZ);
        self.pass_until(self.now_ns + 2 * lead);
    }
}

/// A good mark of `epoch`; its arrival is to be filled in.
pub fn mark(epoch: UtcNanos) -> TimeMark {
    TimeMark {
        arrival: Cycles::BOOT,
        epoch: calendar::from_utc(epoch).expect("an epoch of this century"),
        t_acc_ns: 25,
        validity: Validity {
            date: true,
            time: true,
            fully_resolved: true,
            confirmed: true,
            leap_seconds_known: true,
        },
    }
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
