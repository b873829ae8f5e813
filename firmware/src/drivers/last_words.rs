//! What a board that has no tasks any more, or none yet, says on the MAVLink line.
//!
//! *Design.* USART2 by its registers, at the rate of whatever clock the core has by now, each byte waited
//! for. Whoever had the line is cut off.
//!
//! *Limits.* On HSI the rate is off by as much as that oscillator is, 1 % at room temperature (DS9484): a
//! UART takes that.

use stm32f4xx_hal::pac::{GPIOD, RCC, USART2};

use crate::board;
use crate::settings::MAVLINK_BAUD;

/// How often the transmitter is looked at before a byte is given up: it has one in 14 600 cycles, at
/// 57600 Bd in twice as many.
const LOOKS: u32 = 20_000;

/// Sends `bytes`, and waits until they have left.
///
/// # Safety
///
/// Interrupts are off, and no other code runs any more.
pub unsafe fn send(bytes: &[u8]) {
    // SAFETY: by the contract the registers have no other user.
    let (rcc, gpiod, usart) = unsafe { (&*RCC::ptr(), &*GPIOD::ptr(), &*USART2::ptr()) };
    rcc.ahb1enr().modify(|_, w| w.gpioden().enabled());
    rcc.apb1enr().modify(|_, w| w.usart2en().enabled());
    rcc.apb1rstr().modify(|_, w| w.usart2rst().reset());
    // SAFETY: clears the one bit again.
    rcc.apb1rstr()
        .modify(|r, w| unsafe { w.bits(r.bits() & !USART2_RESET) });
    // Reading back waits until the clocks are there (ES0206, 2.2.7).
    rcc.apb1enr().read();
    gpiod.afrl().modify(|_, w| w.afrl5().af7());
    gpiod.moder().modify(|_, w| w.moder5().alternate());
    let counts = (board::apb1_khz() * 1_000 + MAVLINK_BAUD / 2) / MAVLINK_BAUD;
    // SAFETY: mantissa and fraction of a divider by 16 stand side by side, so that the register is the
    // divider itself.
    usart.brr().write(|w| unsafe { w.bits(counts as u16) });
    usart.cr1().write(|w| w.ue().enabled().te().enabled());
    for &byte in bytes {
        wait_for(|| usart.sr().read().txe().bit());
        usart.dr().write(|w| w.dr().set(byte.into()));
    }
    wait_for(|| usart.sr().read().tc().bit());
}

/// USART2RST of RCC_APB1RSTR (RM0090, 6.3.10).
const USART2_RESET: u32 = 1 << 17;

fn wait_for(is_there: impl Fn() -> bool) {
    let _ = (0..LOOKS).any(|_| is_there());
}
