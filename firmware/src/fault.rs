//! The end of a run: the reason into the log, then a blinking LED for ever.
//!
//! *Design.* Nothing of the running system is used: interrupts are off, the LED is
//! driven by its registers, time is counted in instructions.
//!
//! *Limits.* The reason is in the log's ring; a probe reads it there.

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use stm32f4xx_hal::pac::{GPIOE, RCC};
use timebase::CORE_HZ;

/// The amber LED, PE12.
const LED: u32 = 1 << 12;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    defmt::error!("panicked: {}", defmt::Display2Format(info));
    blink()
}

/// `defmt::panic!` has logged its reason already.
#[defmt::panic_handler]
fn logged_panic() -> ! {
    cortex_m::interrupt::disable();
    blink()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: reading the fault status has no side effect.
    let (configurable, hard) = unsafe { ((*SCB::PTR).cfsr.read(), (*SCB::PTR).hfsr.read()) };
    defmt::error!(
        "hard fault at {=u32:#010x}, called from {=u32:#010x}, CFSR {=u32:#010x}, HFSR {=u32:#010x}",
        frame.pc(),
        frame.lr(),
        configurable,
        hard
    );
    blink()
}

/// Ten flashes a second.
fn blink() -> ! {
    defmt::flush();
    // SAFETY: nothing else runs any more, so the registers are ours; the pin is
    // made an output because a fault may come before the board is up.
    unsafe {
        (*RCC::ptr()).ahb1enr().modify(|_, w| w.gpioeen().enabled());
        let gpioe = &*GPIOE::ptr();
        gpioe.moder().modify(|_, w| w.moder12().output());
        loop {
            gpioe.odr().modify(|r, w| w.bits(r.bits() ^ LED));
            cortex_m::asm::delay(CORE_HZ / 20);
        }
    }
}
