//! The independent watchdog: resets the board when it is not fed.
//!
//! *Design.* It runs from its own oscillator, so it needs none of the board's clocks. That oscillator
//! has 17 to 47 kHz (DS9484, LSI), so the time is 0.55 s at least and 1.5 s at most. It cannot be
//! stopped, and outlives everything but a reset: a board that has stopped feeds it, too.

use stm32f4xx_hal::pac::{IWDG, RCC};

/// IWDG_KR (RM0090, 21.4.1).
mod key {
    pub(super) const FEED: u16 = 0xAAAA;
    pub(super) const UNLOCK: u16 = 0x5555;
    pub(super) const START: u16 = 0xCCCC;
}

/// IWDG_PR: the oscillator over 32.
const PRESCALER: u16 = 3;

/// IWDG_RLR: 800 counts are 0.54 s at 47 kHz, and 1.51 s at 17 kHz.
const RELOAD: u16 = 800 - 1;

/// How often IWDG_SR is read: 5 periods of the oscillator are 0.3 ms at most, and a read takes at
/// least 0.2 µs.
const STATUS_READS: u32 = 10_000;

/// Starts it. Feeding gives it the time that IWDG_RLR has, which is the longest there is, 4.1 s at
/// 32 kHz, until the oscillator has taken the value over (RM0090, 21.4.4).
pub fn start() {
    // SAFETY: the watchdog has no other user; the values are those above.
    unsafe {
        let iwdg = &*IWDG::ptr();
        iwdg.kr().write(|w| w.bits(key::START));
        iwdg.kr().write(|w| w.bits(key::UNLOCK));
        iwdg.pr().write(|w| w.bits(PRESCALER));
        iwdg.rlr().write(|w| w.bits(RELOAD));
        // If it does not come, the first time is longer, and nothing worse.
        let _ = (0..STATUS_READS).any(|_| iwdg.sr().read().bits() == 0);
    }
    feed();
}

/// Gives it its whole time again. From anywhere.
pub fn feed() {
    // SAFETY: one write of a key.
    unsafe { (*IWDG::ptr()).kr().write(|w| w.bits(key::FEED)) };
}

/// Whether this run began because it was not fed. Forgotten by asking, so that the next run has its
/// own answer.
pub fn take_was_reset() -> bool {
    // SAFETY: flags that hardware sets and this bit clears. No other code uses this register.
    let csr = unsafe { (*RCC::ptr()).csr() };
    let was_reset = csr.read().wdgrstf().bit_is_set();
    csr.modify(|_, w| w.rmvf().set_bit());
    was_reset
}
