//! Thin drivers: registers in, values out. Most of the firmware's `unsafe` is here.

pub mod backup;
pub mod card;
pub mod freeze;
pub mod last_words;
pub mod led;
mod outbox;
pub mod pulse;
pub mod ring;
pub mod sdio;
pub mod time;
pub mod uart;
pub mod usb;
pub mod watchdog;
