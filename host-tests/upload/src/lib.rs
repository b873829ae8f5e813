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

mod crc;
mod failure;
mod image;
mod px4_file;
mod uploader;

pub use crc::crc32;
pub use failure::{Failure, Phase};
pub use image::{APPLICATION, Image};
pub use px4_file::{Px4Error, Px4File};
pub use uploader::{Device, Progress, Uploader};

/// The board id of the Pixhawk 1, in its bootloader and in files for it: PX4's FMUv2 and FMUv3.
pub const PIXHAWK_1: u32 = 9;

/// What the bootloader can program behind itself on a chip with 2 MB, in bytes.
pub const FLASH_ROOM: u32 = 2_080_768;
