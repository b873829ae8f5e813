//! One new file, in an order in which a card may be pulled at any block.
//!
//! *Design.* The contents go into free clusters and are read back before anything else changes. Then
//! the clusters are marked as taken, and chain and contents are read back along the tables. A root
//! that grows gets a cluster that was zeroed before it is linked. The entry comes last, so that a
//! file is there in full or not at all: a card that is pulled before has lost clusters at worst,
//! which a check of its file system frees.

use crate::bytes::{put, word};
use crate::checksum::Checksum;
use crate::disk::BLOCK;
use crate::name;
use crate::not_saved::NotSaved;
use crate::root::{FileEntry, Place, Root};
use crate::table::{Entry, FreeClusters, Tables};

/// The contents: fills a block with the file's bytes from an offset on, and returns how many.
pub(crate) type Contents<'a> = &'a mut dyn FnMut(u32, &mut [u8]) -> usize;

/// What was found out about a card before anything is written.
pub(crate) struct Plan<'a> {
    tables: Tables<'a>,
    root: Root,
    len: u32,
    /// Clusters of the contents, and those with one by which the root grows.
    clusters: u32,
    wanted: u32,
    free: FreeClusters,
}

impl<'a> Plan<'a> {
    /// For a file of `len` bytes.
    ///
    /// # Errors
    ///
    /// Why there can be none.
    pub(crate) fn make(mut tables: Tables<'a>, len: u32) -> Result<Self, NotSaved> {
        let root = Root::of(&mut tables)?;
        let clusters = tables.volume.clusters_for(len);
        let grows = matches!(root.place, Place::Behind(_));
        let wanted = clusters + u32::from(grows);
        let free = tables.room_for(wanted)?;
        Ok(Self {
            tables,
            root,
            len,
            clusters,
            wanted,
            free,
        })
    }

    /// The number in the file's name.
    pub(crate) const fn number(&self) -> u16 {
        self.root.number
    }

    /// Writes the file, and reads it back.
    ///
    /// # Errors
    ///
    /// Why there is none.
    pub(crate) fn write(
        mut self,
        read: Contents<'_>,
        (date, time): (u16, u16),
    ) -> Result<u16, NotSaved> {
        let sum = self.write_contents(read)?;
        let mut along = Along::Free(self.free);
        if self.sum(&mut along)? != sum {
            return Err(NotSaved::NotKept);
        }
        let grown = self.zero_growth(along)?;
        let first = self.mark(grown)?;
        if self.sum(&mut Along::Chain(first))? != sum {
            return Err(NotSaved::NotKept);
        }
        self.count_down()?;
        let (number, at) = match (self.root.place, grown) {
            (Place::Free { number, at }, _) => (number, at),
            (Place::Behind(last), Some(grown)) => {
                let is_marked = self.tables.entry(grown)? == Entry::Last;
                self.tables.set(last, Some(grown))?;
                self.tables.flush()?;
                if !is_marked || self.tables.entry(last)? != Entry::Next(grown) {
                    return Err(NotSaved::NotKept);
                }
                (self.tables.volume.block_of(grown), 0)
            }
            (Place::Behind(_), None) => return Err(NotSaved::NoRoom),
        };
        let entry = FileEntry {
            name: name::of(self.root.number),
            cluster: first.unwrap_or(0),
            len: self.len,
            date,
            time,
        };
        entry.write(self.tables.disk, number, at)?;
        Ok(self.root.number)
    }

    /// Writes the contents into free clusters, and returns their checksum.
    fn write_contents(&mut self, read: Contents<'_>) -> Result<Checksum, NotSaved> {
        let mut sum = Checksum::new();
        let mut walk = self.free;
        let mut offset = 0;
        while offset < self.len {
            let cluster = self.tables.next_free(&mut walk)?.ok_or(NotSaved::NoRoom)?;
            let first = self.tables.volume.block_of(cluster);
            for number in first..first + self.tables.volume.blocks_per_cluster {
                if offset >= self.len {
                    break;
                }
                // What is behind the end of the file is 0.
                let mut block = [0; BLOCK];
                let wanted = (self.len - offset).min(BLOCK as u32);
                let stretch = block.get_mut(..wanted as usize).unwrap_or_default();
                if read(offset, stretch) < wanted as usize {
                    return Err(NotSaved::Short);
                }
                sum.add(&block);
                self.tables.disk.write(number, &block)?;
                offset += wanted;
            }
        }
        Ok(sum)
    }

