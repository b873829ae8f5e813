//! A base time and whole ticks, set at every NAV-PVT.
//!
//! *Design.* PX4 1.9 gives `clock_settime` each NAV-PVT that claims date, time and full resolution
//! and lies behind `GPS_EPOCH_SECS` (PX4-GPSDrivers, `src/ubx.cpp` and `src/gps_helper.h`), as soon as
//! it is parsed and without regard to the time that this took. NuttX 7 without its tickless option
//! keeps a base time and counts ticks: what it is set to is the time at the last tick, and what it
//! reads is the base and the ticks since (`sched/clock/clock_settime.c`, `clock_gettime.c`). So both
//! the writer and the readers of this clock pass the last tick
//! ([`last_tick`](timebase::tick::last_tick)) as the time.
//!
//! *Limits.* It proves nothing: from its first mark on its second is not proved, with the
//! uncertainty that its own gate leaves. It has no holdover: it runs on.

use timebase::{ClockState, Cycles, TimeMark};
use utc_clock::{CalendarError, Counters, Reading, Source, UtcNanos};

/// PX4's `GPS_EPOCH_SECS`, 2009-02-13T23:31:30Z: it sets no clock to this or before.
const EARLIEST: UtcNanos = UtcNanos(1_234_567_890_000_000_000);

/// It believes any later date, so that a receiver whose weeks have rolled over makes it wrong by as
/// much: 1024 weeks. \[ns\]
const UNCERTAINTY_NS: u64 = 1_024 * 7 * 86_400 * 1_000_000_000;

/// The clock that each mark sets.
#[derive(Clone, Copy, Debug, Default)]
pub struct PaperClock {
    base: BaseTime,
    counters: Counters,
}

/// UTC at the tick of the last mark: what readers of the clock need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BaseTime {
    at: Cycles,
    utc: UtcNanos,
    is_set: bool,
    leap_seconds_known: bool,
}

/// What a mark did to the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It set the clock, which was unset.
    Set,
    /// It set the clock again.
    Stepped {
        /// What was added to the clock. \[ns\]
        by_ns: i64,
    },
    /// PX4 would not have used it.
    Refused(Refusal),
}

/// Why PX4 1.9 does not set its clock by a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// `validDate` is not set.
    Date,
    /// `validTime` is not set.
    Time,
    /// `fullyResolved` is not set.
    Unresolved,
    /// The fields name no instant. PX4's `mktime` takes any field; this is stricter.
    Calendar(CalendarError),
    /// The epoch is 2009-02-13T23:31:30Z or earlier.
    TooOld,
}

impl BaseTime {
    /// The reading at `last_tick`, which is the time since boot until the clock is set.
    #[must_use]
    pub const fn reading_at(&self, last_tick: Cycles) -> Reading {
        Reading {
            utc: self.utc_at(last_tick),
            state: if self.is_set {
                ClockState::Unproved
            } else {
                ClockState::Unset
            },
            uncertainty_ns: if self.is_set {
                UNCERTAINTY_NS
            } else {
                u64::MAX
            },
            leap_seconds_known: self.leap_seconds_known,
        }
    }

    /// It as words, in which it can be shared; all are 0 before the first mark.
    #[must_use]
    pub const fn words(&self) -> [u32; 5] {
        [
            self.at.0 as u32,
            (self.at.0 >> 32) as u32,
            self.utc.0 as u32,
            (self.utc.0 >> 32) as u32,
            self.is_set as u32 | (self.leap_seconds_known as u32) << 1,
        ]
    }

    /// The base time that [`Self::words`] are of.
    #[must_use]
    pub const fn from_words([at_low, at_high, utc_low, utc_high, flags]: [u32; 5]) -> Self {
        Self {
            at: Cycles(at_low as u64 | (at_high as u64) << 32),
            utc: UtcNanos((utc_low as u64 | (utc_high as u64) << 32).cast_signed()),
            is_set: flags & 1 != 0,
            leap_seconds_known: flags & 2 != 0,
        }
    }

    const fn utc_at(&self, tick: Cycles) -> UtcNanos {
        let cycles = tick.since(self.at);
        // A tick is a whole number of µs, and so are these.
        let ns = Cycles(cycles.unsigned_abs()).as_nanos().cast_signed();
        self.utc.plus_nanos(if cycles < 0 { -ns } else { ns })
    }
}

