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
//! every model in the future of the call that made it, at the point where the
//! model before it will be then, and publishes it at once: a stamp has the same answer
//! whenever it is read, and later stamps have later answers.
//!
//! # Preconditions
//!
//! * One core: program order is what an interrupt sees, so a fence for the
//!   compiler is enough.
//! * One writer: [`Published::take_writer`] gives it once.
//! * Fewer than 2³² publications while one reader is interrupted.
//! * A model is out before it begins: [`UtcClock::LEAD`](crate::UtcClock::LEAD).
//! * No more than two are still to begin: the clock refuses what would make a third
//!   ([`Refusal::Backlog`](crate::Refusal::Backlog)).
//!
//! *Limits.* Three models are kept. A stamp from before the oldest of them is
//! read with that one prolonged: wrong by at most the difference of the slews in
//! between, 0.8 ms a second.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};

use timebase::{Cycles, Stamp};

use crate::model::{ClockModel, Reading, SHIFT};
use crate::utc::UtcNanos;

/// A shared 32-bit word: an atomic, or one of the exhaustive test, which acts on each access.
trait Word {
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

/// The clock's time line, which readers of any interrupt priority share with its one writer.
///
/// In a static of the board, or anywhere that outlives its readers.
#[derive(Debug)]
#[repr(C)]
pub struct Published {
    line: TimeLine<AtomicU32>,
    /// Whether the writer has been taken.
    is_taken: AtomicBool,
}

/// The writing half of a [`Published`]. There is one: it cannot be copied, nor taken twice.
///
/// ```compile_fail,E0382
/// use utc_clock::{Published, Settings, UtcClock};
///
/// let published = Published::new();
/// let writer = published.take_writer().unwrap();
/// let first = UtcClock::new(Settings::DEFAULT, writer);
/// let second = UtcClock::new(Settings::DEFAULT, writer);
/// ```
#[derive(Debug)]
pub struct Writer<'a>(&'a TimeLine<AtomicU32>);

impl Published {
    /// A clock that is unset and shows the time since boot.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            line: TimeLine {
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
            },
            is_taken: AtomicBool::new(false),
        }
    }

    /// A copy of a time line, from the words of its memory in another machine; `None` if there
    /// are too few. For tools that look at a board from outside; its writer counts as taken.
    #[must_use]
    pub fn from_words(words: &[u32]) -> Option<Self> {
        let (sequence, slots) = words.split_first()?;
        let (models, _) = slots.as_chunks();
        let models: &[[u32; 8]; 4] = models.first_chunk()?;
        Some(Self {
            line: TimeLine {
                sequence: AtomicU32::new(*sequence),
                slots: models.map(|model| model.map(AtomicU32::new)),
            },
            is_taken: AtomicBool::new(true),
        })
    }

    /// The writing half, for the one that asks first; `None` for all others.
    #[must_use]
    pub fn take_writer(&self) -> Option<Writer<'_>> {
        // Relaxed: on one core, and readers do not look at it.
        let was_taken = self.is_taken.swap(true, Ordering::Relaxed);
        (!was_taken).then_some(Writer(&self.line))
    }

    /// UTC at `when`, a stamp of the last 10 s: within those the low word of a model's beginning
    /// is enough to find its distance. Short where the newest model is in force, longer within
    /// [`LEAD`](crate::UtcClock::LEAD) of a change and for older stamps.
    #[must_use]
    #[inline]
    pub fn utc_of(&self, when: Stamp) -> UtcNanos {
        self.line.utc_of(when)
    }

    /// The whole reading at `when`, which may be a stamp from before the newest
    /// model.
    #[must_use]
    #[inline]
    pub fn reading_at(&self, when: Cycles) -> Reading {
        self.line.reading_at(when)
    }
}

impl Default for Published {
    fn default() -> Self {
        Self::new()
    }
}

impl Writer<'_> {
    /// Makes `model` the newest piece of the line.
    #[inline]
    pub(crate) fn publish(&mut self, model: &ClockModel) {
        self.0.publish(model);
    }
}

/// A time line in words of a kind.
#[derive(Debug)]
#[repr(C)]
struct TimeLine<W> {
    sequence: W,
    /// Each a model in the form of [`ClockModel::words`].
    slots: [[W; 8]; 4],
}

impl<W: Word> TimeLine<W> {
    /// An unset clock's; `make` makes a word that holds the value given.
    #[cfg(test)]
    fn over(make: impl Fn(u32) -> W) -> Self {
        Self {
            sequence: make(0),
            slots: [(); 4].map(|()| ClockModel::BOOT.words().map(&make)),
        }
    }

    /// Makes `model` the newest piece. For the one writer.
    #[inline]
    fn publish(&self, model: &ClockModel) {
        let next = self.sequence.load().wrapping_add(1);
        for (word, value) in self.slot(next).iter().zip(model.words()) {
            word.store(value);
        }
        compiler_fence(Ordering::SeqCst);
        self.sequence.store(next);
    }

    /// The newest piece.
    #[cfg(test)]
    fn newest(&self) -> ClockModel {
        self.model(self.sequence.load())
    }

    /// See [`Published::utc_of`].
    #[inline]
    fn utc_of(&self, when: Stamp) -> UtcNanos {
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

    /// See [`Published::reading_at`].
    fn reading_at(&self, when: Cycles) -> Reading {
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
mod tests {
    use super::*;

    #[test]
    fn the_writer_is_taken_once() {
        let published = Published::new();
        assert!(published.take_writer().is_some());
        assert!(published.take_writer().is_none());
    }

    #[test]
    fn a_copy_of_its_words_reads_the_same_and_has_no_writer() {
        let published = Published::new();
        let model = ClockModel {
            at: Cycles(123_456),
            base: UtcNanos(7_000),
            ..ClockModel::BOOT
        };
        published.take_writer().unwrap().publish(&model);
        let TimeLine { sequence, slots } = &published.line;
        let words: std::vec::Vec<u32> = [sequence]
            .into_iter()
            .chain(slots.as_flattened())
            .map(Word::load)
            .collect();
        let copy = Published::from_words(&words).unwrap();
        let when = Cycles(1_000_000);
        assert_eq!(copy.reading_at(when), published.reading_at(when));
        assert!(copy.take_writer().is_none());
        assert!(Published::from_words(&words[1..]).is_none());
    }
}

#[cfg(test)]
mod preemption;
