//! A 24-bit down-counter, extended to 64 bits by its interrupt and a witness.
//!
//! *Purpose.* Cycles since boot at any moment, from any interrupt, exact to one
//! cycle, even after interrupts were masked for many periods.
//!
//! *The race.* SysTick counts down and pends its exception when it wraps, but only once, even if
//! several wraps pass. A reader that adds the counter to a software count of wraps has to know
//! whether the last wrap has been counted yet, and no flag of SysTick has the number of those that
//! were not.
//!
//! *Design.* The software keeps an *anchor*: the time of a wrap, and what a second,
//! free-running 32-bit counter of the same clock (the *witness*, TIM5) showed
//! then. A reader reads the anchor, the witness and the counter with interrupts
//! masked. The witness gives the time since the anchor to within a few cycles; the
//! counter gives exactly how much of the present period has passed. Only one time
//! near the first agrees with the second, and that is the answer:
//!
//! ```text
//! coarse  = RATIO · (witness − witness at the anchor)
//! periods = round((coarse + down_count) / PERIOD)
//! elapsed = periods · PERIOD − down_count
//! ```
//!
//! It reads no flag and changes nothing, so every interrupt may do it. The tick
//! interrupt moves the anchor forward by one period, or by as many as have passed.
//!
//! *Why it is right.* `coarse` differs from the elapsed time by less than half a
//! period, so the rounding gives the one whole number for which `elapsed`
//! is the time of the counter's reading; a count of 0 belongs to the new period
//! and needs no special case. No reader finds an anchor that is half moved: readers
//! below the tick's priority cannot run while it runs, and mask it while they read.
//!
//! *Limits.* Readers run at or below the priority of the tick interrupt. The two
//! counters are read within a quarter of a period of each other
//! ([`CounterPair::read_pair`]). The anchor moves at least every 12 s (2³¹ cycles),
//! so interrupts must not be masked for longer. `tests/interleavings.rs` tries
//! every interleaving of a reader, the tick and a second interrupt.

use crate::{Cycles, Stamp};

/// The words that the tick interrupt and the readers share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// Cycles since boot at the anchor, low word.
    AnchorLow,
    /// Cycles since boot at the anchor, high word.
    AnchorHigh,
    /// The witness at the anchor.
    AnchorWitness,
    /// Ticks that were counted without an interrupt of their own.
    LostTicks,
}

/// The two hardware counters and the shared words: the firmware's time driver, or a
/// model of it in a test.
pub trait CounterPair {
    /// Core cycles from wrap to wrap of the down-counter.
    const PERIOD: u32;
    /// Core cycles in a count of the witness; divides [`Self::PERIOD`].
    const RATIO: u32;

    /// Reads `(witness, down_count)` within a quarter of a period of each other.
    /// `down_count` runs from `PERIOD − 1` to 0, and wraps as it becomes 0.
    fn read_pair(&self) -> (u32, u32);
    /// Reads the witness alone.
    fn read_witness(&self) -> u32;
    /// Reads one of the shared words.
    fn load(&self, word: Word) -> u32;
    /// Writes one of the shared words.
    fn store(&self, word: Word, value: u32);
    /// Runs `section` with interrupts masked.
    fn masked<R>(&self, section: impl FnOnce() -> R) -> R;
}

/// Sets the anchor to cycle 0 at the wrap before this moment.
///
/// Both counters run already. The time between the start of one and the start of the other is
/// measured here, once, and cancels in every reading. The witness is read last, and so shows less than
/// the time that has passed, by what the reading takes; `margin` makes that more, so that a tick is due
/// by the witness whatever the bus takes in the interrupt and here.
#[inline]
pub fn start<C: CounterPair>(counters: &C) {
    counters.masked(|| {
        let (down_count, witness) = loop {
            let (before, down_count) = counters.read_pair();
            let after = counters.read_witness();
            // On an emulator the host may pause us in between.
            if after.wrapping_sub(before) < C::PERIOD / C::RATIO / 4 {
                break (down_count, after);
            }
        };
        let since_wrap = (C::PERIOD - down_count) % C::PERIOD;
        counters.store(Word::AnchorLow, 0);
        counters.store(Word::AnchorHigh, 0);
        counters.store(
            Word::AnchorWitness,
            witness
                .wrapping_sub(since_wrap / C::RATIO)
                .wrapping_sub(margin::<C>()),
        );
        counters.store(Word::LostTicks, 0);
    });
}

/// Cycles since boot.
#[inline(always)]
pub fn now<C: CounterPair>(counters: &C) -> Cycles {
    let (anchor, since) = counters.masked(|| (load_anchor(counters), Since::read(counters)));
    Cycles(anchor.wrapping_add_signed(since.elapsed::<C>().into()))
}

