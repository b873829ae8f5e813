//! The amber LED: PE12, lit when low.

use stm32f4xx_hal::gpio::{OpenDrain, Output, PE12, PinState};
use stm32f4xx_hal::pac::{GPIOE, RCC};

/// The pin's bit in ODR.
const ODR12: u32 = 1 << 12;

/// The LED, of which there is one.
pub struct Led(PE12<Output<OpenDrain>>);

impl Led {
    /// The LED, dark.
    pub fn new(pin: PE12) -> Self {
        Self(pin.into_open_drain_output_in_state(PinState::High))
    }

    /// Lights it, or not.
    pub fn set_lit(&mut self, is_lit: bool) {
        self.0.set_state(if is_lit {
            PinState::Low
        } else {
            PinState::High
        });
    }
}

/// Lights the LED or not, in any state of the board, whoever has it.
///
/// # Safety
///
/// No other code runs any more.
#[inline(never)]
pub unsafe fn force(is_lit: bool) {
    // SAFETY: the registers have no other user, by the contract. The pin is made an output because a
    // fault may come before the board is up; reading back waits until the port has its clock (ES0206,
    // 2.2.7), else the next write may be lost.
    let gpioe = unsafe {
        let rcc = &*RCC::ptr();
        rcc.ahb1enr().modify(|_, w| w.gpioeen().enabled());
        rcc.ahb1enr().read();
        &*GPIOE::ptr()
    };
    gpioe.moder().modify(|_, w| w.moder12().output());
    let dark = if is_lit { 0 } else { ODR12 };
    // SAFETY: as above; one bit changes.
    gpioe
        .odr()
        .modify(|r, w| unsafe { w.bits(r.bits() & !ODR12 | dark) });
}
