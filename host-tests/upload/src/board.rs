//! The board, as its bootloader and files for it name it.

/// The board id of the Pixhawk 1, in its bootloader and in files for it: PX4's FMUv2 and FMUv3.
pub const PIXHAWK_1: u32 = 9;

/// What the bootloader can program behind itself on a chip with 2 MB, in bytes.
pub const FLASH_ROOM: u32 = 2_080_768;
