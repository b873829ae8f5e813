//! The root directory: which names are in it, where an entry has room, and the entry.
//!
//! *Design.* All of it is read before anything is written. Its chain has to be one in both tables,
//! of no more clusters than a directory can have. Its entries have to look like entries: a root
//! that is said to be where something else is would be written into that. Behind the end there are
//! none in use, and an entry that was deleted has given its clusters back: otherwise it is one whose
//! first byte is damaged, and is left alone. And since nothing repeats
//! FAT16's size of a cluster, the first few files prove it: their chains are as long as their
//! sizes ask for, or the volume is not believed. Of these files a minority may be damaged.

use crate::bytes::{self, Block, byte, half, put, word};
use crate::disk::{BLOCK, Disk};
use crate::name::{self, LAST, Name};
use crate::not_saved::NotSaved;
use crate::table::{Entry, Tables};
use crate::volume::Volume;

/// Bytes of an entry.
pub(crate) const ENTRY: usize = 32;

/// The most blocks of a directory: 65 536 entries.
const BLOCKS_MAX: u32 = 65_536 * ENTRY as u32 / BLOCK as u32;

/// Files whose chains are compared with their sizes, and the longest such chain. \[clusters\]
const PROVED: u32 = 8;
const CHAIN_MAX: u32 = 20_000;

/// The first byte of a deleted entry.
const DELETED: u32 = 0xE5;

/// An entry's attributes.
const LABEL: u32 = 0x08;
const DIRECTORY: u32 = 0x10;
const LONG_NAME: u32 = 0x0F;
const ARCHIVE: u8 = 0x20;

/// Where an entry goes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// Into the block `number`, at the byte `at`.
    Free { number: u32, at: usize },
    /// Into a cluster that follows this last one.
    Behind(u32),
}

/// What has to be known of the root.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Root {
    pub(crate) place: Place,
    /// The number for the file's name.
    pub(crate) number: u16,
}

impl Root {
    /// Reads all of it.
    ///
    /// # Errors
    ///
    /// Why no file can be put into it.
    pub(crate) fn of(tables: &mut Tables<'_>) -> Result<Self, NotSaved> {
        let mut look = Look::default();
        let mut blocks = Blocks::of(&tables.volume);
        let mut block = [0; BLOCK];
        while let Some(number) = blocks.next(tables)? {
            tables.disk.read(number, &mut block)?;
            for at in (0..BLOCK).step_by(ENTRY) {
                look.entry(tables, &block, number, at)?;
            }
        }
        if look.unlike + look.broken > look.like {
            return Err(if look.broken > look.unlike {
                NotSaved::TableDamaged
            } else {
                NotSaved::BootDamaged
            });
        }
        let place = match (look.free, blocks.chain) {
            (Some((number, at)), _) => Place::Free { number, at },
            (None, Some(last)) if blocks.seen < BLOCKS_MAX => Place::Behind(last),
            (None, _) => return Err(NotSaved::NoEntry),
        };
        let number = match look.last_file.checked_add(1) {
            Some(number) if number <= LAST && look.directories == 0 => number,
            _ => lowest_free(tables, look.last_file)?,
        };
        Ok(Self { place, number })
    }
}

/// What was seen so far.
#[derive(Default)]
struct Look {
    /// The first unused entry.
    free: Option<(u32, usize)>,
    /// Whether the end was seen.
    is_over: bool,
    last_file: u16,
    /// Directories with a name of ours.
    directories: u32,
    /// Files whose chains are as long as their sizes ask for, are of another length, and end in
    /// nothing or differ between the tables.
    like: u32,
    unlike: u32,
    broken: u32,
}