/// The low word of [`now`]: for interrupts that must be short.
#[inline(always)]
pub fn stamp<C: CounterPair>(counters: &C) -> Stamp {
    let (low, since) = counters.masked(|| (counters.load(Word::AnchorLow), Since::read(counters)));
    Stamp(low.wrapping_add_signed(since.elapsed::<C>()))
}

/// The last tick that was counted: time since boot in whole ticks.
#[inline]
pub fn last_tick<C: CounterPair>(counters: &C) -> Cycles {
    Cycles(counters.masked(|| load_anchor(counters)))
}

/// The ticks that had an interrupt of their own, as the time since boot that somebody knows who counts
/// interrupts and nothing else: behind [`last_tick`] by each tick that was lost.
#[inline]
pub fn counted_ticks<C: CounterPair>(counters: &C) -> Cycles {
    let (anchor, lost) =
        counters.masked(|| (load_anchor(counters), counters.load(Word::LostTicks)));
    Cycles(anchor.saturating_sub(u64::from(lost) * u64::from(C::PERIOD)))
}

/// The first moment from `now` on at which a down-counter of that `period` shows
/// `down_count`: it wraps at whole periods since boot.
#[must_use]
pub const fn first_showing(down_count: u32, period: u32, now: Cycles) -> Cycles {
    let period = period as u64;
    let past = now.0.wrapping_add(down_count as u64) % period;
    Cycles(now.0.wrapping_add((period - past) % period))
}

/// The tick interrupt in the plain case: one period has passed, and most of the
/// next has not. Moves the anchor to the wrap and returns its time.
///
/// `None` when the witness alone is not enough to decide: nothing was done, and [`repair`] has
/// to be called. A witness that lags can cause such a call, but never a wrong result.
#[inline(always)]
pub fn on_tick<C: CounterPair>(counters: &C) -> Option<Stamp> {
    let one_period = counters
        .load(Word::AnchorWitness)
        .wrapping_add(C::PERIOD / C::RATIO);
    let late = counters.read_witness().wrapping_sub(one_period);
    (late < plainly_late::<C>()).then(|| {
        let anchor = load_anchor(counters).wrapping_add(u64::from(C::PERIOD));
        store_anchor(counters, anchor, one_period);
        Stamp(anchor as u32)
    })
}

/// How late a tick may be to count as plain, in counts of the witness: a power of two, which is
/// cheap to compare with, that leaves at least a 64th of a period for the error of the witness.
const fn plainly_late<C: CounterPair>() -> u32 {
    let period = C::PERIOD / C::RATIO;
    1 << (period - period.div_ceil(64)).ilog2()
}

/// By how much the witness is ahead of the time, in counts, where a period leaves as much: 64 cycles of
/// the core, which is several times what a register takes.
pub const AHEAD: u32 = 32;

/// [`AHEAD`], or half of what [`plainly_late`] leaves.
const fn margin<C: CounterPair>() -> u32 {
    let left = C::PERIOD / C::RATIO - plainly_late::<C>();
    if left / 2 < AHEAD { left / 2 } else { AHEAD }
}

/// The tick interrupt in every other case: it came late, after others were lost, or for a wrap
/// that an earlier repair has counted already. Moves the anchor to the last wrap and returns its
/// time.
#[inline]
pub fn repair<C: CounterPair>(counters: &C) -> Stamp {
    let since = Since::read(counters);
    let wraps = since.elapsed::<C>().max(0).cast_unsigned() / C::PERIOD;
    let lost = counters.load(Word::LostTicks);
    // Wraps without an interrupt. A repair may count the wrap of an interrupt that is still
    // pending; that one finds nothing to count, and takes the surplus back here.
    counters.store(Word::LostTicks, lost.wrapping_add(wraps).wrapping_sub(1));
    let anchor = load_anchor(counters).wrapping_add(u64::from(wraps * C::PERIOD));
    let witness = wraps * (C::PERIOD / C::RATIO);
    store_anchor(counters, anchor, since.anchor_witness.wrapping_add(witness));
    Stamp(anchor as u32)
}

#[inline(always)]
fn load_anchor<C: CounterPair>(counters: &C) -> u64 {
    let low = counters.load(Word::AnchorLow);
    u64::from(counters.load(Word::AnchorHigh)) << 32 | u64::from(low)
}

#[inline(always)]
fn store_anchor<C: CounterPair>(counters: &C, anchor: u64, witness: u32) {
    counters.store(Word::AnchorLow, anchor as u32);
    counters.store(Word::AnchorHigh, (anchor >> 32) as u32);
    counters.store(Word::AnchorWitness, witness);
}

