//! Which blocks of a FAT volume are whose, and whether a write keeps to those that are nobody's.
//!
//! *Purpose.* A [`Census`] is taken of a card before it is damaged or written to. Then each block
//! that is written is put to [`Census::judge`]: the contents of clusters that were free, entries of
//! the tables that were free, unused entries of the root and the count of free clusters may change,
//! and nothing else.
//!
//! *Design.* By another hand than the firmware's, from the specification alone. It is tolerant: a
//! card with crossed or lost chains has a census, too. A cluster is free if every table says so.
//!
//! *Limits.* FAT16 and FAT32 with sectors of 512 bytes. Names are those of 8.3.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Bytes of a block.
pub const BLOCK: usize = 512;
/// A block's bytes.
pub type Block = [u8; BLOCK];

/// Whose block, or part of it, was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Foreign {
    /// The block, counted from the beginning of the card.
    pub number: u32,
    /// What it is.
    pub whose: &'static str,
}

impl fmt::Display for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "block {} was written: {}", self.number, self.whose)
    }
}

impl std::error::Error for Foreign {}

/// A file or a directory, as its entry and its chain have it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// The entry, byte for byte.
    pub entry: [u8; 32],
    /// Its clusters, in their order.
    pub chain: Vec<u32>,
}

impl Item {
    /// The length that the entry has.
    #[must_use]
    pub fn len(&self) -> u32 {
        word(&self.entry, 28)
    }

    /// Whether the entry has no length.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn is_directory(&self) -> bool {
        self.entry[11] & 0x10 != 0
    }
}

/// What belongs to whom on a volume.
pub struct Census {
    first: u32,
    tables: u32,
    per_table: u32,
    table: u32,
    data: u32,
    clusters: u32,
    blocks_per_cluster: u32,
    has_32_bits: bool,
    info: Option<u32>,
    is_free: Vec<bool>,
    root_chain: Vec<u32>,
    /// For each block of the root, which of its 16 entries are not used.
    unused: BTreeMap<u32, [bool; 16]>,
    /// By their names, with folders before them.
    items: BTreeMap<String, Item>,
}

impl fmt::Debug for Census {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Census")
            .field("first", &self.first)
            .field("clusters", &self.clusters)
            .finish_non_exhaustive()
    }
}

fn half(bytes: &[u8], at: usize) -> u32 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]]).into()
}

fn word(bytes: &[u8], at: usize) -> u32 {
    half(bytes, at) | half(bytes, at + 2) << 16
}

impl Census {
    /// Of the volume that begins at block `first`; `read` returns a block of the card.
    ///
    /// # Panics
    ///
    /// If no FAT volume begins there.
    #[must_use]
    pub fn of(first: u32, read: &mut dyn FnMut(u32) -> Block) -> Self {
        let boot = read(first);
        let (reserved, tables) = (half(&boot, 14), u32::from(boot[16]));
        assert_eq!(half(&boot, 11), 512, "no FAT volume");
        let has_32_bits = half(&boot, 22) == 0;
        let per_table = if has_32_bits {
            word(&boot, 36)
        } else {
            half(&boot, 22)
        };
        let blocks = match half(&boot, 19) {
            0 => word(&boot, 32),
            short => short,
        };
        let table = first + reserved;
        let root = table + tables * per_table;
        let data = root + half(&boot, 17).div_ceil(16);
        let blocks_per_cluster = u32::from(boot[13]);
        let clusters = (first + blocks - data) / blocks_per_cluster;
        let info = has_32_bits
            .then(|| half(&boot, 48))
            .filter(|&at| at != 0 && at < reserved);
        let mut census = Self {
            first,
            tables,
            per_table,
            table,
            data,
            clusters,
            blocks_per_cluster,
            has_32_bits,
            info: info.map(|at| first + at),
            is_free: vec![true; clusters as usize + 2],
            root_chain: Vec::new(),
            unused: BTreeMap::new(),
            items: BTreeMap::new(),
        };
        let mut entries = Vec::new();
        for which in (0..tables).rev() {
            entries = census.entries(which, read);
            for (is_free, entry) in census.is_free.iter_mut().zip(&entries) {
                *is_free &= *entry == 0;
            }
        }
        let root_blocks = if has_32_bits {
            census.root_chain = census.chain(word(&boot, 44), &entries);
            census.blocks_of(&census.root_chain)
        } else {
            (root..data).collect()
        };
        census.take_unused(&root_blocks, read);
        census.take_items("", &root_blocks, &entries, read, 0);
        census
    }

    fn entries(&self, which: u32, read: &mut dyn FnMut(u32) -> Block) -> Vec<u32> {
        let count = self.clusters as usize + 2;
        let begin = self.table + which * self.per_table;
        let mut entries = Vec::with_capacity(count);
        for number in begin..begin + self.per_table {
            let block = read(number);
            if self.has_32_bits {
                entries.extend((0..128).map(|at| word(&block, at * 4) & 0x0FFF_FFFF));
            } else {
                entries.extend((0..256).map(|at| half(&block, at * 2)));
            }
            if entries.len() >= count {
                break;
            }
        }
        entries.truncate(count);
        entries
    }

