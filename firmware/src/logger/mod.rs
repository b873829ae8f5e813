//! The log: defmt's frames, written under a mask that leaves every stamp alone.
//!
//! *Purpose.* Tasks and thread level log as much as they like, and no tick, byte, alarm or edge waits
//! for it.
//!
//! *Design.* The loggers that come with defmt mask every interrupt for the length of a frame, and the
//! status line is as long as a byte of the lines. Here BASEPRI goes up to the executors' level
//! ([`LEVEL`]) instead: it keeps out all who log, and nobody else. A frame is [staged](out) and shows
//! to its reader when it is whole. One that does not fit is dropped and counted, and nothing waits
//! for a reader: what is there stays whole, and a gap says how wide it is. To overwrite the oldest
//! would lose as much without a number, and a frame cut in two besides. The
//! last words of a board that stops are the exception: see [`seize`].
//!
//! A frame inside a frame can only be begun above the executors' level or by a fault. It is dropped
//! and counted like one that does not fit; so it harms neither the other nor its own caller.
//!
//! *Limits.* A frame delays the tasks, by as long as it takes to write.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed, compiler_fence};

use cortex_m::register::{basepri, basepri_max};
use defmt::Encoder;

use crate::priorities::EXECUTOR_HIGH;

#[cfg_attr(feature = "pixhawk1", path = "rtt.rs")]
#[cfg_attr(feature = "qemu", path = "semihosting.rs")]
mod out;

use out::Out;

/// BASEPRI while a frame is written: that of the highest who log.
const LEVEL: u8 = EXECUTOR_HIGH;

/// Frames that have begun and not ended: 1 in a frame, more in one that is dropped for it.
static DEPTH: AtomicU32 = AtomicU32::new(0);
/// Frames that did not fit, or began inside another one. It wraps.
static DROPPED: AtomicU32 = AtomicU32::new(0);
static FRAME: FrameCell = FrameCell(UnsafeCell::new(Frame {
    basepri: 0,
    encoder: Encoder::new(),
    out: Out::new(),
}));

struct FrameCell(UnsafeCell<Frame>);

// SAFETY: touched only by who has brought `DEPTH` from 0 to 1. Nobody else does so before that one has
// brought it back: whoever preempts a frame finds 1, and returns before the frame goes on.
unsafe impl Sync for FrameCell {}

/// The frame that is being written.
struct Frame {
    /// BASEPRI before it.
    basepri: u8,
    encoder: Encoder,
    out: Out,
}

#[defmt::global_logger]
struct Logger;

// SAFETY: a frame has the encoder for itself, as at `FrameCell`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        let before = basepri::read();
        basepri_max::write(LEVEL);
        if begin() {
            // SAFETY: `begin` has brought DEPTH from 0 to 1.
            let Frame {
                basepri,
                encoder,
                out,
            } = unsafe { &mut *FRAME.0.get() };
            *basepri = before;
            out.begin();
            encoder.start_frame(|bytes| out.put(bytes));
        }
    }

    unsafe fn write(bytes: &[u8]) {
        if DEPTH.load(Relaxed) == 1 {
            // SAFETY: DEPTH is 1 for the frame that brought it there, which is this one.
            let Frame { encoder, out, .. } = unsafe { &mut *FRAME.0.get() };
            encoder.write(bytes, |bytes| out.put(bytes));
        }
    }

    unsafe fn release() {
        let depth = DEPTH.load(Relaxed);
        if depth == 1 {
            // SAFETY: as in `write`.
            let Frame {
                basepri: before,
                encoder,
                out,
            } = unsafe { &mut *FRAME.0.get() };
            encoder.end_frame(|bytes| out.put(bytes));
            if !out.commit() {
                count_dropped();
            }
            let before = *before;
            compiler_fence(core::sync::atomic::Ordering::SeqCst);
            DEPTH.store(0, Relaxed);
            // SAFETY: what `acquire` found, so that nothing is unmasked which was masked then.
            unsafe { basepri::write(before) };
        } else {
            DEPTH.store(depth.saturating_sub(1), Relaxed);
        }
    }

    unsafe fn flush() {
        // A reader is never waited for.
    }
}

/// Begins a frame; whether it is the only one.
fn begin() -> bool {
    // Not one step, and need not be: who preempts this has put `DEPTH` back when it returns.
    let depth = DEPTH.load(Relaxed);
    DEPTH.store(depth + 1, Relaxed);
    compiler_fence(core::sync::atomic::Ordering::SeqCst);
    if depth > 0 {
        count_dropped();
    }
    depth == 0
}

/// Callers are above each other, so that one may lose the count of another; it does not matter.
fn count_dropped() {
    DROPPED.store(DROPPED.load(Relaxed).wrapping_add(1), Relaxed);
}

/// Frames that were dropped: they did not fit, or began inside another one. It wraps.
pub fn dropped() -> u32 {
    DROPPED.load(Relaxed)
}

/// Takes the log for a board's last words, whatever is being logged: a frame that is not whole is given
/// up, and what has not been read as well when there is no room for a few lines more. The frames
/// after this are written as always.
///
/// # Safety
///
/// Interrupts are off and stay so, and whoever was interrupted never goes on.
pub unsafe fn seize() {
    // SAFETY: by the contract nobody else touches the frame any more.
    let frame = unsafe { &mut *FRAME.0.get() };
    frame.encoder = Encoder::new();
    frame.out.make_room();
    DEPTH.store(0, Relaxed);
}