/// What a masked section has to read before anything is computed.
struct Since {
    anchor_witness: u32,
    witness: u32,
    down_count: u32,
}

impl Since {
    #[inline(always)]
    fn read<C: CounterPair>(counters: &C) -> Self {
        let anchor_witness = counters.load(Word::AnchorWitness);
        let (witness, down_count) = counters.read_pair();
        Self {
            anchor_witness,
            witness,
            down_count,
        }
    }

    /// Cycles from the anchor to the reading of the down-counter. On an emulator the two
    /// counters may be out of step for a moment: then it is signed, so that a little less than
    /// 0 does not become 25 s.
    #[inline(always)]
    fn elapsed<C: CounterPair>(&self) -> i32 {
        let coarse = self
            .witness
            .wrapping_sub(self.anchor_witness)
            .wrapping_mul(C::RATIO);
        let periods = coarse
            .wrapping_add(self.down_count)
            .wrapping_add(C::PERIOD / 2)
            / C::PERIOD;
        periods
            .wrapping_mul(C::PERIOD)
            .wrapping_sub(self.down_count)
            .cast_signed()
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    /// Counters whose registers take their time: the cycles until a register is read.
    struct Bus {
        now: Cell<u64>,
        down_count_after: u64,
        witness_after: u64,
        words: [Cell<u32>; 4],
    }

    impl CounterPair for Bus {
        const PERIOD: u32 = 8_400;
        const RATIO: u32 = 2;

        fn read_pair(&self) -> (u32, u32) {
            let witness = self.read_witness();
            self.now.set(self.now.get() + self.down_count_after);
            let past = (self.now.get() % u64::from(Self::PERIOD)) as u32;
            self.now.set(self.now.get() + 1);
            (witness, (Self::PERIOD - past) % Self::PERIOD)
        }

        fn read_witness(&self) -> u32 {
            self.now.set(self.now.get() + self.witness_after);
            let witness = (self.now.get() / u64::from(Self::RATIO)) as u32;
            self.now.set(self.now.get() + 1);
            witness
        }

        fn load(&self, word: Word) -> u32 {
            self.words[word as usize].get()
        }

        fn store(&self, word: Word, value: u32) {
            self.words[word as usize].set(value);
        }

        fn masked<R>(&self, section: impl FnOnce() -> R) -> R {
            section()
        }
    }

    #[test]
    fn a_tick_that_is_in_time_is_plain_whatever_a_register_takes() {
        let period = u64::from(Bus::PERIOD);
        for (down_count_after, witness_after, entry) in
            [(0, 0, 0), (0, 60, 0), (30, 0, 1), (1, 12, 12), (2, 8, 40)]
        {
            for begins in [period, period + 1, 2 * period - 200] {
                let bus = Bus {
                    now: Cell::new(begins),
                    down_count_after,
                    witness_after,
                    words: Default::default(),
                };
                start(&bus);
                let first_wrap = bus.now.get().next_multiple_of(period);
                for tick in 0..4 {
                    bus.now.set(first_wrap + tick * period + entry);
                    let anchor = on_tick(&bus);
                    assert!(
                        anchor.is_some(),
                        "{down_count_after} {witness_after} {entry} {begins} {tick}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_count_of_interrupts_knows_nothing_of_ticks_that_were_lost() {
        let period = u64::from(Bus::PERIOD);
        let bus = Bus {
            now: Cell::new(period),
            down_count_after: 1,
            witness_after: 1,
            words: Default::default(),
        };
        start(&bus);
        let begin = bus.now.get() / period;
        // Late by so many periods, each time a little behind the wrap. The last one comes for a wrap that the
        // one before has counted.
        let mut interrupts = 0;
        for wraps in [1, 2, 5, 9, 9, 10] {
            bus.now.set((begin + wraps) * period + 20);
            interrupts += 1;
            if on_tick(&bus).is_none() {
                repair(&bus);
            }
            assert_eq!(last_tick(&bus), Cycles(wraps * period));
            assert_eq!(counted_ticks(&bus), Cycles(interrupts * period));
        }
    }

    #[test]
    fn a_down_count_names_one_moment_of_each_period() {
        const PERIOD: u32 = 42;
        for now in (0..200).chain((1 << 32) - 100..(1 << 32) + 100) {
            for ahead in 0..u64::from(PERIOD) {
                let then = now + ahead;
                let down_count = (PERIOD - (then % u64::from(PERIOD)) as u32) % PERIOD;
                assert_eq!(first_showing(down_count, PERIOD, Cycles(now)), Cycles(then));
            }
        }
    }
}
