//! Numbers in a block, least byte first: 0 beyond its end, and nothing is written there.

use crate::disk::BLOCK;

/// A block's bytes.
pub(crate) type Block = [u8; BLOCK];

/// One byte.
pub(crate) fn byte(block: &Block, at: usize) -> u32 {
    block.get(at).copied().unwrap_or(0).into()
}

/// Two bytes.
pub(crate) fn half(block: &Block, at: usize) -> u32 {
    byte(block, at) | byte(block, at + 1) << 8
}

/// Four bytes.
pub(crate) fn word(block: &Block, at: usize) -> u32 {
    half(block, at) | half(block, at + 2) << 16
}

/// Puts `bytes` into the block.
pub(crate) fn put(block: &mut Block, at: usize, bytes: &[u8]) {
    let place = block.get_mut(at..).unwrap_or_default();
    for (place, byte) in place.iter_mut().zip(bytes) {
        *place = *byte;
    }
}

/// Whether a block ends as a boot record does.
pub(crate) fn is_signed(block: &Block) -> bool {
    half(block, 510) == 0xAA55
}
