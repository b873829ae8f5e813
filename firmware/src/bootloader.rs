//! Back into the bootloader, which then waits for an upload.
//!
//! *Design.* PX4's bootloader stays when it finds [`REQUEST`] in the RTC's first backup register, which
//! a reset of the chip does not clear. It clears the word at once, so that the next start is an
//! ordinary one. The request that calls for it is answered first.
//!
//! *Limits.* A log that is being written to the card is cut off where it is. On a board without that
//! bootloader this is a restart.

use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use cortex_m::peripheral::SCB;
use stm32f4xx_hal::pac;

/// Stay in the bootloader (PX4-Bootloader, `main_f4.c`).
const REQUEST: u32 = 0xB007_B007;

static IS_CALLED: AtomicBool = AtomicBool::new(false);

/// Has the board restart into its bootloader, once what waits on its lines has left.
pub fn call() {
    IS_CALLED.store(true, Relaxed);
}

/// Whether it is to restart.
pub fn is_called() -> bool {
    IS_CALLED.load(Relaxed)
}

/// Restarts the chip into its bootloader.
pub fn reboot() -> ! {
    // SAFETY: nothing else uses these registers but by single bits of their own, and this code never
    // returns.
    let (rcc, pwr, rtc) = unsafe { (&*pac::RCC::ptr(), &*pac::PWR::ptr(), &*pac::RTC::ptr()) };
    cortex_m::interrupt::disable();
    rcc.apb1enr().modify(|_, w| w.pwren().enabled());
    // The enable takes effect two cycles of the bus later (ES0206, 2.2.13): reading it back waits so long.
    rcc.apb1enr().read();
    pwr.cr().modify(|_, w| w.dbp().set_bit());
    rtc.bkpr(0).write(|w| w.bkp().set(REQUEST));
    SCB::sys_reset()
}
