//! When an edge started a timer, as cycles since boot.
//!
//! *Purpose.* Of an edge that rings, the first counts, and no register keeps that one: a capture has the
//! last. So the edge starts the timer, which runs on whatever comes after. [`Start`] finds
//! when that was from readings of both counters, and how well they know it.
//!
//! *Design.* Timer and cycle count have one clock, so all that is unknown is the moment of the count 0.
//! A count *c* stands for two cycles from `start + 2c` on. What a register showed before another one, or
//! after it, bounds the start from one side; how long a reading takes is never asked, so a bus that is
//! slow, or slower on one side, makes the interval wider and not wrong:
//!
//! ```text
//! c, then SysTick at t:   start + 2c     < t + 1
//! SysTick at t, then c:   start + 2c + 2 > t
//! ```
//!
//! The edge came before the start, by what the timer's input takes to let it in ([`SYNCHRONISER`]).
//!
//! *Limits.* The readings lie within a round of the timer, 780 µs, and within half a tick of the moment from
//! which they are counted.

use crate::{CORE_HZ, Cycles};

/// Core cycles in a count: TIM4 counts the timer clock of APB1, half the core's (RM0090,
/// section 6.2).
pub const RATIO: i32 = 2;

/// From an edge to the count 0, in cycles: the input is resynchronised and its edge detected, 2 to 3
/// counts (RM0090, section 18.3.14, names the delay and no figure; two flip-flops and a detector).
/// `docs/hardware.md` says how metal can be asked.
pub const SYNCHRONISER: i32 = 5;

/// How far off that may be, in cycles: half a count.
const SYNCHRONISER_UNKNOWN: i32 = 1;

/// Half of the widest interval that is good enough, in cycles.
const MOST_UNKNOWN: i32 = 8;

/// How far an edge may be from the moment that is given for it, in ns, rounded up.
pub const UNKNOWN_NS: u32 =
    ((MOST_UNKNOWN + SYNCHRONISER_UNKNOWN) as u32 * 1_000).div_ceil(CORE_HZ / 1_000_000);

/// What is known about the start of a timer: an interval that readings narrow. Moments are in cycles
/// after one that the caller keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// It was after this.
    after: i32,
    /// It was before this.
    before: i32,
}

impl Start {
    /// Before any reading.
    pub const UNKNOWN: Self = Self {
        after: i32::MIN,
        before: i32::MAX,
    };

    /// The timer showed `count`, and then it was `at`.
    #[inline]
    pub fn count_then_time(&mut self, count: u16, at: i32) {
        let bound = at.wrapping_add(1).wrapping_sub(RATIO * i32::from(count));
        self.before = self.before.min(bound);
    }

    /// It was `at`, and then the timer showed `count`.
    #[inline]
    pub fn time_then_count(&mut self, at: i32, count: u16) {
        let bound = at.wrapping_sub(RATIO * (i32::from(count) + 1));
        self.after = self.after.max(bound);
    }

    /// When the edge came: `None` if it is not known to [`UNKNOWN_NS`], or if the readings contradict
    /// each other. `reference` is the moment from which they are counted.
    #[must_use]
    pub fn edge(self, reference: Cycles) -> Option<Cycles> {
        let width = self.before.checked_sub(self.after)?;
        if !(1..=2 * MOST_UNKNOWN).contains(&width) {
            return None;
        }
        let since = self.after + width / 2 - SYNCHRONISER;
        Some(Cycles(reference.0.wrapping_add_signed(since.into())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bus: how long after an instruction begins its register is looked at, and how long until the
    /// next one begins.
    #[derive(Clone, Copy, Debug)]
    struct Bus {
        count: (i32, i32),
        time: (i32, i32),
    }

    /// What `blocks` readings in turn, with a pause between them that grows, say of a timer that was
    /// started at `start`; the first begins at `from`.
    fn read(bus: Bus, start: i32, from: i32, blocks: i32) -> Start {
        let mut known = Start::UNKNOWN;
        let mut now = from;
        let count = |now: &mut i32| {
            let looked_at = *now + bus.count.0;
            *now = looked_at + bus.count.1;
            ((looked_at - start) / RATIO) as u16
        };
        let time = |now: &mut i32| {
            let looked_at = *now + bus.time.0;
            *now = looked_at + bus.time.1;
            looked_at
        };
        for pause in 0..blocks {
            let before = count(&mut now);
            let at = time(&mut now);
            known.count_then_time(before, at);
            let after = count(&mut now);
            known.time_then_count(at, after);
            now += pause;
        }
        known
    }

    #[test]
    fn the_start_lies_in_the_interval_whatever_the_bus_takes() {
        for count in [(0, 1), (1, 0), (3, 1), (8, 4), (12, 0), (0, 12)] {
            for time in [(0, 1), (1, 0), (1, 2), (2, 9)] {
                let bus = Bus { count, time };
                for start in -2_000..-1_900 {
                    let known = read(bus, start, 0, 4);
                    assert!(
                        known.after < start && start < known.before,
                        "{bus:?} {start}: {known:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn an_edge_is_given_within_what_is_unknown_or_not_at_all() {
        let reference = Cycles(1 << 33);
        let mut given = 0;
        for wait in 0..14 {
            for lag in 0..14 {
                let bus = Bus {
                    count: (wait, 1),
                    time: (lag, 1),
                };
                for start in -300..-280 {
                    let edge = start - SYNCHRONISER;
                    let Some(at) = read(bus, start, 0, 4).edge(reference) else {
                        continue;
                    };
                    given += 1;
                    let off = at.since(reference) - i64::from(edge);
                    assert!(off.abs() <= MOST_UNKNOWN.into(), "{bus:?} {start}: {off}");
                }
            }
        }
        // Fast buses, each with every start.
        assert!(given > 20 * 50, "{given}");
    }

    #[test]
    fn what_is_too_wide_or_contradicts_itself_is_not_given() {
        let reference = Cycles(5);
        assert_eq!(Start::UNKNOWN.edge(reference), None);
        let mut known = Start::UNKNOWN;
        known.count_then_time(100, 1_000);
        assert_eq!(known.edge(reference), None);
        known.time_then_count(1_000, 120);
        // 240 and 200 cycles before.
        assert_eq!(known.edge(reference), None);
        known.time_then_count(1_000, 500);
        assert_eq!(known.edge(reference), None);
        let mut close = Start::UNKNOWN;
        close.count_then_time(100, 1_000);
        close.time_then_count(1_000, 100);
        assert_eq!(close.edge(reference), Some(Cycles(5 + 799 - 5)));
    }
}
