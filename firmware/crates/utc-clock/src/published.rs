//! The time line, shared with readers of any interrupt priority.
//!
//! *Purpose.* One task steers the clock; interrupts above it and threads below
//! it read it, without a lock and without masking anything.
//!
//! # The race
//!
//! A model is eight words and the core stores one at a time. A reader that
//! interrupts the writer would find half of a new model; a reader that the
//! writer interrupts would go on with the second half of another one. And both
//! may hold a stamp from before the new model: it has to be read with the model
//! that was in force then, or time would go back.
//!
//! # The solution
//!
//! Four slots and a sequence number. Publication `n` fills slot `n mod 4`, then
//! stores `n`. A reader loads `n`, reads slot `n mod 4` (or an earlier one, for
//! an earlier stamp), loads the number again, and starts afresh if it changed.
//!
//! * A reader that interrupts the writer finds the number unchanged, since the
//!   writer cannot run: it never spins. The slot being filled is that of `n + 1`,
//!   which is that of `n − 3`: the slots of `n`, `n − 1` and `n − 2` are intact.
//! * A reader that the writer interrupted sees another number and reads again.
//!   That can happen once a publication, and those are milliseconds apart.
//!
//! So each answer comes from complete models of one moment. The clock begins
//! every model in the future of the call that made it, and at a point of the
//! line before it, and publishes it at once: a stamp's answer is the same at all
//! times, and later stamps have later answers.
//!
//! # Preconditions
//!
//! * One core: program order is what an interrupt sees, so a fence for the
//!   compiler is enough.
//! * One writer: a line belongs to one [`UtcClock`](crate::UtcClock).
//! * Fewer than 2³² publications while one reader is interrupted.
//! * A model is out before it begins: [`LEAD`](crate::clock::LEAD).
//! * No more than two are still to begin: the clock refuses what would make a third
//!   ([`Refusal::Backlog`](crate::Refusal::Backlog)).
//!
//! *Limits.* Three models are kept. A stamp from before the oldest of them is
//! read with that one prolonged: wrong by at most the slews in between,
//! 1 ms a second.

use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

use timebase::{Cycles, Stamp};

use crate::model::SHIFT;
use crate::{ClockModel, Reading, UtcNanos};

/// A shared 32-bit word; the exhaustive test has one that knows of each access.
pub trait Word {
    /// The word's value.
    fn load(&self) -> u32;
    /// Replaces the value.
    fn store(&self, value: u32);
}

impl Word for AtomicU32 {
    #[inline]
    fn load(&self) -> u32 {
        self.load(Ordering::Relaxed)
    }

    #[inline]
    fn store(&self, value: u32) {
        self.store(value, Ordering::Relaxed);
    }
}

/// Models before the newest that are intact while another one is written.
const OLDER: u32 = 2;

/// The clock's time line as readers see it.
#[derive(Debug)]
#[repr(C)]
pub struct Published<W = AtomicU32> {
    sequence: W,
    /// Each a model in the form of [`ClockModel::words`].
    slots: [[W; 8]; 4],
}

impl Published {
    /// A clock that is unset and tells the time since boot.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sequence: AtomicU32::new(0),
            slots: [const {
                let [a, b, c, d, e, f, g, h] = ClockModel::BOOT.words();
                [
                    AtomicU32::new(a),
                    AtomicU32::new(b),
                    AtomicU32::new(c),
                    AtomicU32::new(d),
                    AtomicU32::new(e),
                    AtomicU32::new(f),
                    AtomicU32::new(g),
                    AtomicU32::new(h),
                ]
            }; 4],
        }
    }
}

impl Default for Published {
    fn default() -> Self {
        Self::new()
    }
}

impl<W: Word> Published<W> {
    /// The same over other words; `make` makes one that holds the value given.
    pub fn over(make: impl Fn(u32) -> W) -> Self {
        Self {
            sequence: make(0),
            slots: [(); 4].map(|()| ClockModel::BOOT.words().map(&make)),
        }
    }

    /// Makes `model` the newest piece of the line. For the one writer.
    pub(crate) fn publish(&self, model: &ClockModel) {
        let next = self.sequence.load().wrapping_add(1);
        for (word, value) in self.slot(next).iter().zip(model.words()) {
            word.store(value);
        }
        compiler_fence(Ordering::SeqCst);
        self.sequence.store(next);
    }

    /// UTC at `when`, a stamp of the last 10 s: for those, one word tells how far
    /// the newest model is away. The short way where that is in force already, the
    /// long way within [`LEAD`](crate::clock::LEAD) of a change and for older stamps.
    #[must_use]
    #[inline]
    pub fn utc_of(&self, when: Stamp) -> UtcNanos {
        loop {
            let sequence = self.sequence.load();
            compiler_fence(Ordering::SeqCst);
            let [at_low, _, base_low, base_high, fraction, mult, ..] = self.slot(sequence);
            let distance = when.0.wrapping_sub(at_low.load());
            let product = u64::from(distance) * u64::from(mult.load());
            let elapsed = (product + u64::from(fraction.load())) >> SHIFT;
            let utc = double(base_low, base_high).wrapping_add(elapsed);
            compiler_fence(Ordering::SeqCst);
            if self.sequence.load() != sequence {
                continue;
            }
            if distance.cast_signed() < 0 {
                return self.utc_the_long_way(when);
            }
            return UtcNanos(utc.cast_signed());
        }
    }

    /// The whole reading at `when`, which may be a stamp from before the newest
    /// model.
    #[must_use]
    pub fn reading_at(&self, when: Cycles) -> Reading {
        loop {
            let sequence = self.sequence.load();
            compiler_fence(Ordering::SeqCst);
            let mut model = self.model(sequence);
            for age in 1..=OLDER {
                if when >= model.at() {
                    break;
                }
                model = self.model(sequence.wrapping_sub(age));
            }
            compiler_fence(Ordering::SeqCst);
            if self.sequence.load() == sequence {
                return model.reading_at(when);
            }
        }
    }

    #[cold]
    #[inline(never)]
    fn utc_the_long_way(&self, when: Stamp) -> UtcNanos {
        let at = self.model(self.sequence.load()).at();
        let distance = when.0.wrapping_sub(at.stamp().0).cast_signed();
        self.reading_at(Cycles(at.0.saturating_add_signed(distance.into())))
            .utc
    }

    fn model(&self, sequence: u32) -> ClockModel {
        ClockModel::from_words(self.slot(sequence).each_ref().map(Word::load))
    }

    #[inline]
    #[expect(clippy::indexing_slicing, reason = "masked to the four slots")]
    fn slot(&self, sequence: u32) -> &[W; 8] {
        &self.slots[(sequence & 3) as usize]
    }
}

#[inline]
fn double<W: Word>(low: &W, high: &W) -> u64 {
    u64::from(low.load()) | u64::from(high.load()) << 32
}

#[cfg(test)]
mod preemption;