    fn chain(&self, first: u32, entries: &[u32]) -> Vec<u32> {
        let mut chain = Vec::new();
        let mut seen = BTreeSet::new();
        let mut cluster = first;
        while (2..self.clusters + 2).contains(&cluster) && seen.insert(cluster) {
            chain.push(cluster);
            cluster = entries[cluster as usize];
        }
        chain
    }

    fn blocks_of(&self, chain: &[u32]) -> Vec<u32> {
        let first = |cluster| self.data + (cluster - 2) * self.blocks_per_cluster;
        let blocks = |&cluster| first(cluster)..first(cluster) + self.blocks_per_cluster;
        chain.iter().flat_map(blocks).collect()
    }

    fn take_unused(&mut self, root: &[u32], read: &mut dyn FnMut(u32) -> Block) {
        let mut is_over = false;
        for &number in root {
            let block = read(number);
            let unused = std::array::from_fn(|entry| {
                is_over |= block[entry * 32] == 0;
                is_over || block[entry * 32] == 0xE5
            });
            self.unused.insert(number, unused);
        }
    }

    fn take_items(
        &mut self,
        folder: &str,
        blocks: &[u32],
        entries: &[u32],
        read: &mut dyn FnMut(u32) -> Block,
        depth: u32,
    ) {
        for &number in blocks {
            let block = read(number);
            for entry in block.as_chunks::<32>().0 {
                match (entry[0], entry[11]) {
                    (0, _) => return,
                    // Unused, a folder's own, of a long name, and the volume's label.
                    (0xE5 | b'.', _) => continue,
                    (_, attributes) if attributes & 0x08 != 0 => continue,
                    _ => {}
                }
                let high = if self.has_32_bits { half(entry, 20) } else { 0 };
                let item = Item {
                    entry: *entry,
                    chain: self.chain(half(entry, 26) | high << 16, entries),
                };
                let name = format!("{folder}{}", String::from_utf8_lossy(&entry[..11]));
                if item.is_directory() && depth < 8 {
                    let blocks = self.blocks_of(&item.chain);
                    self.take_items(&format!("{name}/"), &blocks, entries, read, depth + 1);
                }
                self.items.insert(name, item);
            }
        }
    }

    /// Whether `new` may take the place of `old` in a block.
    ///
    /// # Errors
    ///
    /// Whose it is.
    pub fn judge(&self, number: u32, old: &Block, new: &Block) -> Result<(), Foreign> {
        let refuse = |whose| Err(Foreign { number, whose });
        let differs = |at: usize, len: usize| old[at..at + len] != new[at..at + len];
        if old == new {
            return Ok(());
        }
        if Some(number) == self.info {
            let is_count = !differs(0, 488) && !differs(496, 16);
            return if is_count {
                Ok(())
            } else {
                refuse("the block with the count")
            };
        }
        if (self.table..self.table + self.tables * self.per_table).contains(&number) {
            let width = if self.has_32_bits { 4 } else { 2 };
            let per_block = (BLOCK / width) as u32;
            let begin = (number - self.table) % self.per_table * per_block;
            for entry in 0..per_block {
                let cluster = begin + entry;
                let is_ours = self.is_free.get(cluster as usize) == Some(&true) && cluster >= 2
                    || self.root_chain.last() == Some(&cluster);
                if differs(entry as usize * width, width) && !is_ours {
                    return refuse("a table's entry that is taken");
                }
            }
            return Ok(());
        }
        if let Some(unused) = self.unused.get(&number) {
            // Of an entry that is all 0 by now, nothing is left that could be written over.
            let is_erased = |entry: usize| old[entry * 32..][..32] == [0; 32];
            let is_ours = |entry: usize| unused[entry] || is_erased(entry);
            let is_kept = (0..16).all(|entry| is_ours(entry) || !differs(entry * 32, 32));
            return if is_kept {
                Ok(())
            } else {
                refuse("an entry of the root")
            };
        }
        match number.checked_sub(self.data) {
            Some(behind) if behind / self.blocks_per_cluster < self.clusters => {
                let cluster = behind / self.blocks_per_cluster + 2;
                if self.is_free[cluster as usize] {
                    Ok(())
                } else {
                    refuse("a cluster that is taken")
                }
            }
            Some(_) => refuse("behind the volume"),
            None if number < self.first => refuse("before the volume"),
            None => refuse("a reserved block"),
        }
    }

    /// The blocks on which all others depend, with what they are. Those of one name are copies of
    /// each other, or belong together.
    #[must_use]
    pub fn vital(&self) -> Vec<(&'static str, u32)> {
        /// Where FAT32 has the copy of its boot record.
        const BACKUP: u32 = 6;
        let mut vital = vec![("boot record", self.first)];
        if self.has_32_bits {
            vital.push(("backup", self.first + BACKUP));
        }
        vital.extend(self.info.map(|info| ("FSInfo", info)));
        for (which, name) in (0..self.tables).zip(["first table", "second table"]) {
            let table = self.table + which * self.per_table;
            vital.extend([(name, table), (name, table + 1)]);
        }
        let root = self.unused.keys().take(2);
        vital.extend(root.map(|&number| ("root", number)));
        vital
    }

