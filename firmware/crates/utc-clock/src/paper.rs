//! The clock as the paper's boards kept it: a base time and whole ticks, set at every NAV-PVT.
//!
//! *Purpose.* What Shim, Joo and Kim (2021) measured, to be measured beside ours on the same
//! board.
//!
//! *Design.* PX4 1.9 gives `clock_settime` each NAV-PVT that claims date, time and full resolution
//! and lies behind `GPS_EPOCH_SECS` (PX4-GPSDrivers, `src/ubx.cpp` and `src/gps_helper.h`), as it is
//! parsed and without regard to the time that it took. NuttX 7 without its tickless option keeps
//! a base time and counts ticks: what it is set to is the time at the last tick, and what it
//! tells is the base and the ticks since (`sched/clock/clock_settime.c`, `clock_gettime.c`). So
//! here: whoever sets and whoever reads names the last tick
//! ([`last_tick`](timebase::tick::last_tick)), and between them stands a [`ClockModel`] of the
//! crystal's nominal rate.
//!
//! *Limits.* Nothing is known about its uncertainty, and it has no holdover: it runs on. Whole
//! ticks are whole µs for 2 000 s after a mark, within which a model's rate, rounded up, is less
//! than 1 µs too fast. A tick that NuttX loses while it masks interrupts is made good here, and
//! `clock_settime` does not set the chip's RTC, which masks them: both in the paper's favour.

use core::sync::atomic::AtomicU32;

use timebase::{Cycles, TimeMark};

use crate::clock::{Outcome, Source};
use crate::counters::bump;
use crate::model::{Quality, mult};
use crate::published::Word;
use crate::{ClockModel, ClockState, Counters, Ppb, Published, Refusal, UtcNanos, calendar};

/// PX4's `GPS_EPOCH_SECS`, 2009-02-13T23:31:30Z: it sets no clock to this or before.
const EARLIEST: UtcNanos = UtcNanos(1_234_567_890_000_000_000);

/// The clock that each mark sets anew, and the one writer of `line`.
#[derive(Debug)]
pub struct PaperClock<'a, W = AtomicU32> {
    line: &'a Published<W>,
    model: ClockModel,
    counters: Counters,
}

impl<'a, W: Word> PaperClock<'a, W> {
    /// A clock that is unset and will publish to `line`, which nobody has written to yet.
    #[must_use]
    pub fn new(line: &'a Published<W>) -> Self {
        Self {
            line,
            model: ClockModel::BOOT,
            counters: Counters::default(),
        }
    }

    /// Sets the clock to a mark, as of `last_tick`: [`Outcome::Set`] from unset, else
    /// [`Outcome::Stepped`], or a refusal.
    pub fn handle_mark(&mut self, mark: &TimeMark, last_tick: Cycles) -> Outcome {
        match accepted(mark) {
            Ok(epoch) => self.set(epoch, mark.validity.leap_seconds_known, last_tick),
            Err(refusal) => {
                self.counters.count_refusal(refusal);
                Outcome::Refused(refusal)
            }
        }
    }

    /// What became of the marks: all that were accepted set the clock.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// What the clock is set by: the messages, once one has set it.
    #[must_use]
    pub fn source(&self) -> Source {
        match self.model.quality.state {
            ClockState::Unset => Source::Nothing,
            ClockState::Set | ClockState::Holdover => Source::Message,
        }
    }

