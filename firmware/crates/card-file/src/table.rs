//! The tables of clusters: one, or two that are to be alike.
//!
//! *Design.* A block of each is in memory, and whoever changes an entry changes it in both. A
//! cluster counts as free only if both tables say so: after a power cut, or with one table damaged,
//! they differ, and what either knows as taken is left alone. Where a chain is followed, both have
//! to agree. The last table is written first, because computers read the first one.

use crate::bytes::{Block, half, put, word};
use crate::disk::{BLOCK, Disk, DiskError};
use crate::not_saved::NotSaved;
use crate::volume::{FIRST_CLUSTER, Volume};

/// A cluster's entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Entry {
    /// It is free.
    Free,
    /// Another one follows it.
    Next(u32),
    /// It is the last of its chain.
    Last,
    /// Anything else: a damaged cluster, a number that the volume does not have, or tables that
    /// differ.
    Other,
}

/// The tables of a volume, a block at a time.
pub(crate) struct Tables<'a> {
    pub(crate) disk: &'a mut dyn Disk,
    pub(crate) volume: Volume,
    blocks: [Block; 2],
    /// Which block of each table it is.
    at: Option<u32>,
    is_changed: bool,
}

impl<'a> Tables<'a> {
    pub(crate) const fn new(disk: &'a mut dyn Disk, volume: Volume) -> Self {
        Self {
            disk,
            volume,
            blocks: [[0; BLOCK]; 2],
            at: None,
            is_changed: false,
        }
    }

    /// The entry of a cluster.
    ///
    /// # Errors
    ///
    /// The disk failed.
    pub(crate) fn entry(&mut self, cluster: u32) -> Result<Entry, DiskError> {
        let (first, second) = self.raw(cluster)?;
        let end = if self.volume.has_32_bits {
            0x0FFF_FFF8
        } else {
            0xFFF8
        };
        Ok(match first {
            // Which of the marks of an end it is does not matter.
            last if last >= end && second >= end => Entry::Last,
            _ if first != second => Entry::Other,
            0 => Entry::Free,
            next if self.volume.has_cluster(next) => Entry::Next(next),
            _ => Entry::Other,
        })
    }

    /// What both tables have.
    fn raw(&mut self, cluster: u32) -> Result<(u32, u32), DiskError> {
        let at = self.load(cluster)?;
        let [first, second] = &self.blocks;
        // The upper four bits of 32 are reserved.
        let get = |block| {
            if self.volume.has_32_bits {
                word(block, at) & 0x0FFF_FFFF
            } else {
                half(block, at)
            }
        };
        Ok((get(first), get(second)))
    }

    /// Has `next` follow a cluster; with none it is the last of its chain.
    ///
    /// # Errors
    ///
    /// The disk failed.
    pub(crate) fn set(&mut self, cluster: u32, next: Option<u32>) -> Result<(), DiskError> {
        let at = self.load(cluster)?;
        self.is_changed = true;
        for block in &mut self.blocks {
            if self.volume.has_32_bits {
                let reserved = word(block, at) & 0xF000_0000;
                let entry = next.unwrap_or(0x0FFF_FFFF) | reserved;
                put(block, at, &entry.to_le_bytes());
            } else {
                let entry = next.unwrap_or(0xFFFF) as u16;
                put(block, at, &entry.to_le_bytes());
            }
        }
        Ok(())
    }

    /// Brings a cluster's block into memory, and returns where in it the entry is.
    fn load(&mut self, cluster: u32) -> Result<usize, DiskError> {
        let per_block = self.volume.entries_per_block();
        let wanted = cluster / per_block;
        if self.at != Some(wanted) {
            self.flush()?;
            let [first, second] = &mut self.blocks;
            let number = self.volume.table + wanted;
            self.disk.read(number, first)?;
            if self.volume.tables == 1 {
                *second = *first;
            } else {
                self.disk.read(number + self.volume.per_table, second)?;
            }
            self.at = Some(wanted);
        }
        Ok((cluster % per_block) as usize * (BLOCK / per_block as usize))
    }

    /// Writes what was changed. The next access reads from the card again.
    ///
    /// # Errors
    ///
    /// The disk failed.
    pub(crate) fn flush(&mut self) -> Result<(), DiskError> {
        let Some(at) = self.at.take() else {
            return Ok(());
        };
        if core::mem::take(&mut self.is_changed) {
            let number = self.volume.table + at;
            let [first, second] = &self.blocks;
            if self.volume.tables > 1 {
                self.disk.write(number + self.volume.per_table, second)?;
            }
            self.disk.write(number, first)?;
        }
        Ok(())
    }

    /// Where to begin to look for `wanted` free clusters, if there are so many.
    ///
    /// On a large card whose beginning is full, blocks all over the table are tried first: the way
    /// from the beginning to a free one may be 100 000 blocks long.
    ///
    /// # Errors
    ///
    /// The disk failed, or there is no room.
    pub(crate) fn room_for(&mut self, wanted: u32) -> Result<FreeClusters, NotSaved> {
        /// Blocks at the beginning that are looked through, and then places all over.
        const AT_ONCE: u32 = 64;
        let per_block = self.volume.entries_per_block();
        let near = (AT_ONCE * per_block).min(self.volume.clusters);
        let begin = FreeClusters::from(FIRST_CLUSTER, near);
        if wanted <= self.count(begin, wanted)? {
            return Ok(begin.with_all(self.volume.clusters));
        }
        let mut begin = begin.with_all(self.volume.clusters);
        let blocks = self.volume.clusters / per_block;
        for place in 1..AT_ONCE {
            let block = (u64::from(blocks) * u64::from(place) / u64::from(AT_ONCE)) as u32;
            if block < AT_ONCE {
                continue;
            }
            let there = FreeClusters::from(block * per_block, per_block);
            if self.count(there, per_block)? == per_block {
                begin = there.with_all(self.volume.clusters);
                break;
            }
        }
        let found = self.count(begin, wanted)?;
        if found < wanted {
            return Err(NotSaved::NoRoom);
        }
        Ok(begin)
    }

    /// How many of these are free; no more than `most` are counted.
    pub(crate) fn count(&mut self, mut free: FreeClusters, most: u32) -> Result<u32, DiskError> {
        let mut found = 0;
        while found < most && self.next_free(&mut free)?.is_some() {
            found += 1;
        }
        Ok(found)
    }

    /// The next free cluster.
    ///
    /// # Errors
    ///
    /// The disk failed.
    pub(crate) fn next_free(&mut self, free: &mut FreeClusters) -> Result<Option<u32>, DiskError> {
        while free.left > 0 {
            let cluster = if self.volume.has_cluster(free.next) {
                free.next
            } else {
                FIRST_CLUSTER
            };
            free.next = cluster + 1;
            free.left -= 1;
            if self.raw(cluster)? == (0, 0) {
                return Ok(Some(cluster));
            }
        }
        Ok(None)
    }
}

/// A walk over the clusters, from one on and around, to each at most once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FreeClusters {
    next: u32,
    left: u32,
}

impl FreeClusters {
    pub(crate) const fn from(next: u32, left: u32) -> Self {
        Self { next, left }
    }

    const fn with_all(self, clusters: u32) -> Self {
        Self {
            left: clusters,
            ..self
        }
    }
}
