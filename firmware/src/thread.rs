//! Thread level: asleep until an interrupt has work for it.
//!
//! *Design.* The tasks run in interrupts, so thread level has no part in them. While it sleeps, the
//! core goes back to sleep as the last interrupt returns, without a step at thread level
//! (SCR.SLEEPONEXIT, ARM DUI 0553A, section 4.3.6).

use cortex_m::peripheral::SCB;

/// SCR.SLEEPONEXIT.
const SLEEP_ON_EXIT: u32 = 1 << 1;

/// Sleeps until `is_wanted` is true. The interrupt that makes it true calls [`wake`] after that.
pub fn sleep_until(is_wanted: impl Fn() -> bool) {
    while !is_wanted() {
        // The question and the bit are one step: a wake-up between them would be slept through. An
        // interrupt that comes meanwhile ends the wait, and runs when the section ends.
        critical_section::with(|_| {
            if !is_wanted() {
                // SAFETY: the bit changes only when the core sleeps, not what it computes.
                unsafe { (*SCB::PTR).scr.modify(|scr| scr | SLEEP_ON_EXIT) };
                cortex_m::asm::wfi();
            }
        });
    }
}

/// Lets thread level run when the interrupts have returned. From any interrupt.
pub fn wake() {
    critical_section::with(|_| {
        // SAFETY: as above; thread level asks again whether it is wanted.
        unsafe { (*SCB::PTR).scr.modify(|scr| scr & !SLEEP_ON_EXIT) };
    });
}
