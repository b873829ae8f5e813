//! The Pixhawk 1 (FMUv2, FMUv3): STM32F427VI with a 24 MHz crystal.
//!
//! *Limits.* 168 MHz, not the 180 that the chip allows: USB and SDIO need 48 MHz, and a µs has to be
//! a whole number of cycles.

use stm32f4xx_hal::pac::{DBGMCU, FLASH, PWR, RCC, TIM5};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};

use super::crystal::{CrystalFailed, CrystalStart};

/// The board's name, for the log.
pub const NAME: &str = "pixhawk1";

/// Whether there is a slot for an SD card.
pub const HAS_CARD_SLOT: bool = true;

/// Whether there is a USB connector.
pub const HAS_USB: bool = true;

/// PSC of the witness, TIM5: 0, so that it counts every cycle of APB1's timer clock, 84 MHz.
pub const WITNESS_PRESCALER: u16 = 0;

/// Core cycles for each count of the witness: the core's clock is 168 MHz (RM0090, section 6.2).
pub const WITNESS_RATIO: u32 = 2;

/// Whether the counters run at constant rates, so that one can be held against the other.
pub const HAS_CONSTANT_CLOCKS: bool = true;

/// Samples that fit into the CCM, and into the upper 64 KB of SRAM.
pub const SAMPLE_ROOM: (usize, usize) = (4_096, 4_096);

/// A crystal that takes longer is reported as late: it starts within 2 ms (DS9484, HSE oscillator
/// characteristics). \[µs\]
const CRYSTAL_LATE_US: u32 = 10_000;

/// One that takes longer is given up. \[µs\]
const CRYSTAL_LIMIT_US: u32 = 100_000;

/// How often HSERDY is read at most, should the timer not count. A read at 16 MHz takes at least 0.2 µs,
/// so this is 0.4 s or more.
const CRYSTAL_READS: u32 = 2_000_000;

/// Wait states of the flash at 168 MHz and 3.3 V (RM0090, table 11).
const FLASH_WAIT_STATES: u8 = 5;

/// Reads the witness and the down-counter, a few cycles apart.
#[inline(always)]
pub fn read_pair(witness: impl Fn() -> u32, down_count: impl Fn() -> u32) -> (u32, u32) {
    (witness(), down_count())
}

/// How often a flag of RCC is read that follows its bit within some µs.
const FLAG_READS: u32 = 10_000;

/// RCC_AHB1ENR after a reset: the CCM's clock is on, and nothing else's.
const AHB1_CLOCKS: u32 = 1 << 20;

/// In RCC_APB1RSTR: the power controller, which has the regulator's scale.
const PWR_RESET: u32 = 1 << 28;

/// In RCC_CR: the oscillators and PLLs other than HSI.
const OTHER_CLOCKS: u32 = 1 << 16 | 1 << 19 | 1 << 24 | 1 << 26 | 1 << 28;

/// In RCC_CIR: all clear bits.
const CLEAR_ALL: u32 = 0x00FF_0000;

/// RCC_CIR: the clock security system has found that HSE stopped.
const CSSF: u32 = 1 << 7;

/// Brings RCC and the peripherals into the state after a reset, whatever a bootloader has left: its PLL
/// (locked, its factors cannot be changed), DMA that still writes, USB that still answers, timers of
/// another rate (TIMPRE). Ports and the power controller keep their state; the regulator's scale
/// becomes 1, which 168 MHz needs.
pub fn take_over(rcc: &RCC) {
    let wait_for = |is_there: &dyn Fn() -> bool| {
        // A flag that does not follow is found by `clocks`, from what depends on it.
        let _ = (0..FLAG_READS).any(|_| is_there());
    };
    rcc.cr().modify(|_, w| w.hsion().on());
    wait_for(&|| rcc.cr().read().hsirdy().bit_is_set());
    // SAFETY: 0 is every field's value after a reset: HSI is the system's clock, undivided; no
    // interrupt is enabled.
    rcc.cfgr().write(|w| unsafe { w.bits(0) });
    wait_for(&|| rcc.cfgr().read().sws().is_hsi());
    // SAFETY: these may be off now that HSI is the system's clock.
    rcc.cr()
        .modify(|r, w| unsafe { w.bits(r.bits() & !OTHER_CLOCKS) });
    wait_for(&|| rcc.cr().read().pllrdy().bit_is_clear());
    // SAFETY: clears the flags; timers count twice their bus's clock again.
    unsafe {
        rcc.cir().write(|w| w.bits(CLEAR_ALL));
        rcc.dckcfgr().write(|w| w.bits(0));
    }
    // SAFETY: no peripheral is in use yet. What is reset besides those of this firmware does no harm.
    unsafe {
        let dma = 1 << 21 | 1 << 22;
        rcc.ahb1rstr().write(|w| w.bits(dma));
        rcc.ahb2rstr().write(|w| w.bits(u32::MAX));
        rcc.apb1rstr().write(|w| w.bits(!PWR_RESET));
        rcc.apb2rstr().write(|w| w.bits(u32::MAX));
        rcc.ahb1rstr().write(|w| w.bits(0));
        rcc.ahb2rstr().write(|w| w.bits(0));
        rcc.apb1rstr().write(|w| w.bits(0));
        rcc.apb2rstr().write(|w| w.bits(0));
        rcc.ahb1enr().write(|w| w.bits(AHB1_CLOCKS));
        rcc.ahb2enr().write(|w| w.bits(0));
        rcc.apb1enr().write(|w| w.bits(0));
        rcc.apb2enr().write(|w| w.bits(0));
    }
    rcc.apb1enr().modify(|_, w| w.pwren().enabled());
    // Waits until the clock is there (ES0206, 2.2.7).
    rcc.apb1enr().read();
    // SAFETY: the scale may change while the PLL is off; 3 is scale 1.
    unsafe { (*PWR::ptr()).cr().modify(|_, w| w.vos().bits(0b11)) };
}

