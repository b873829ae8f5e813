//! The FAT volume on a card: what has to be known of it before anything is written.
//!
//! *Purpose.* [`Volume::on`] checks that there is one that can be trusted, [`Volume::has_room`]
//! that the file fits, before [`embedded_sdmmc`] begins.
//!
//! *Design.* `embedded-sdmmc` 0.10 does not check the sizes on a card. It divides by the size of a
//! cluster, so a 0 there would be a panic. Its search for a free cluster goes on behind the last
//! cluster of the volume, up to the end of the table's last block. Both are excluded here: sizes
//! are checked, and room for the whole file is found before the first byte, so that the search ends
//! within the volume.
//!
//! *Limits.* The first partition of a master boot record, as cards are sold and as cameras format
//! them; no FAT12, no exFAT. Directories and chains are not checked.

use crate::bytes::{byte, half, word};
use crate::disk::{BLOCK, Disk, DiskError};

/// Why there is no volume, or no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoVolume {
    /// The disk failed.
    Disk(DiskError),
    /// It has none, or a damaged one.
    NotFat,
}

impl From<DiskError> for NoVolume {
    fn from(error: DiskError) -> Self {
        Self::Disk(error)
    }
}

/// Where a FAT16 or FAT32 volume is, in blocks of the disk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Volume {
    first: u32,
    blocks: u32,
    table: u32,
    clusters: u32,
    blocks_per_cluster: u32,
    has_32_bits: bool,
    /// The block of FAT32 that has the hint where the next free cluster may be.
    hints: Option<u32>,
}

impl Volume {
    /// The volume in the card's first partition.
    ///
    /// # Errors
    ///
    /// There is none, or the disk failed.
    pub(crate) fn on(disk: &mut dyn Disk) -> Result<Self, NoVolume> {
        const PARTITION: usize = 446;
        let mut block = [0; BLOCK];
        disk.read(0, &mut block)?;
        let first = word(&block, PARTITION + 8);
        if !is_signed(&block) || first == 0 || first >= disk.blocks() {
            return Err(NoVolume::NotFat);
        }
        disk.read(first, &mut block)?;
        Self::parse(&block, first)
            .filter(|volume| {
                let end = first.checked_add(volume.blocks);
                end.is_some_and(|end| end <= disk.blocks())
            })
            .ok_or(NoVolume::NotFat)
    }

    /// From the volume's first block (Microsoft FAT specification, section 3).
    fn parse(block: &[u8; BLOCK], first: u32) -> Option<Self> {
        /// Clusters of the smallest FAT16, and of the smallest FAT32.
        const FAT16: u32 = 4_085;
        const FAT32: u32 = 65_525;
        let blocks_per_cluster = byte(block, 13);
        let tables = byte(block, 16);
        if !is_signed(block)
            || half(block, 11) != BLOCK as u32
            || !blocks_per_cluster.is_power_of_two()
            || !(1..=2).contains(&tables)
        {
            return None;
        }
        let reserved = half(block, 14);
        let either = |short: u32, long: usize| if short == 0 { word(block, long) } else { short };
        let blocks = either(half(block, 19), 32);
        let per_table = either(half(block, 22), 36);
        // 16 entries of the root directory in a block.
        let before_data = per_table
            .checked_mul(tables)?
            .checked_add(reserved + half(block, 17).div_ceil(16))?;
        let clusters = blocks.checked_sub(before_data)? / blocks_per_cluster;
        let has_32_bits = clusters >= FAT32;
        let entries = per_table.saturating_mul(entries_per_block(has_32_bits));
        if reserved == 0 || clusters < FAT16 || entries < clusters + 2 {
            return None;
        }
        Some(Self {
            first,
            blocks,
            table: first + reserved,
            clusters,
            blocks_per_cluster,
            has_32_bits,
            hints: has_32_bits.then(|| first.wrapping_add(half(block, 48))),
        })
    }

    /// Whether a file of `bytes` fits, together with two clusters more: one by which the directory
    /// may grow, and one at which the search for a next cluster ends.
    ///
    /// # Errors
    ///
    /// The disk failed.
    pub(crate) fn has_room(&self, disk: &mut dyn Disk, bytes: u32) -> Result<bool, DiskError> {
        let wanted = bytes.div_ceil(self.blocks_per_cluster * BLOCK as u32) + 2;
        let per_block = entries_per_block(self.has_32_bits);
        let mut block = [0; BLOCK];
        let mut found = 0;
        for cluster in 2..self.clusters + 2 {
            let place = cluster % per_block;
            if place == 0 || cluster == 2 {
                disk.read(self.table + cluster / per_block, &mut block)?;
            }
            let is_free = if self.has_32_bits {
                // The upper four bits are reserved.
                word(&block, place as usize * 4) << 4 == 0
            } else {
                half(&block, place as usize * 2) == 0
            };
            found += u32::from(is_free);
            if found == wanted {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a block belongs to it.
    pub(crate) const fn contains(&self, block: u32) -> bool {
        block >= self.first && block - self.first < self.blocks
    }

    /// Removes the hint from a block that was read. Without it the search begins at the first
    /// cluster, so that it finds a free one before the end of the volume.
    pub(crate) fn without_hint(&self, number: u32, block: &mut [u8; BLOCK]) {
        if self.hints == Some(number)
            && let Some(hint) = block.get_mut(492..496)
        {
            hint.fill(0xFF);
        }
    }
}

const fn entries_per_block(has_32_bits: bool) -> u32 {
    BLOCK as u32 / if has_32_bits { 4 } else { 2 }
}

/// Whether a block ends as a boot record does.
fn is_signed(block: &[u8; BLOCK]) -> bool {
    half(block, 510) == 0xAA55
}
