//! Firmware onto a board by its bootloader, without a probe.
//!
//! *Purpose.* What `cargo xtask px4` writes, and what `cargo xtask upload` speaks:
//!
//! - [`Px4File`], the firmware file of PX4 boards, written and read;
//! - [`Image`], what goes into a board's flash, and its [checksum](crc32);
//! - [`Uploader`], the client of the bootloader's protocol.
//!
//! *Design.* The uploader is a state machine without I/O and without a clock: bytes and moments in,
//! whole commands out. Each refusal is a value of [`Failure`] with words that say what to do.
//!
//! *Limits.* Protocols 4 and 5 of PX4-Bootloader, for STM32F4 boards whose application begins at
//! [`APPLICATION`]. Only the main flash: no OTP, no serial number, no start-up delay.

mod board;
mod crc;
mod failure;
mod image;
mod px4_file;
mod uploader;

pub use board::{FLASH_ROOM, PIXHAWK_1};
pub use crc::crc32;
pub use failure::{Failure, Phase};
pub use image::{APPLICATION, Image};
pub use px4_file::{Px4Error, Px4File};
pub use uploader::{Device, Progress, Uploader};
