//! Sections that keep out some interrupts and let the others come.
//!
//! *Purpose.* What tasks share among themselves, or with the alarm, concerns neither the tick nor a line,
//! and must not keep a stamp waiting.
//!
//! *Design.* BASEPRI goes up to a priority and back ([`priorities`](crate::priorities)). Where a section is some
//! instructions long, `critical_section` is as good and masks everything.

use cortex_m::register::{basepri, basepri_max};

/// Runs `section` while whoever stands at `priority` or below is kept out. The callers of all sections
/// around one thing stand there or below.
#[inline(always)]
pub fn up_to<R>(priority: u8, section: impl FnOnce() -> R) -> R {
    let before = basepri::read();
    basepri_max::write(priority);
    let result = section();
    // SAFETY: what was found before, so that nothing is unmasked which was masked then.
    unsafe { basepri::write(before) };
    result
}
