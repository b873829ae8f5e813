//! A 24-bit down-counter, extended to 64 bits by its interrupt and a witness.
//!
//! *Purpose.* Cycles since boot at any moment, from any interrupt, exact to one
//! cycle, even after interrupts were masked for many periods.
//!
//! *The race.* SysTick counts down and pends its exception when it wraps, once,
//! however many wraps pass. A reader that adds the counter to a software count
//! of wraps has to know whether the wrap that it sees has been counted yet, and
//! no flag of SysTick tells how many were not.
//!
//! *Design.* The software keeps an *anchor*: the time of a wrap, and what a second,
//! free-running 32-bit counter of the same clock (the *witness*, TIM5) showed
//! then. A reader takes the anchor, the witness and the counter with interrupts
//! masked. The witness says how long ago the anchor was to within a few cycles;
//! the counter says exactly how far the present period is. The only time near the
//! first that agrees with the second is the answer:
//!
//! ```text
//! coarse  = RATIO · (witness − witness at the anchor)
//! periods = round((coarse + down_count) / PERIOD)
//! elapsed = periods · PERIOD − down_count
//! ```
//!
//! It asks no flag and changes nothing, so every interrupt may do it. The tick
//! interrupt moves the anchor on by one period, or by as many as have passed.
//!
//! *Why it is right.* `coarse` differs from the elapsed time by less than half a
//! period, so the rounding gives the one whole number for which `elapsed`
//! is the time of the counter's reading; a count of 0 belongs to the new period
//! and needs no special case. Nobody sees an anchor half moved: readers below
//! the tick's priority cannot run while it runs, and mask it while they read.
//!
//! *Limits.* Readers run at or below the priority of the tick interrupt. The two
//! counters are read within a quarter of a period of each other
//! ([`Counters::read_pair`]). The anchor moves at least every 25 s (2³² cycles),
//! so interrupts must not be masked for longer. `tests/interleavings.rs` walks
//! through every interleaving of a reader, the tick and a second interrupt.

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

/// The two hardware counters and the shared words, as the firmware's time driver
/// or a model of it has them.
pub trait Counters {
    /// Core cycles from wrap to wrap of the down-counter.
    const PERIOD: u32;
    /// Core cycles a count of the witness; divides [`Self::PERIOD`].
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
/// Both counters run already. Whatever time lies between starting one and the
/// other is measured here, once, and cancels in every reading. The witness is
/// read last, so that it never shows more than the time that has passed: a tick
/// that it calls due is due.
#[inline]
pub fn start<C: Counters>(counters: &C) {
    counters.masked(|| {
        let (down_count, witness) = loop {
            let (before, down_count) = counters.read_pair();
            let after = counters.read_witness();
            // On an emulator the host may stop us in between.
            if after.wrapping_sub(before) < C::PERIOD / C::RATIO / 4 {
                break (down_count, after);
            }
        };
        let since_wrap = (C::PERIOD - down_count) % C::PERIOD;
        counters.store(Word::AnchorLow, 0);
        counters.store(Word::AnchorHigh, 0);
        counters.store(
            Word::AnchorWitness,
            witness.wrapping_sub(since_wrap / C::RATIO),
        );
        counters.store(Word::LostTicks, 0);
    });
}

/// Cycles since boot.
#[inline(always)]
pub fn now<C: Counters>(counters: &C) -> Cycles {
    let (low, high, since) = counters.masked(|| {
        (
            counters.load(Word::AnchorLow),
            counters.load(Word::AnchorHigh),
            Since::read(counters),
        )
    });
    let anchor = u64::from(high) << 32 | u64::from(low);
    Cycles(anchor.wrapping_add(u64::from(since.elapsed::<C>())))
}

/// The low word of [`now`]: for interrupts that must be short.
#[inline(always)]
pub fn stamp<C: Counters>(counters: &C) -> Stamp {
    let (low, since) = counters.masked(|| (counters.load(Word::AnchorLow), Since::read(counters)));
    Stamp(low.wrapping_add(since.elapsed::<C>()))
}

/// The tick interrupt: moves the anchor to the wrap that it was raised for, or
/// past all that went by while interrupts were masked. Returns the anchor's time.
///
/// The witness alone tells the plain case: one period has passed, and less than
/// three quarters of the next. A witness that lags costs a repair that finds one
/// wrap; it is never wrong.
#[inline(always)]
pub fn on_tick<C: Counters>(counters: &C) -> Stamp {
    let period = C::PERIOD / C::RATIO;
    let anchor = counters.load(Word::AnchorWitness);
    let since = counters.read_witness().wrapping_sub(anchor);
    if since.wrapping_sub(period) < period / 4 * 3 {
        advance(counters, anchor, 1)
    } else {
        repair(counters)
    }
}

/// A tick that came late, after others were lost, or for a wrap that an earlier
/// repair has counted already.
#[cold]
#[inline(never)]
fn repair<C: Counters>(counters: &C) -> Stamp {
    let since = Since::read(counters);
    let wraps = since.elapsed::<C>() / C::PERIOD;
    let lost = counters.load(Word::LostTicks);
    // Wraps without an interrupt; a repair that ran ahead of a pending one is
    // made good when that comes and finds nothing to count.
    counters.store(Word::LostTicks, lost.wrapping_add(wraps).wrapping_sub(1));
    advance(counters, since.anchor_witness, wraps)
}

/// Moves the anchor on by `wraps` periods.
#[inline(always)]
fn advance<C: Counters>(counters: &C, anchor_witness: u32, wraps: u32) -> Stamp {
    let low = counters.load(Word::AnchorLow);
    let (low, carry) = low.overflowing_add(wraps.wrapping_mul(C::PERIOD));
    let high = counters.load(Word::AnchorHigh);
    counters.store(Word::AnchorLow, low);
    counters.store(Word::AnchorHigh, high.wrapping_add(u32::from(carry)));
    counters.store(
        Word::AnchorWitness,
        anchor_witness.wrapping_add(wraps.wrapping_mul(C::PERIOD / C::RATIO)),
    );
    Stamp(low)
}

/// What a masked section has to read before anything is computed.
struct Since {
    anchor_witness: u32,
    witness: u32,
    down_count: u32,
}

impl Since {
    #[inline(always)]
    fn read<C: Counters>(counters: &C) -> Self {
        let anchor_witness = counters.load(Word::AnchorWitness);
        let (witness, down_count) = counters.read_pair();
        Self {
            anchor_witness,
            witness,
            down_count,
        }
    }

    /// Cycles from the anchor to the reading of the down-counter.
    #[inline(always)]
    fn elapsed<C: Counters>(&self) -> u32 {
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
    }
}