impl Look {
    /// Takes an entry in.
    fn entry(
        &mut self,
        tables: &mut Tables<'_>,
        block: &Block,
        number: u32,
        at: usize,
    ) -> Result<(), NotSaved> {
        let first = byte(block, at);
        let attributes = byte(block, at + 11);
        match first {
            // All of it is 0, since nothing was there.
            0 if !self.is_over && (0..ENTRY).any(|byte| bytes::byte(block, at + byte) != 0) => {
                return Err(NotSaved::RootDamaged);
            }
            0 => {
                self.is_over = true;
                self.free = self.free.or(Some((number, at)));
                return Ok(());
            }
            DELETED => {
                if self.free.is_none() && is_given_back(tables, block, at)? {
                    self.free = Some((number, at));
                }
                return Ok(());
            }
            _ if self.is_over => return Err(NotSaved::RootDamaged),
            _ => {}
        }
        if attributes & 0x3F == LONG_NAME {
            return Ok(());
        }
        if attributes & 0xC0 != 0 || first < 0x20 && first != 0x05 {
            return Err(NotSaved::RootDamaged);
        }
        if attributes & LABEL != 0 {
            return Ok(());
        }
        if let Some(number) = name::number(name_at(block, at)) {
            if attributes & DIRECTORY != 0 {
                self.directories += 1;
            } else {
                self.last_file = self.last_file.max(number);
            }
        }
        let size = word(block, at + 28);
        if attributes & DIRECTORY == 0 && size > 0 && self.like + self.unlike + self.broken < PROVED
        {
            self.prove(tables, cluster_at(tables, block, at), size)?;
        }
        Ok(())
    }

    /// Compares a chain with the size of its file.
    fn prove(&mut self, tables: &mut Tables<'_>, first: u32, size: u32) -> Result<(), NotSaved> {
        let wanted = tables.volume.clusters_for(size);
        if wanted > CHAIN_MAX {
            return Ok(());
        }
        let mut cluster = first;
        let mut seen = 0;
        let count = loop {
            if seen == wanted || !tables.volume.has_cluster(cluster) {
                break &mut self.unlike;
            }
            seen += 1;
            match tables.entry(cluster)? {
                Entry::Next(next) => cluster = next,
                Entry::Last if seen == wanted => break &mut self.like,
                Entry::Last => break &mut self.unlike,
                Entry::Free | Entry::Other => break &mut self.broken,
            }
        };
        *count += 1;
        Ok(())
    }
}

/// The first cluster in an entry.
fn cluster_at(tables: &Tables<'_>, block: &Block, at: usize) -> u32 {
    let high = if tables.volume.has_32_bits {
        half(block, at + 20) << 16
    } else {
        0
    };
    half(block, at + 26) | high
}

/// Whether nothing is left of what a deleted entry stood for.
fn is_given_back(tables: &mut Tables<'_>, block: &Block, at: usize) -> Result<bool, NotSaved> {
    if byte(block, at + 11) & 0x3F == LONG_NAME {
        // A long name is deleted together with what follows it.
        return Ok(byte(block, at + ENTRY) == DELETED);
    }
    let cluster = cluster_at(tables, block, at);
    Ok(!tables.volume.has_cluster(cluster) || tables.entry(cluster)? == Entry::Free)
}

fn name_at(block: &Block, at: usize) -> &[u8] {
    block.get(at..at + 11).unwrap_or_default()
}

/// The lowest number in no name, but behind `last` as long as there is one.
fn lowest_free(tables: &mut Tables<'_>, last: u16) -> Result<u16, NotSaved> {
    /// Numbers in a block of bits.
    const AT_ONCE: u16 = 8 * BLOCK as u16;
    let mut begin = if last < LAST { last + 1 } else { 1 };
    let mut block = [0; BLOCK];
    // One round for each block of bits, and one to come round to 1.
    for _ in 0..=LAST / AT_ONCE + 1 {
        let mut taken = [0_u8; BLOCK];
        let mut blocks = Blocks::of(&tables.volume);
        'all: while let Some(number) = blocks.next(tables)? {
            tables.disk.read(number, &mut block)?;
            for at in (0..BLOCK).step_by(ENTRY) {
                let attributes = byte(&block, at + 11);
                if byte(&block, at) == 0 {
                    break 'all;
                }
                if attributes & LABEL != 0 {
                    continue;
                }
                let number = name::number(name_at(&block, at));
                let bit = number.and_then(|number| number.checked_sub(begin));
                if let Some(bit) = bit
                    && let Some(byte) = taken.get_mut(usize::from(bit / 8))
                {
                    *byte |= 1 << (bit % 8);
                }
            }
        }
        let is_free = |bit: &u16| {
            let byte = taken.get(usize::from(bit / 8)).copied().unwrap_or(0xFF);
            byte & 1 << (bit % 8) == 0
        };
        let end = AT_ONCE.min(LAST + 1 - begin);
        if let Some(bit) = (0..end).find(is_free) {
            return Ok(begin + bit);
        }
        begin += end;
        if begin > LAST {
            begin = 1;
        }
    }
    Err(NotSaved::NoNumber)
}

