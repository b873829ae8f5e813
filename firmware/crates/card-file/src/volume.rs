//! A FAT volume, as far as its boot record and its tables' beginnings prove it.
//!
//! *Design.* A boot record is believed where something else on the card agrees with it: its backup
//! (FAT32), the partition and the card, and the tables, each of which has to begin with the media
//! byte. That fixes where the tables are, how long they are and how many, and so where the clusters
//! begin. What nothing on a card repeats has to be what formatters write: 512 entries in the root of
//! FAT16, or a cluster of them. Whether there are 16 or 32 bits is decided by the fields, as Windows, macOS and Linux
//! do, and not by the number of clusters: FAT32 has no short table length and no fixed root.
//!
//! *Limits.* The size of a cluster on FAT16 stands nowhere else: see `root.rs` for what proves it.

use crate::bytes::{Block, byte, half, is_signed, word};
use crate::disk::{BLOCK, Disk};
use crate::not_saved::NotSaved;
use crate::stretch::Stretch;

/// The number of a volume's first cluster.
pub(crate) const FIRST_CLUSTER: u32 = 2;

/// Clusters of the smallest FAT16 volume, and of the largest.
const FAT16_MIN: u32 = 4_085;
const FAT16_MAX: u32 = 65_524;

/// Clusters of the largest FAT32 volume.
const FAT32_MAX: u32 = 0x0FFF_FFF5;

/// The entries in the root directory of FAT16: so many, or a cluster of them (mkfs.fat) if that is
/// more.
const ROOT_ENTRIES: u32 = 512;

/// Where a volume has its parts, in blocks of the card.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Volume {
    first: u32,
    blocks: u32,
    /// The table in use, or the first of two.
    pub(crate) table: u32,
    /// Tables that are kept alike, and the blocks of each.
    pub(crate) tables: u32,
    pub(crate) per_table: u32,
    /// The first block of the root, with 16 bits; its first cluster, with 32.
    pub(crate) root: u32,
    data: u32,
    pub(crate) clusters: u32,
    pub(crate) blocks_per_cluster: u32,
    pub(crate) has_32_bits: bool,
    /// The block with the count of free clusters.
    pub(crate) info: Option<u32>,
}

impl Volume {
    /// The volume that fills `place` or its beginning. With `is_cut` it may be longer, up to the
    /// card's end: it then has no clusters but those in its place.
    ///
    /// # Errors
    ///
    /// Why there is none that can be used.
    pub(crate) fn at(disk: &mut dyn Disk, place: Stretch, is_cut: bool) -> Result<Self, NotSaved> {
        let card = disk.blocks();
        if place.first >= card {
            return Err(NotSaved::NoFileSystem);
        }
        let mut block = [0; BLOCK];
        disk.read(place.first, &mut block)?;
        let kind = kind(disk, place.first, &block)?;
        kind.map_or(Ok(()), Err)?;
        let mut volume = Self::parse(&block, place.first)?;
        let room = place.blocks.min(card - place.first);
        if volume.blocks > room {
            let before_data = volume.data - volume.first;
            if !is_cut || volume.blocks > card - place.first || room <= before_data {
                return Err(NotSaved::Beyond);
            }
            volume.blocks = room;
            volume.clusters = (room - before_data) / volume.blocks_per_cluster;
        }
        if volume.has_32_bits {
            volume.compare_backup(disk, &block)?;
        }
        volume.look_at_tables(disk, &block)?;
        volume.with_info(disk, half(&block, 48))
    }