/// HSE 24 MHz, PLL to 168 MHz; APB1 42 MHz, APB2 84 MHz, USB 48 MHz (PX4 `boards/px4/fmu-v2`,
/// `board.h`). From then on the clock security system watches the crystal.
///
/// Panics when the clock is not the one that was set: stamps would be wrong.
///
/// # Errors
///
/// [`CrystalFailed`] when it does not start; the HAL would wait forever.
pub fn clocks(rcc: Rcc) -> Result<(Rcc, CrystalStart), CrystalFailed> {
    let start = start_crystal(&rcc)?;
    let rcc = rcc.freeze(
        Config::hse(24.MHz())
            .sysclk(168.MHz())
            .pclk1(42.MHz())
            .pclk2(84.MHz())
            .require_pll48clk(),
    );
    if !(0..FLAG_READS).any(|_| rcc.cfgr().read().sws().is_pll()) {
        panic!("the PLL is not the system's clock");
    }
    // SAFETY: reading has no side effect.
    let latency = unsafe { (*FLASH::ptr()).acr().read().latency().bits() };
    if latency != FLASH_WAIT_STATES {
        panic!("the flash has other wait states than were set");
    }
    rcc.cr().modify(|_, w| w.csson().on());
    Ok((rcc, start))
}

/// Turns the crystal on and waits for it, timed by TIM5 on HSI, which is as yet nobody's.
fn start_crystal(rcc: &RCC) -> Result<CrystalStart, CrystalFailed> {
    /// HSI is 16 MHz: a count is a µs.
    const PSC: u16 = 15;
    rcc.apb1enr().modify(|_, w| w.tim5en().enabled());
    rcc.apb1enr().read();
    // SAFETY: the peripherals are not handed out yet; the time's start resets this one.
    let tim5 = unsafe { &*TIM5::ptr() };
    tim5.psc().write(|w| w.psc().set(PSC));
    tim5.egr().write(|w| w.ug().update());
    tim5.cr1().write(|w| w.cen().enabled());
    rcc.cr().modify(|_, w| w.hseon().on());
    for _ in 0..CRYSTAL_READS {
        let is_ready = rcc.cr().read().hserdy().bit_is_set();
        let after_us = tim5.cnt().read().bits();
        match after_us {
            0..=CRYSTAL_LATE_US if is_ready => return Ok(CrystalStart::InTime),
            _ if is_ready => return Ok(CrystalStart::Late { after_us }),
            0..=CRYSTAL_LIMIT_US => {}
            _ => break,
        }
    }
    Err(CrystalFailed)
}

/// Whether the clock security system has found that the crystal stopped; its request is taken back, else
/// the NMI would come again and again.
pub fn take_crystal_failure() -> bool {
    // SAFETY: a fault is being reported, so nothing else uses RCC. This clears the flags.
    let cir = unsafe { (*RCC::ptr()).cir() };
    let has_failed = cir.read().bits() & CSSF != 0;
    // SAFETY: as above.
    cir.modify(|r, w| unsafe { w.bits(r.bits() | CLEAR_ALL) });
    has_failed
}

/// Counts of the witness in a ms, with a prescaler of 0, by whatever clocks the core now: HSI, HSE or
/// the PLL, through APB1's divider as it stands.
pub fn witness_khz() -> u32 {
    let (core_khz, divider) = core_khz_and_divider();
    // A timer counts twice the clock of its bus, unless the bus has the core's.
    core_khz >> divider.saturating_sub(1)
}

/// The clock of APB1, by whatever clocks the core now. \[kHz\]
pub fn apb1_khz() -> u32 {
    let (core_khz, divider) = core_khz_and_divider();
    core_khz >> divider
}

/// The core's clock in kHz, and which power of two divides it for APB1.
fn core_khz_and_divider() -> (u32, u32) {
    // SAFETY: reading has no side effect.
    let cfgr = unsafe { (*RCC::ptr()).cfgr().read() };
    let core_khz = match cfgr.sws().bits() {
        0b00 => 16_000,
        0b01 => 24_000,
        _ => 168_000,
    };
    match cfgr.ppre1().bits() {
        divider @ 0b100.. => (core_khz, u32::from(divider & 0b11) + 1),
        _ => (core_khz, 0),
    }
}

/// The number that no other chip has, in the order of its bytes (RM0090, 39.1).
pub fn unique_id() -> [u8; 12] {
    const ADDRESS: *const [u8; 12] = 0x1FFF_7A10 as *const _;
    // SAFETY: system memory, which every chip of this kind has there and nothing writes.
    unsafe { ADDRESS.read_volatile() }
}

/// The chip's kind and its silicon's revision: 0x419 and, of revision 3, 0x2001 (ES0206, table 2).
pub fn silicon() -> (u16, u16) {
    // SAFETY: reading has no side effect.
    let idcode = unsafe { (*DBGMCU::ptr()).idcode().read().bits() };
    ((idcode & 0xFFF) as u16, (idcode >> 16) as u16)
}