/// The blocks of the root, one after the other.
struct Blocks {
    /// The next one in this piece, and how many it still has.
    next: u32,
    left: u32,
    /// The cluster that the piece is, if it is one.
    chain: Option<u32>,
    seen: u32,
}

impl Blocks {
    const fn of(volume: &Volume) -> Self {
        if volume.has_32_bits {
            Self {
                next: volume.block_of(volume.root),
                left: volume.blocks_per_cluster,
                chain: Some(volume.root),
                seen: 0,
            }
        } else {
            Self {
                next: volume.root,
                left: volume.root_blocks(),
                chain: None,
                seen: 0,
            }
        }
    }

    fn next(&mut self, tables: &mut Tables<'_>) -> Result<Option<u32>, NotSaved> {
        if self.left == 0 {
            let Some(cluster) = self.chain else {
                return Ok(None);
            };
            match tables.entry(cluster)? {
                Entry::Last => return Ok(None),
                Entry::Next(next) if self.seen < BLOCKS_MAX => {
                    self.chain = Some(next);
                    self.next = tables.volume.block_of(next);
                    self.left = tables.volume.blocks_per_cluster;
                }
                _ => return Err(NotSaved::RootDamaged),
            }
        }
        let number = self.next;
        self.next += 1;
        self.left -= 1;
        self.seen += 1;
        Ok(Some(number))
    }
}

/// A file's entry.
pub(crate) struct FileEntry {
    pub(crate) name: Name,
    /// The first cluster; 0 without one.
    pub(crate) cluster: u32,
    /// Its length. \[bytes\]
    pub(crate) len: u32,
    /// Its date, and the time of that day, as FAT has them.
    pub(crate) date: u16,
    pub(crate) time: u16,
}

impl FileEntry {
    fn bytes(&self) -> [u8; ENTRY] {
        let mut bytes = [0; ENTRY];
        let (name, rest) = bytes.split_at_mut(self.name.len());
        name.copy_from_slice(&self.name);
        let cluster = self.cluster.to_le_bytes();
        let (date, time) = (self.date.to_le_bytes(), self.time.to_le_bytes());
        let len = self.len.to_le_bytes();
        // Attributes, two bytes of no use here, then made, read, and written.
        let ours = [
            ARCHIVE, 0, 0, time[0], time[1], date[0], date[1], date[0], date[1], cluster[2],
            cluster[3], time[0], time[1], date[0], date[1], cluster[0], cluster[1], len[0], len[1],
            len[2], len[3],
        ];
        rest.copy_from_slice(&ours);
        bytes
    }

    /// Writes it into its place, and reads it back.
    ///
    /// # Errors
    ///
    /// The disk failed, or did not keep it.
    pub(crate) fn write(
        &self,
        disk: &mut dyn Disk,
        number: u32,
        at: usize,
    ) -> Result<(), NotSaved> {
        let mut block = [0; BLOCK];
        disk.read(number, &mut block)?;
        put(&mut block, at, &self.bytes());
        disk.write(number, &block)?;
        let mut kept = [0; BLOCK];
        disk.read(number, &mut kept)?;
        if kept == block {
            return Ok(());
        }
        Err(NotSaved::NotKept)
    }
}
