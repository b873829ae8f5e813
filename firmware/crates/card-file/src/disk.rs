//! The card, as the user of this crate provides it.

use core::fmt;

/// Bytes of a block.
pub const BLOCK: usize = 512;

/// Why a block could not be read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DiskError {
    /// The card does not answer any more.
    Gone,
    /// Another card has taken its place.
    Swapped,
    /// The card is write-protected.
    WriteProtected,
    /// The card has no such block.
    Beyond,
    /// All of it takes longer than it may.
    TooSlow,
    /// Somebody has asked to stop.
    Stopped,
    /// Anything else.
    Failed,
}

/// Blocks of 512 bytes, by number.
pub trait Disk {
    /// Reads a block.
    ///
    /// # Errors
    ///
    /// Why it could not be read.
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError>;

    /// Writes a block, which has to be on the card when this returns.
    ///
    /// # Errors
    ///
    /// Why it could not be written.
    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError>;

    /// The number of blocks.
    fn blocks(&self) -> u32;
}

impl fmt::Display for DiskError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Gone => "the card is gone",
            Self::Swapped => "another card has been put in",
            Self::WriteProtected => "the card is write-protected",
            Self::Beyond => "the card has no such block",
            Self::TooSlow => "the card takes too long",
            Self::Stopped => "it was to stop",
            Self::Failed => "the card fails",
        })
    }
}

impl core::error::Error for DiskError {}