    fn set(&mut self, epoch: UtcNanos, leap_seconds_known: bool, last_tick: Cycles) -> Outcome {
        let by_ns = epoch.since(self.model.utc_at(last_tick));
        let was_unset = self.model.quality.state == ClockState::Unset;
        self.model = ClockModel {
            at: last_tick,
            base: epoch,
            fraction: 0,
            // Rounded up and not to the nearest, so that no tick is told a ns too early.
            mult: mult(Ppb(0)) + 1,
            quality: Quality {
                state: ClockState::Set,
                leap_seconds_known,
                uncertainty_ns: u32::MAX,
                growth: 0,
            },
        };
        self.line.publish(&self.model);
        bump(&mut self.counters.accepted);
        bump(if was_unset {
            &mut self.counters.sets
        } else if by_ns > 0 {
            &mut self.counters.steps_forward
        } else {
            &mut self.counters.steps_back
        });
        if was_unset {
            Outcome::Set
        } else {
            Outcome::Stepped { by_ns }
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
    // PX4's `mktime` takes any field; ours refuses those that name no instant.
    let epoch = calendar::to_utc(&mark.epoch).map_err(Refusal::Calendar)?;
    if epoch <= EARLIEST {
        return Err(Refusal::TooOld);
    }
    Ok(epoch)
}

#[cfg(test)]
mod tests {
    use timebase::{CORE_HZ, CivilTime, Validity};

    use super::*;

    const MS: u64 = CORE_HZ as u64 / 1_000;
    /// 2026-11-22T04:00:00Z.
    const FOUR: UtcNanos = UtcNanos(1_795_320_000_000_000_000);

    /// A mark of so many ns after four, of a receiver that is content with itself.
    fn mark(nano: i32) -> TimeMark {
        TimeMark {
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
    fn each_mark_is_the_time_at_the_last_tick_be_it_forward_or_back() {
        let line = Published::new();
        let mut clock = PaperClock::new(&line);
        assert_eq!(clock.source(), Source::Nothing);
        assert_eq!(clock.handle_mark(&mark(0), Cycles(50 * MS)), Outcome::Set);
        let reading = line.reading_at(Cycles(50 * MS));
        assert_eq!((reading.utc, reading.state), (FOUR, ClockState::Set));
        assert_eq!(reading.uncertainty_ns, u32::MAX);
        // 9 ms later than the one before, and then 9 ms earlier.
        for (tick_ms, nano, by_ns) in [
            (259, 200_000_000, -9_000_000),
            (450, 400_000_000, 9_000_000),
        ] {
            let outcome = clock.handle_mark(&mark(nano), Cycles(tick_ms * MS));
            assert_eq!(outcome, Outcome::Stepped { by_ns });
            let utc = line.reading_at(Cycles(tick_ms * MS)).utc;
            assert_eq!(utc, FOUR.plus_nanos(nano.into()));
        }
        let counters = clock.counters();
        assert_eq!((counters.accepted, counters.sets), (3, 1));
        assert_eq!((counters.steps_forward, counters.steps_back), (1, 1));
        assert_eq!(clock.source(), Source::Message);
    }

    #[test]
    fn whole_ticks_are_whole_microseconds_for_2000_s() {
        for tick_us in [50, 200, 500, 1_000_u64] {
            let line = Published::new();
            let mut clock = PaperClock::new(&line);
            let set_at = Cycles::from_micros(tick_us * 1_234_567);
            clock.handle_mark(&mark(0), set_at);
            let ticks = (0..10_000).chain((0..2_000_000_000 / tick_us).step_by(9_973));
            for tick in ticks {
                let elapsed_us = tick * tick_us;
                let when = set_at.plus(Cycles::from_micros(elapsed_us).0);
                let told_us = line.reading_at(when).utc.as_micros();
                assert_eq!(told_us, FOUR.as_micros() + elapsed_us);
            }
        }
    }

    #[test]
    fn it_takes_what_px4_takes_and_nothing_else() {
        let line = Published::new();
        let mut clock = PaperClock::new(&line);
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
        // An accuracy that is unknown, an epoch that was told before, one from the past.
        assert_eq!(refusal(|m| m.t_acc_ns = u32::MAX), None);
        assert_eq!(refusal(|_| ()), None);
        assert_eq!(refusal(|m| m.epoch.year = 2010), None);
        let counters = clock.counters();
        assert_eq!((counters.accepted, counters.refused()), (3, 5));
    }
}