    /// The checksum of what is on the card.
    fn sum(&mut self, along: &mut Along) -> Result<Checksum, NotSaved> {
        let mut sum = Checksum::new();
        let mut left = self.len.div_ceil(BLOCK as u32);
        while left > 0 {
            let cluster = self.next(along)?.ok_or(NotSaved::NotKept)?;
            let first = self.tables.volume.block_of(cluster);
            let count = left.min(self.tables.volume.blocks_per_cluster);
            for number in first..first + count {
                let mut block = [0; BLOCK];
                self.tables.disk.read(number, &mut block)?;
                sum.add(&block);
            }
            left -= count;
        }
        match along {
            Along::Chain(Some(_)) => Err(NotSaved::NotKept),
            Along::Chain(None) | Along::Free(_) => Ok(sum),
        }
    }

    fn next(&mut self, along: &mut Along) -> Result<Option<u32>, NotSaved> {
        match along {
            Along::Free(walk) => Ok(self.tables.next_free(walk)?),
            Along::Chain(next) => {
                let cluster = next.take();
                if let Some(cluster) = cluster {
                    match self.tables.entry(cluster)? {
                        Entry::Next(after) => *next = Some(after),
                        Entry::Last => {}
                        Entry::Free | Entry::Other => return Err(NotSaved::NotKept),
                    }
                }
                Ok(cluster)
            }
        }
    }

    /// Zeroes the cluster by which the root grows, the next one on the way, if it grows.
    fn zero_growth(&mut self, mut along: Along) -> Result<Option<u32>, NotSaved> {
        if self.wanted == self.clusters {
            return Ok(None);
        }
        let cluster = self.next(&mut along)?.ok_or(NotSaved::NoRoom)?;
        let first = self.tables.volume.block_of(cluster);
        let blocks = first..first + self.tables.volume.blocks_per_cluster;
        for number in blocks.clone() {
            self.tables.disk.write(number, &[0; BLOCK])?;
        }
        for number in blocks {
            let mut block = [0; BLOCK];
            self.tables.disk.read(number, &mut block)?;
            if block != [0; BLOCK] {
                return Err(NotSaved::NotKept);
            }
        }
        Ok(Some(cluster))
    }

    /// Marks the clusters as taken, and returns the first one of the contents.
    fn mark(&mut self, grown: Option<u32>) -> Result<Option<u32>, NotSaved> {
        let mut walk = self.free;
        let mut first = None;
        let mut last = None;
        for _ in 0..self.clusters {
            let cluster = self.tables.next_free(&mut walk)?.ok_or(NotSaved::NoRoom)?;
            match last {
                Some(last) => self.tables.set(last, Some(cluster))?,
                None => first = Some(cluster),
            }
            last = Some(cluster);
        }
        for end in [last, grown].into_iter().flatten() {
            self.tables.set(end, None)?;
        }
        self.tables.flush()?;
        Ok(first)
    }

    /// Takes the clusters off the count of free ones. A count that cannot be right becomes unknown.
    fn count_down(&mut self) -> Result<(), NotSaved> {
        /// Where the count stands, and the cluster at which a search may begin.
        const COUNT: usize = 488;
        const HINT: usize = 492;
        const UNKNOWN: u32 = u32::MAX;
        let Some(number) = self.tables.volume.info else {
            return Ok(());
        };
        let mut block = [0; BLOCK];
        self.tables.disk.read(number, &mut block)?;
        let count = Some(word(&block, COUNT)).filter(|&count| count <= self.tables.volume.clusters);
        let count = count.and_then(|count| count.checked_sub(self.wanted));
        put(&mut block, COUNT, &count.unwrap_or(UNKNOWN).to_le_bytes());
        if !self.tables.volume.has_cluster(word(&block, HINT)) {
            put(&mut block, HINT, &UNKNOWN.to_le_bytes());
        }
        self.tables.disk.write(number, &block)?;
        Ok(())
    }
}

/// Which clusters follow each other.
enum Along {
    /// Free ones.
    Free(FreeClusters),
    /// Those of a chain, from this one on.
    Chain(Option<u32>),
}