    /// From the volume's first block (Microsoft FAT specification, section 3).
    fn parse(block: &Block, first: u32) -> Result<Self, NotSaved> {
        const DAMAGED: NotSaved = NotSaved::BootDamaged;
        let blocks_per_cluster = byte(block, 13);
        let tables = byte(block, 16);
        let reserved = half(block, 14);
        if !blocks_per_cluster.is_power_of_two() || !(1..=2).contains(&tables) || reserved == 0 {
            return Err(DAMAGED);
        }
        let either = |short: u32, long: usize| if short == 0 { word(block, long) } else { short };
        let blocks = either(half(block, 19), 32);
        let root_entries = half(block, 17);
        let has_32_bits = half(block, 22) == 0;
        let per_table = either(half(block, 22), 36);
        // 16 entries of the root directory in a block.
        let before_root = per_table.checked_mul(tables).ok_or(DAMAGED)?;
        let before_root = before_root.checked_add(reserved).ok_or(DAMAGED)?;
        let before_data = before_root.checked_add(root_entries.div_ceil(16));
        let data_blocks = blocks.checked_sub(before_data.ok_or(DAMAGED)?);
        let clusters = data_blocks.ok_or(DAMAGED)? / blocks_per_cluster;
        let entries = per_table.saturating_mul(entries_per_block(has_32_bits));
        first.checked_add(blocks).ok_or(NotSaved::Beyond)?;
        let (has_its_root, most) = if has_32_bits {
            (root_entries == 0, FAT32_MAX)
        } else {
            let of_a_cluster = 16 * blocks_per_cluster;
            let is_usual = root_entries == ROOT_ENTRIES;
            let is_aligned = root_entries > ROOT_ENTRIES && root_entries == of_a_cluster;
            (is_usual || is_aligned, FAT16_MAX)
        };
        if !has_32_bits && clusters < FAT16_MIN {
            return Err(NotSaved::Fat12);
        }
        if !has_its_root || clusters == 0 || clusters > most || entries < clusters + FIRST_CLUSTER {
            return Err(DAMAGED);
        }
        let mut volume = Self {
            first,
            blocks,
            table: first + reserved,
            tables,
            per_table,
            root: first + before_root,
            data: first + before_root + root_entries.div_ceil(16),
            clusters,
            blocks_per_cluster,
            has_32_bits,
            info: None,
        };
        if has_32_bits {
            volume.root = word(block, 44);
            // One of the tables alone is kept, and the version is 0.0.
            let (flags, active) = (half(block, 40), half(block, 40) & 0xF);
            let is_alone = flags & 0x80 != 0;
            if half(block, 42) != 0 || is_alone && active >= tables {
                return Err(DAMAGED);
            }
            if is_alone {
                volume.tables = 1;
                volume.table += active * per_table;
            }
            if !volume.has_cluster(volume.root) {
                return Err(NotSaved::RootDamaged);
            }
        }
        Ok(volume)
    }

    /// Whether the backup of the boot record says the same where it matters.
    fn compare_backup(&self, disk: &mut dyn Disk, boot: &Block) -> Result<(), NotSaved> {
        let place = half(boot, 50);
        if place == 0 || place >= self.table - self.first {
            return Ok(());
        }
        let mut backup = [0; BLOCK];
        disk.read(self.first + place, &mut backup)?;
        // A formatter that makes none leaves what an erased card has.
        if backup.iter().all(|&byte| byte == 0) || backup.iter().all(|&byte| byte == 0xFF) {
            return Ok(());
        }
        // Sizes, the media byte, and from the blocks on to the root's cluster. The blocks before the
        // volume, the geometry and what a mount changes do not matter.
        let same = |from: usize, to: usize| boot.get(from..to) == backup.get(from..to);
        let is_same = same(11, 24) && same(32, 48) && is_signed(&backup);
        is_same.then_some(()).ok_or(NotSaved::BootDamaged)
    }

    /// Each table begins with the media byte, and there is none behind the last one.
    fn look_at_tables(&self, disk: &mut dyn Disk, boot: &Block) -> Result<(), NotSaved> {
        let mut block = [0; BLOCK];
        let (media, tables) = (byte(boot, 21), byte(boot, 16));
        let (is_media, begins) = if self.has_32_bits {
            (media | 0x0FFF_FF00, 0x0FFF_FFFF)
        } else {
            (media | 0xFF00, 0xFFFF)
        };
        for table in 0..=self.tables {
            let number = self.table + table * self.per_table;
            if number >= self.first + self.blocks {
                continue;
            }
            disk.read(number, &mut block)?;
            let is_one = word(&block, 0) & begins == is_media;
            if table < self.tables && !is_one {
                return Err(NotSaved::TableDamaged);
            }
            // Of a volume with one table, nothing else would show that there are two.
            if table == tables && tables == 1 && is_one && word(&block, 4) & begins == begins {
                return Err(NotSaved::BootDamaged);
            }
        }
        Ok(())
    }

