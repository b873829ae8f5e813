//! Thin drivers: registers in, values out. Most of the firmware's `unsafe` is here.

pub mod backup;
pub mod card;
pub mod freeze;
pub mod led;
pub mod pulse;
mod ring;
pub mod sdio;
pub mod time;
pub mod uart;
pub mod watchdog;
