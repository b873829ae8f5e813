//! Thin drivers: registers in, values out. Most of the firmware's `unsafe` is here.

pub mod card;
pub mod led;
pub mod pulse;
pub mod sdio;
pub mod time;
pub mod uart;
