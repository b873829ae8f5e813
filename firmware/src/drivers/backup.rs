//! The RTC's backup registers, which outlive every reset but power-on.
//!
//! | register | holds |
//! |---|---|
//! | BKP0R | the bootloader's: a number there makes it wait for an upload |
//! | BKP1R to BKP18R | the record of a fault (`fault_record`) |
//! | BKP19R | how long this run has lasted, for the one that ends without a record |
//!
//! *Design.* Memory would not do: a bootloader runs in between, with its stack and variables at both
//! ends of it. Functions, not a value, because a fault uses these registers whoever holds them.
//!
//! *Limits.* Without a battery at VBAT they hold anything after power-on; the record has a checksum.

use fault_record::WORDS;
use stm32f4xx_hal::pac::{PWR, RCC, RTC};

/// BKP1R.
const RECORD: usize = 1;

/// BKP19R.
const UP_TIME: usize = RECORD + WORDS;

/// PWR_CR.DBP.
const DBP: u32 = 1 << 8;

/// Allows writing, in any state of the board. Interrupts are off, or the board is not up yet.
pub fn open() {
    // SAFETY: nobody else uses these two bits while interrupts are off. Reading back waits until the
    // clock is there (ES0206, 2.2.7).
    unsafe {
        let rcc = &*RCC::ptr();
        rcc.apb1enr().modify(|_, w| w.pwren().enabled());
        rcc.apb1enr().read();
        (*PWR::ptr()).cr().modify(|r, w| w.bits(r.bits() | DBP));
    }
}

/// The words of the record.
pub fn record() -> [u32; WORDS] {
    let mut words = [0; WORDS];
    for (n, word) in (RECORD..).zip(&mut words) {
        *word = read(n);
    }
    words
}

/// Replaces the words of the record; after [`open`].
pub fn set_record(words: &[u32; WORDS]) {
    for (n, &word) in (RECORD..).zip(words) {
        write(n, word);
    }
}

/// How long the run before lasted, until [`set_up_ms`] is called. \[ms\]
pub fn up_ms() -> u32 {
    read(UP_TIME)
}

/// Notes how long this run has lasted; after [`open`]. \[ms\]
pub fn set_up_ms(up_ms: u32) {
    write(UP_TIME, up_ms);
}

fn read(n: usize) -> u32 {
    // SAFETY: reading a backup register has no side effect.
    unsafe { (*RTC::ptr()).bkpr(n).read().bits() }
}

fn write(n: usize, word: u32) {
    // SAFETY: of the RTC only these registers are used, each of any value, and each write is whole.
    unsafe { (*RTC::ptr()).bkpr(n).write(|w| w.bits(word)) };
}
