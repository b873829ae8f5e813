//! The end of a run: the reason in the log, then a flashing LED forever.
//!
//! *Design.* Nothing of the running system is used: interrupts are off, the LED is set by its
//! registers, time is counted in instructions.
//!
//! *Limits.* The reason is in the log's buffer, where a probe reads it.

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use timebase::CORE_HZ;

use crate::drivers::led;
use crate::logger;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: interrupts are off, and this never returns.
    unsafe { logger::seize() };
    defmt::error!("panicked: {}", defmt::Display2Format(info));
    flash_forever()
}

/// `defmt::panic!` has logged its reason before it comes here.
#[defmt::panic_handler]
fn logged_panic() -> ! {
    cortex_m::interrupt::disable();
    flash_forever()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: interrupts are off, and this never returns.
    unsafe { logger::seize() };
    // SAFETY: reading the fault status has no side effect.
    let (configurable, hard) = unsafe { ((*SCB::PTR).cfsr.read(), (*SCB::PTR).hfsr.read()) };
    defmt::error!(
        "hard fault at {=u32:#010x}, called from {=u32:#010x}, CFSR {=u32:#010x}, HFSR {=u32:#010x}",
        frame.pc(),
        frame.lr(),
        configurable,
        hard
    );
    flash_forever()
}

/// Ten flashes a second.
fn flash_forever() -> ! {
    // SAFETY: interrupts are off, and this code never returns.
    let mut change_led = unsafe { led::seize() };
    loop {
        change_led();
        cortex_m::asm::delay(CORE_HZ / 20);
    }
}