    /// The clusters that are taken and belong to no file, folder or root.
    #[must_use]
    pub fn lost(&self) -> usize {
        let owned: BTreeSet<u32> = self
            .items
            .values()
            .flat_map(|item| &item.chain)
            .copied()
            .collect();
        let is_lost = |cluster: &u32| {
            !self.is_free[*cluster as usize]
                && !owned.contains(cluster)
                && !self.root_chain.contains(cluster)
        };
        (2..self.clusters + 2).filter(is_lost).count()
    }

    /// The first name of `earlier` that is not here as it was.
    #[must_use]
    pub fn missing<'a>(&self, earlier: &'a Self) -> Option<&'a str> {
        let changed = |(name, item): &(&String, &Item)| self.items.get(*name) != Some(*item);
        let mut items = earlier.items.iter();
        items.find(changed).map(|(name, _)| name.as_str())
    }

    /// A file or a folder by the name that its entry has, with folders before it.
    #[must_use]
    pub fn item(&self, name: &str) -> Option<&Item> {
        self.items.get(name)
    }

    /// The entries of the root that are not used, by their blocks and their places in these.
    #[must_use]
    pub fn unused_entries(&self) -> Vec<(u32, usize)> {
        let of = |(&number, unused): (&u32, &[bool; 16])| {
            let unused = *unused;
            let entries = (0..16).filter(move |&entry| unused[entry]);
            entries.map(move |entry| (number, entry * 32))
        };
        self.unused.iter().flat_map(of).collect()
    }

    /// How many files and folders there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.items.len()
    }

    /// A file's contents; shorter than its entry has it where its chain ends early.
    #[must_use]
    pub fn contents(&self, item: &Item, read: &mut dyn FnMut(u32) -> Block) -> Vec<u8> {
        let mut contents = Vec::new();
        for number in self.blocks_of(&item.chain) {
            contents.extend(read(number));
        }
        contents.truncate(item.len() as usize);
        contents
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FIRST, Kind};

    fn read(image: &[u8]) -> impl FnMut(u32) -> Block {
        |number| {
            image[number as usize * BLOCK..][..BLOCK]
                .try_into()
                .unwrap()
        }
    }

    #[test]
    fn each_kind_of_block_has_its_owner() {
        for kind in [Kind::Fat16, Kind::Fat32] {
            let mut image = crate::formatted(kind);
            crate::put(&mut image, "A.BIN", 3_000);
            let census = Census::of(FIRST as u32, &mut read(&image));
            let item = census.item("A       BIN").unwrap();
            assert_eq!(census.contents(item, &mut read(&image)), [b'x'; 3_000]);
            let judged = |number: u32, at: usize| {
                let old = read(&image)(number);
                let mut new = old;
                new[at] ^= 1;
                census
                    .judge(number, &old, &new)
                    .map_err(|foreign| foreign.whose)
            };
            let taken = census.blocks_of(&item.chain)[0];
            assert_eq!(judged(taken, 7), Err("a cluster that is taken"));
            assert_eq!(judged(taken + 40, 7), Ok(()));
            assert_eq!(judged(FIRST as u32, 7), Err("a reserved block"));
            assert_eq!(judged(0, 7), Err("before the volume"));
            let width = if census.has_32_bits { 4 } else { 2 };
            let at = item.chain[1] as usize * width;
            for table in 0..2 {
                let table = census.table + table * census.per_table;
                assert_eq!(judged(table, at), Err("a table's entry that is taken"));
                assert_eq!(judged(table, 90 * width), Ok(()));
                assert_eq!(judged(table, 0), Err("a table's entry that is taken"));
            }
            let root = *census.unused.first_key_value().unwrap().0;
            assert_eq!(judged(root, 3), Err("an entry of the root"));
            assert_eq!(judged(root, 400), Ok(()));
            let last = census.data + census.clusters * census.blocks_per_cluster;
            let blank = [0; BLOCK];
            let foreign = census.judge(last, &blank, &[1; BLOCK]).unwrap_err();
            assert_eq!(foreign.whose, "behind the volume");
        }
    }

    #[test]
    fn a_file_that_is_gone_or_shorter_is_missed() {
        let mut image = crate::formatted(Kind::Fat32);
        crate::put(&mut image, "A.BIN", 3_000);
        let before = Census::of(FIRST as u32, &mut read(&image));
        crate::put(&mut image, "B.BIN", 3_000);
        let after = Census::of(FIRST as u32, &mut read(&image));
        assert_eq!(after.missing(&before), None);
        assert_eq!(before.missing(&after), Some("B       BIN"));
        crate::remove(&mut image, "A.BIN");
        let later = Census::of(FIRST as u32, &mut read(&image));
        assert_eq!(later.missing(&before), Some("A       BIN"));
    }
}
