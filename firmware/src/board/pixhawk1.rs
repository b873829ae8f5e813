//! The Pixhawk 1 (FMUv2, FMUv3): STM32F427VI with a 24 MHz crystal.
//!
//! *Limits.* 168 MHz, not the 180 that the chip allows: USB and SDIO need 48 MHz, and a µs has to be
//! a whole number of cycles.

use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};

/// The board's name, for the log.
pub const NAME: &str = "pixhawk1";

/// Whether there is a slot for an SD card.
pub const HAS_CARD_SLOT: bool = true;

/// PSC of the witness, TIM5: 0, so that it counts every cycle of APB1's timer clock, 84 MHz.
pub const WITNESS_PRESCALER: u16 = 0;

/// Core cycles for each count of the witness: the core's clock is 168 MHz (RM0090, section 6.2).
pub const WITNESS_RATIO: u32 = 2;

/// Samples that fit into the CCM, and into the upper 64 KB of SRAM.
pub const SAMPLE_ROOM: (usize, usize) = (4_096, 4_096);

/// How often HSERDY is read before the crystal is given up. It starts within 2 ms (DS9484, HSE
/// oscillator characteristics). A read at 16 MHz takes at least 0.2 µs, so this is 20 ms or more.
const CRYSTAL_READS: u32 = 100_000;

/// Reads the witness and the down-counter, a few cycles apart.
#[inline(always)]
pub fn read_pair(witness: impl Fn() -> u32, down_count: impl Fn() -> u32) -> (u32, u32) {
    (witness(), down_count())
}

/// HSE 24 MHz, PLL to 168 MHz; APB1 42 MHz, APB2 84 MHz, USB 48 MHz (PX4 `boards/px4/fmu-v2`,
/// `board.h`).
///
/// Panics with its reason in the log when the crystal does not start: the HAL would wait forever.
pub fn clocks(rcc: Rcc) -> Rcc {
    rcc.cr().modify(|_, w| w.hseon().on());
    if !(0..CRYSTAL_READS).any(|_| rcc.cr().read().hserdy().bit_is_set()) {
        defmt::panic!("the 24 MHz crystal does not start");
    }
    rcc.freeze(
        Config::hse(24.MHz())
            .sysclk(168.MHz())
            .pclk1(42.MHz())
            .pclk2(84.MHz())
            .require_pll48clk(),
    )
}
