//! Numbers in a block, least byte first; 0 beyond its end.

use crate::disk::BLOCK;

/// Two bytes.
pub(crate) fn half(block: &[u8; BLOCK], at: usize) -> u32 {
    byte(block, at) | byte(block, at + 1) << 8
}

/// Four bytes.
pub(crate) fn word(block: &[u8; BLOCK], at: usize) -> u32 {
    half(block, at) | half(block, at + 2) << 16
}

/// One byte.
pub(crate) fn byte(block: &[u8; BLOCK], at: usize) -> u32 {
    block.get(at).copied().unwrap_or(0).into()
}