    /// With the block that has the count, if it is one.
    fn with_info(mut self, disk: &mut dyn Disk, place: u32) -> Result<Self, NotSaved> {
        if self.has_32_bits && (1..self.table - self.first).contains(&place) {
            let mut block = [0; BLOCK];
            disk.read(self.first + place, &mut block)?;
            let is_one = word(&block, 0) == 0x4161_5252
                && word(&block, 484) == 0x6141_7272
                && word(&block, 508) == 0xAA55_0000;
            self.info = is_one.then_some(self.first + place);
        }
        Ok(self)
    }

    /// The blocks that belong to it.
    pub(crate) const fn stretch(&self) -> Stretch {
        Stretch {
            first: self.first,
            blocks: self.blocks,
        }
    }

    /// Whether it has a cluster of that number.
    pub(crate) const fn has_cluster(&self, cluster: u32) -> bool {
        cluster >= FIRST_CLUSTER && cluster - FIRST_CLUSTER < self.clusters
    }

    /// The first block of a cluster that it has.
    pub(crate) const fn block_of(&self, cluster: u32) -> u32 {
        self.data + (cluster - FIRST_CLUSTER) * self.blocks_per_cluster
    }

    /// Blocks of a root that has a place of its own.
    pub(crate) const fn root_blocks(&self) -> u32 {
        self.data - self.root
    }

    /// Clusters that this number of bytes takes.
    pub(crate) const fn clusters_for(&self, bytes: u32) -> u32 {
        bytes.div_ceil(self.cluster_bytes())
    }

    /// Bytes of a cluster.
    pub(crate) const fn cluster_bytes(&self) -> u32 {
        self.blocks_per_cluster * BLOCK as u32
    }

    /// Entries in a block of a table.
    pub(crate) const fn entries_per_block(&self) -> u32 {
        entries_per_block(self.has_32_bits)
    }
}

const fn entries_per_block(has_32_bits: bool) -> u32 {
    BLOCK as u32 / if has_32_bits { 4 } else { 2 }
}

/// What a volume is that is no FAT volume with blocks of 512 bytes, or a trace of one.
fn kind(disk: &mut dyn Disk, first: u32, boot: &Block) -> Result<Option<NotSaved>, NotSaved> {
    let has_name = |name: &[u8; 8]| boot.get(3..11) == Some(name);
    if is_signed(boot) && has_name(b"EXFAT   ") {
        return Ok(Some(NotSaved::Exfat));
    }
    if is_signed(boot) && has_name(b"NTFS    ") {
        return Ok(Some(NotSaved::Ntfs));
    }
    match half(boot, 11) {
        512 if is_signed(boot) => return Ok(None),
        1_024 | 2_048 | 4_096 if is_signed(boot) => return Ok(Some(NotSaved::SectorSize)),
        _ => {}
    }
    let mut block = [0; BLOCK];
    // On a card whose tables count sectors of 4096 bytes, it begins where they say.
    let of_4096 = first.saturating_mul(8);
    if first > 0 && of_4096 < disk.blocks() {
        disk.read(of_4096, &mut block)?;
        if is_signed(&block) && half(&block, 11) == 4_096 {
            return Ok(Some(NotSaved::SectorSize));
        }
    }
    // The superblock of ext stands 1024 bytes behind the beginning.
    if first.saturating_add(2) < disk.blocks() {
        disk.read(first + 2, &mut block)?;
        if half(&block, 56) == 0xEF53 {
            return Ok(Some(NotSaved::Ext4));
        }
    }
    // A backup where FAT32 has it, of a boot record that is none any more.
    if first.saturating_add(6) < disk.blocks() {
        disk.read(first + 6, &mut block)?;
        if is_signed(&block) && half(&block, 11) == 512 && half(&block, 50) == 6 {
            return Ok(Some(NotSaved::BootDamaged));
        }
    }
    Ok(Some(NotSaved::NoFileSystem))
}
