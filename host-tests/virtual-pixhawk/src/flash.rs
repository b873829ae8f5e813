//! Where things are in the board's flash.

/// Where the bootloader is, and where the application begins behind it.
pub(crate) const FLASH: u32 = 0x0800_0000;
pub(crate) const APPLICATION: u32 = FLASH + 0x4000;
/// The most that an application may be, in bytes (PX4-Bootloader, board id 9).
pub(crate) const APPLICATION_MAX: u32 = 1_008 * 1_024;
