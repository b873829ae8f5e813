//! What the paper's clock was set to last, shared between its task and its readers.
//!
//! *Design.* Plain words, copied under a critical section, as NuttX does it. They are atomic because
//! that needs no `unsafe`, and a static of their own so that a virtual board can read them by name.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use paper_clock::BaseTime;

/// The words of the [`BaseTime`]: unset until the first mark, and always in pixclock's variant.
static BASE_TIME: [AtomicU32; 5] = [const { AtomicU32::new(0) }; 5];

/// Replaces it.
pub fn set(base_time: BaseTime) {
    critical_section::with(|_| {
        for (word, value) in BASE_TIME.iter().zip(base_time.words()) {
            word.store(value, Relaxed);
        }
    });
}

/// The last one.
pub fn get() -> BaseTime {
    BaseTime::from_words(critical_section::with(|_| {
        BASE_TIME.each_ref().map(|word| word.load(Relaxed))
    }))
}
