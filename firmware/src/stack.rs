//! How deep the stack has been.
//!
//! *Design.* [`reset`](crate::reset) has painted it; what is not painted any more was used. All handlers
//! and executors have the one stack.
//!
//! *Limits.* Words that hold the paint's value, or that a frame left out, count as unused, so the true
//! mark may lie a frame's gap deeper.

use crate::reset::PAINT;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// The most bytes that were in use at once since boot.
pub fn high_water() -> u32 {
    let (mut at, end) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: both are the ends of the stack, so what lies between is its memory. Reading it has no
    // effect on the code that uses it, and is volatile because that code changes it.
    while at < end && unsafe { at.read_volatile() } == PAINT {
        // SAFETY: at most one past the last word.
        at = unsafe { at.add(1) };
    }
    end.addr().wrapping_sub(at.addr()) as u32
}
