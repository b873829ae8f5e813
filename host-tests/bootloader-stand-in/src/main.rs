//! The stand-in as a program for the virtual board, in the first 16 KB of its flash.
//!
//! *Design.* The chip stays on its 16 MHz oscillator, as the original leaves it to the application. No
//! handler ever runs: with interrupts masked, `wfi` still ends when one is pending, so waiting costs
//! no instructions. USART2 (TELEM1) and USB are the lines, and answers go where the last byte came from. TIM2
//! counts the ms, and the flash's own interrupt ends an erase.
//!
//! *Limits.* No LED. What a reset of the chip leaves set up is left to the application:
//! everything is put back by hand before that begins.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod chip;
#[cfg(target_os = "none")]
mod usb;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a program for the virtual board; `cargo xtask board-test` runs it");
    std::process::exit(2);
}