impl PaperClock {
    /// A clock that is unset.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the clock to a mark, as of `last_tick`.
    pub fn handle_mark(&mut self, mark: &TimeMark, last_tick: Cycles) -> Outcome {
        match accepted(mark) {
            Ok(epoch) => self.set(epoch, mark.validity.leap_seconds_known, last_tick),
            Err(refusal) => {
                bump(match refusal {
                    Refusal::Date => &mut self.counters.date,
                    Refusal::Time => &mut self.counters.time,
                    Refusal::Unresolved => &mut self.counters.unresolved,
                    Refusal::Calendar(_) => &mut self.counters.calendar,
                    Refusal::TooOld => &mut self.counters.too_old,
                });
                Outcome::Refused(refusal)
            }
        }
    }

    /// What readers need, from now to the next mark.
    #[must_use]
    pub const fn base_time(&self) -> BaseTime {
        self.base
    }

    /// What became of the marks, in the same fields as those of pixclock's clock.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// What the clock is set by: the messages, once one has set it.
    #[must_use]
    pub const fn source(&self) -> Source {
        if self.base.is_set {
            Source::Message
        } else {
            Source::Nothing
        }
    }

    fn set(&mut self, epoch: UtcNanos, leap_seconds_known: bool, last_tick: Cycles) -> Outcome {
        let by_ns = epoch.since(self.base.utc_at(last_tick));
        let was_set = self.base.is_set;
        self.base = BaseTime {
            at: last_tick,
            utc: epoch,
            is_set: true,
            leap_seconds_known,
        };
        bump(&mut self.counters.accepted);
        bump(if !was_set {
            &mut self.counters.sets
        } else if by_ns > 0 {
            &mut self.counters.steps_forward
        } else {
            &mut self.counters.steps_back
        });
        if was_set {
            Outcome::Stepped { by_ns }
        } else {
            Outcome::Set
        }
    }
}

/// The epoch of a mark that PX4 1.9 sets its clock by.
fn accepted(mark: &TimeMark) -> Result<UtcNanos, Refusal> {
    let claims = mark.validity;
    if !claims.date {
        return Err(Refusal::Date);
    }
    if !claims.time {
        return Err(Refusal::Time);
    }
    if !claims.fully_resolved {
        return Err(Refusal::Unresolved);
    }
    let epoch = UtcNanos::from_civil(&mark.epoch).map_err(Refusal::Calendar)?;
    if epoch <= EARLIEST {
        return Err(Refusal::TooOld);
    }
    Ok(epoch)
}

