//! What a card has to do: blocks, in and out.

use core::fmt;

/// Bytes of a block.
pub const BLOCK: usize = 512;

/// Why a disk did not give or take a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DiskError {
    /// It does not answer any more, or is another one.
    Gone,
    /// It may not be written.
    WriteProtected,
    /// It has no such block.
    Beyond,
    /// Anything else.
    Failed,
}

/// Blocks of 512 bytes, by number.
pub trait Disk {
    /// Reads a block.
    ///
    /// # Errors
    ///
    /// Why it cannot be had.
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError>;

    /// Writes a block; it stays when this returns.
    ///
    /// # Errors
    ///
    /// Why it was not taken.
    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError>;

    /// How many it has.
    fn blocks(&self) -> u32;
}

impl fmt::Display for DiskError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Gone => "the card is gone, or another one has been put in",
            Self::WriteProtected => "the card is write-protected",
            Self::Beyond => "the card has no such block",
            Self::Failed => "the card fails",
        })
    }
}

impl core::error::Error for DiskError {}
