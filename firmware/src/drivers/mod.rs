//! Thin drivers: registers in, values out. With the boards they have all of the
//! firmware's `unsafe`.

pub mod card;
pub mod pulse;
pub mod sdio;
pub mod time;
pub mod uart;
