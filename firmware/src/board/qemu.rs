//! QEMU's `netduinoplus2`: an STM32F405 with SysTick at 168 MHz.
//!
//! *Limits.* RCC.CR always reads 0, so no code may wait for an oscillator: for the HAL
//! the chip stays on HSI. Timers count virtual time at 1 GHz. The host may stop the machine between any
//! two instructions.

use stm32f4xx_hal::pac::RCC;
use stm32f4xx_hal::rcc::{Config, Rcc};

use super::crystal::{CrystalFailed, CrystalStart};

/// The board's name, for the log.
pub const NAME: &str = "qemu";

/// Whether there is a slot for an SD card: QEMU has no model of SDIO.
pub const HAS_CARD_SLOT: bool = false;

/// Whether there is a USB connector: QEMU has no model of OTG_FS.
pub const HAS_USB: bool = false;

/// PSC of the witness, TIM5: 124, so that it counts 1 GHz / 125 = 8 MHz.
pub const WITNESS_PRESCALER: u16 = 124;

/// Core cycles for each count of the witness: 168 MHz / 8 MHz.
pub const WITNESS_RATIO: u32 = 21;

/// Whether the counters run at constant rates: the host may stop one of them.
pub const HAS_CONSTANT_CLOCKS: bool = false;

/// Samples that fit into ordinary RAM; the machine has neither of the Pixhawk's other memories.
pub const SAMPLE_ROOM: (usize, usize) = (1_024, 0);

/// Reads the witness and the down-counter within 10 µs of each other, and again when the host
/// stopped the machine in between. SysTick stands at 0 while the host is late with its interrupt,
/// and such a count means nothing.
#[inline(always)]
pub fn read_pair(witness: impl Fn() -> u32, down_count: impl Fn() -> u32) -> (u32, u32) {
    /// 10 µs in counts of 8 MHz: less than a quarter of the shortest tick.
    const CLOSE: u32 = 80;
    loop {
        let before = witness();
        let count = down_count();
        if witness().wrapping_sub(before) < CLOSE && count != 0 {
            return (before, count);
        }
    }
}

/// Leaves everything as it is after the reset: there is no bootloader.
pub fn take_over(_: &RCC) {}

/// Leaves the clocks as they are.
///
/// # Errors
///
/// None.
pub fn clocks(rcc: Rcc) -> Result<(Rcc, CrystalStart), CrystalFailed> {
    Ok((rcc.freeze(Config::hsi()), CrystalStart::InTime))
}

/// Whether the clock security system has found that the crystal stopped; there is none.
pub fn take_crystal_failure() -> bool {
    false
}

/// Counts of the witness in a ms, with a prescaler of 0.
pub fn witness_khz() -> u32 {
    1_000_000
}

/// The number that no other chip has: this machine has none.
pub fn unique_id() -> [u8; 12] {
    [0; 12]
}

/// The clock of APB1, as the machine has it: UARTs have no rate there. \[kHz\]
pub fn apb1_khz() -> u32 {
    42_000
}

/// The chip's kind and its revision: the machine does not say.
pub fn silicon() -> (u16, u16) {
    (0, 0)
}