const fn bump(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

#[cfg(test)]
mod tests {
    use timebase::{CORE_HZ, CivilTime, Validity};

    use super::*;

    const MS: u64 = CORE_HZ as u64 / 1_000;
    /// 2026-11-22T04:00:00Z.
    const FOUR: UtcNanos = UtcNanos(1_795_320_000_000_000_000);

    /// A mark that many ns after four, of a receiver without a complaint.
    fn mark(nano: i32) -> TimeMark {
        TimeMark {
            busy_us: 0,
            arrival: Cycles(0),
            epoch: CivilTime {
                year: 2026,
                month: 11,
                day: 22,
                hour: 4,
                minute: 0,
                second: 0,
                nano,
            },
            t_acc_ns: 20,
            validity: Validity {
                date: true,
                time: true,
                fully_resolved: true,
                confirmed: false,
                leap_seconds_known: true,
            },
        }
    }

    #[test]
    fn before_the_first_mark_it_reads_the_time_since_boot() {
        let reading = PaperClock::new().base_time().reading_at(Cycles(50 * MS));
        assert_eq!(reading.state, ClockState::Unset);
        assert_eq!(reading.utc, UtcNanos(50_000_000));
        assert!(!reading.leap_seconds_known);
    }

    #[test]
    fn each_mark_is_the_time_at_the_last_tick_be_it_forward_or_back() {
        let mut clock = PaperClock::new();
        assert_eq!(clock.source(), Source::Nothing);
        assert_eq!(clock.handle_mark(&mark(0), Cycles(50 * MS)), Outcome::Set);
        let reading = clock.base_time().reading_at(Cycles(50 * MS));
        assert_eq!((reading.utc, reading.state), (FOUR, ClockState::Unproved));
        assert_eq!(reading.uncertainty_ns, UNCERTAINTY_NS);
        assert!(reading.leap_seconds_known);
        // 9 ms later than the one before, and then 9 ms earlier.
        for (tick_ms, nano, by_ns) in [
            (259, 200_000_000, -9_000_000),
            (450, 400_000_000, 9_000_000),
        ] {
            let outcome = clock.handle_mark(&mark(nano), Cycles(tick_ms * MS));
            assert_eq!(outcome, Outcome::Stepped { by_ns });
            let utc = clock.base_time().reading_at(Cycles(tick_ms * MS)).utc;
            assert_eq!(utc, FOUR.plus_nanos(nano.into()));
        }
        let counters = clock.counters();
        assert_eq!((counters.accepted, counters.sets), (3, 1));
        assert_eq!((counters.steps_forward, counters.steps_back), (1, 1));
        assert_eq!(clock.source(), Source::Message);
    }

    #[test]
    fn whole_ticks_are_whole_microseconds_however_long_after_a_mark() {
        for tick_us in [50, 200, 500, 1_000_u64] {
            let mut clock = PaperClock::new();
            let set_at = Cycles::from_micros(tick_us * 1_234_567);
            clock.handle_mark(&mark(0), set_at);
            let base = clock.base_time();
            let day = 86_400_000_000 / tick_us;
            for tick in (0..10_000).chain((0..day).step_by(9_973)) {
                let elapsed_us = tick * tick_us;
                let when = set_at.plus(Cycles::from_micros(elapsed_us).0);
                let elapsed_ns = elapsed_us.cast_signed() * 1_000;
                assert_eq!(base.reading_at(when).utc, FOUR.plus_nanos(elapsed_ns));
            }
        }
    }

    #[test]
    fn a_base_time_is_the_same_after_it_was_words() {
        let mut clock = PaperClock::new();
        assert_eq!(clock.base_time().words(), [0; 5]);
        for at in [Cycles(50 * MS), Cycles(u64::MAX / 3)] {
            clock.handle_mark(&mark(123_456_789), at);
            let base = clock.base_time();
            assert_eq!(BaseTime::from_words(base.words()), base);
            clock.handle_mark(&mark(-1), at);
            let base = clock.base_time();
            assert_eq!(BaseTime::from_words(base.words()), base);
        }
    }

    #[test]
    fn a_reader_with_the_tick_before_the_mark_reads_the_time_before_it() {
        let mut clock = PaperClock::new();
        clock.handle_mark(&mark(0), Cycles(50 * MS));
        let utc = clock.base_time().reading_at(Cycles(49 * MS)).utc;
        assert_eq!(utc, FOUR.plus_nanos(-1_000_000));
    }

    #[test]
    fn it_takes_what_px4_takes_and_nothing_else() {
        let mut clock = PaperClock::new();
        let mut refusal = |change: fn(&mut TimeMark)| {
            let mut mark = mark(0);
            change(&mut mark);
            match clock.handle_mark(&mark, Cycles(MS)) {
                Outcome::Refused(refusal) => Some(refusal),
                _ => None,
            }
        };
        assert_eq!(refusal(|m| m.validity.date = false), Some(Refusal::Date));
        assert_eq!(refusal(|m| m.validity.time = false), Some(Refusal::Time));
        let unresolved = refusal(|m| m.validity.fully_resolved = false);
        assert_eq!(unresolved, Some(Refusal::Unresolved));
        assert_eq!(refusal(|m| m.epoch.year = 2008), Some(Refusal::TooOld));
        let no_month = refusal(|m| m.epoch.month = 13);
        assert!(matches!(no_month, Some(Refusal::Calendar(_))));
        // An unknown accuracy, the epoch of the mark before, an epoch from the past.
        assert_eq!(refusal(|m| m.t_acc_ns = u32::MAX), None);
        assert_eq!(refusal(|_| ()), None);
        assert_eq!(refusal(|m| m.epoch.year = 2010), None);
        let counters = clock.counters();
        assert_eq!((counters.accepted, counters.refused()), (3, 5));
    }
}
