//! The firmware's clock, read from outside.
//!
//! *Purpose.* [`Pixhawk::clock`] is the time that the board has at a moment that is known to
//! the nanosecond, without the rounding and the way of a MAVLink answer.
//!
//! *Design.* What the firmware publishes for its own readers is in statics: the
//! timeline (`CLOCK`, words in the layout of [`Published`]), in the paper's variants the
//! base time in its place, and the anchor of the time since boot (`WORDS`, in the order of
//! [`timebase::tick::Word`]). The witness of that anchor, TIM5, is read in the emulator,
//! without the side effects of a read. Cycles since boot are the anchor and what the
//! witness has counted since; the clock is then read by the firmware's own code.
//!
//! *Limits.* TIM5 counts every second cycle and was started beside SysTick with an
//! uncertainty of as much, so a reading is good to 4 cycles, 24 ns. A board that stands in
//! the middle of its tick interrupt has half an anchor; so a reading takes two looks
//! 2 µs apart that have to agree, and the board has run on by then.

use anyhow::{Context as _, ensure};
use paper_clock::BaseTime;
use timebase::Cycles;
use timebase::tick::AHEAD;
use utc_clock::{Published, Reading};
use world::WorldNanos;

use crate::run::Pixhawk;

/// The firmware's clock, a [`Published`].
const TIMELINE: &str = "firmware::clock::CLOCK";
/// The clock of the paper's variants, the words of a [`BaseTime`].
const BASE_TIME: &str = "firmware::base_time::BASE_TIME";
/// The words of the time since boot.
const ANCHOR: &str = "firmware::drivers::time::WORDS";
/// TIM5's counter (RM0090 2.3, 18.4.10), which counts every second core cycle.
const WITNESS: u64 = 0x4000_0C00 + 0x24;
const WITNESS_RATIO: u32 = 2;
/// The last rise of the pulse that was passed on, the low word of its cycles.
const LAST_RISE: &str = "firmware::drivers::pulse::LAST_RISE";
/// Between two looks, in ns, and by how many cycles they may disagree about it.
const APART_NS: u64 = 2_000;
const APART_CYCLES: u64 = 336;
const DISAGREE_CYCLES: u64 = 32;
/// How many looks to take before it is given up.
const LOOKS: usize = 8;

/// What the board's clock showed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockReading {
    /// When, in true time.
    pub at: WorldNanos,
    /// Cycles since boot by the board's own count.
    pub cycles: Cycles,
    /// UTC by the board's clock, with its quality.
    pub reading: Reading,
}

impl Pixhawk {
    /// Reads the board's clock; it runs on for a few µs.
    ///
    /// # Errors
    ///
    /// The image has no such clock, it has not been started yet, or the emulator
    /// gave up.
    pub fn clock(&mut self) -> anyhow::Result<ClockReading> {
        let mut before = self.cycles()?;
        for _ in 0..LOOKS {
            self.run_for(APART_NS)?;
            let cycles = self.cycles()?;
            let passed = cycles.0.wrapping_sub(before.0);
            if passed.abs_diff(APART_CYCLES) <= DISAGREE_CYCLES {
                return Ok(ClockReading {
                    at: self.now(),
                    cycles,
                    reading: self.reading_at(cycles)?,
                });
            }
            before = cycles;
        }
        anyhow::bail!("the board's time since boot does not run")
    }

    /// When the pulse last rose, by the board's own count and by what its firmware made of it, at most 12 s
    /// before `now`.
    ///
    /// # Errors
    ///
    /// The image has no such word, or the emulator gave up.
    pub fn last_rise(&mut self, now: Cycles) -> anyhow::Result<Cycles> {
        let words = self.words(LAST_RISE)?;
        let low = words.first().copied().unwrap_or_default();
        let since = (now.0 as u32).wrapping_sub(low).cast_signed();
        Ok(Cycles(now.0.wrapping_add_signed(-i64::from(since))))
    }

    /// Cycles since boot, to some cycles: from the witness alone, which was read a little later than
    /// SysTick at the start. Wrong in the middle of the tick interrupt.
    fn cycles(&mut self) -> anyhow::Result<Cycles> {
        let words = self.words(ANCHOR)?;
        let &[low, high, at_anchor, ..] = words.as_slice() else {
            anyhow::bail!("{ANCHOR} has other words than expected");
        };
        let since = self
            .peek(WITNESS)?
            .wrapping_sub(at_anchor)
            .wrapping_sub(AHEAD)
            .wrapping_mul(WITNESS_RATIO);
        let anchor = u64::from(high) << 32 | u64::from(low);
        Ok(Cycles(anchor + u64::from(since)))
    }

    fn reading_at(&mut self, cycles: Cycles) -> anyhow::Result<Reading> {
        let Ok(words) = self.words(BASE_TIME) else {
            // An image of pixclock's variant has no such static.
            return Ok(self.timeline()?.reading_at(cycles));
        };
        let words = words
            .try_into()
            .map_err(|_| anyhow::anyhow!("{BASE_TIME} has other words than expected"))?;
        Ok(BaseTime::from_words(words).reading_at(cycles))
    }

    fn timeline(&mut self) -> anyhow::Result<Published> {
        let words = self.words(TIMELINE)?;
        Published::from_words(&words)
            .with_context(|| format!("{TIMELINE} is smaller than this program's"))
    }

    /// The words of a static; the compiler may have split it into its elements.
    fn words(&mut self, name: &str) -> anyhow::Result<Vec<u32>> {
        let mut bytes = Vec::new();
        if self.firmware().symbol(name).is_ok() {
            bytes = self.read(name)?;
        } else {
            for part in 0.. {
                let part = format!("{name}.{part}");
                if self.firmware().symbol(&part).is_err() {
                    break;
                }
                bytes.extend(self.read(&part)?);
            }
        }
        ensure!(!bytes.is_empty(), "the image has no static {name}");
        let words = bytes.as_chunks::<4>().0;
        Ok(words.iter().copied().map(u32::from_le_bytes).collect())
    }
}
