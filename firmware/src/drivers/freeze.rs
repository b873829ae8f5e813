//! What stands still with the core while a debugger halts it.
//!
//! *Design.* SysTick does so by itself (ARM DUI 0553A, 4.4). The timers whose counts are compared with
//! it have to be told, or the two disagree for good; and the watchdog, or every breakpoint ends in a
//! reset. The register outlives resets and costs nothing without a debugger (RM0090, 38.16.4).

use stm32f4xx_hal::pac::DBGMCU;

/// DBGMCU_APB1_FZ.
mod bits {
    pub(super) const TIM4: u32 = 1 << 2;
    pub(super) const TIM5: u32 = 1 << 3;
    pub(super) const IWDG: u32 = 1 << 12;
}

/// From now on the timers and the watchdog stand still with the core.
pub fn with_the_core() {
    // SAFETY: the bits change nothing while no debugger halts the core.
    unsafe {
        (*DBGMCU::ptr())
            .apb1_fz()
            .modify(|r, w| w.bits(r.bits() | bits::TIM4 | bits::TIM5 | bits::IWDG));
    }
}
