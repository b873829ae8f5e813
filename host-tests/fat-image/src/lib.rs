//! Images of memory cards, made and read by `fatfs`: another hand than the firmware's.
//!
//! *Purpose.* A card is formatted with it, the firmware writes to it, and the files are read. A
//! [`Census`] knows which blocks are whose, and judges what is written.
//!
//! *Limits.* What cannot be done is a panic, but for reading with [`contents`]: of formatting only
//! the machine's memory can be in the way, and of the rest tests are the only users.
#![expect(
    clippy::unwrap_used,
    clippy::missing_panics_doc,
    reason = "in memory formatting cannot fail, and the rest is for tests, which a panic fails"
)]

mod census;

pub use census::{BLOCK, Block, Census, Foreign, Item};

use std::collections::BTreeMap;
use std::io::{self, Cursor, Read as _, Write as _};

use fatfs::{DateTime, FatType, FileSystem, FormatVolumeOptions, FsOptions};

/// Where the partition begins, in blocks, as on cards from a shop.
pub const FIRST: usize = 2_048;

/// The kinds of FAT that a card can have.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// 1 MB with 12 bits, which small cards had.
    Fat12,
    /// 15 MB with 16 bits, clusters of 1 KB.
    Fat16,
    /// 35 MB with 32 bits, clusters of 512 bytes.
    Fat32,
}

/// An empty card: a master boot record with one partition, and a volume of that kind in it.
#[must_use]
pub fn formatted(kind: Kind) -> Vec<u8> {
    // MB of the partition, its type, and bytes of a cluster: the smallest of each kind.
    let (megabytes, partition, cluster, fat) = match kind {
        Kind::Fat12 => (1, 0x01, 512, FatType::Fat12),
        Kind::Fat16 => (15, 0x06, 1_024, FatType::Fat16),
        Kind::Fat32 => (35, 0x0C, 512, FatType::Fat32),
    };
    let blocks = megabytes * 2_048;
    let mut image = vec![0; (FIRST + blocks) * BLOCK];
    let entry = &mut image[446..462];
    entry[4] = partition;
    entry[8..12].copy_from_slice(&(FIRST as u32).to_le_bytes());
    entry[12..16].copy_from_slice(&(blocks as u32).to_le_bytes());
    image[510..512].copy_from_slice(&[0x55, 0xAA]);
    let options = FormatVolumeOptions::new()
        .fat_type(fat)
        .bytes_per_cluster(cluster);
    fatfs::format_volume(partition_of(&mut image), options).unwrap();
    clear_behind_the_last_cluster(&mut image);
    image
}

/// Has the tables' entries that belong to no cluster be 0, as other formatters leave them and
/// `fatfs` does not.
fn clear_behind_the_last_cluster(image: &mut [u8]) {
    let volume = FileSystem::new(partition_of(image), FsOptions::new()).unwrap();
    let bits = match volume.fat_type() {
        // The firmware does not write to these.
        FatType::Fat12 => return,
        FatType::Fat16 => 16,
        FatType::Fat32 => 32,
    };
    let used = (volume.stats().unwrap().total_clusters() as usize + 2) * bits / 8;
    drop(volume);
    let boot = &image[FIRST * BLOCK..];
    let half = |at: usize| usize::from(u16::from_le_bytes([boot[at], boot[at + 1]]));
    let (reserved, tables, short) = (half(14), usize::from(boot[16]), half(22));
    let blocks = if short == 0 {
        half(36) | half(38) << 16
    } else {
        short
    };
    for table in 0..tables {
        let table = (FIRST + reserved + table * blocks) * BLOCK;
        image[table + used..table + blocks * BLOCK].fill(0);
    }
}

/// A file of a card.
#[derive(Clone, Debug, PartialEq)]
pub struct File {
    /// All of it.
    pub contents: Vec<u8>,
    /// When it was written last.
    pub modified: DateTime,
}

/// The files in the root of a card.
#[must_use]
pub fn files(image: &[u8]) -> BTreeMap<String, File> {
    let mut image = image.to_vec();
    let volume = FileSystem::new(partition_of(&mut image), FsOptions::new()).unwrap();
    let root = volume.root_dir();
    root.iter()
        .map(|entry| {
            let entry = entry.unwrap();
            let mut contents = Vec::new();
            entry.to_file().read_to_end(&mut contents).unwrap();
            assert_eq!(contents.len() as u64, entry.len(), "{}", entry.file_name());
            let modified = entry.modified();
            (entry.file_name(), File { contents, modified })
        })
        .collect()
}

/// Puts a file of `len` bytes on it.
pub fn put(image: &mut [u8], name: &str, len: usize) {
    let volume = FileSystem::new(partition_of(image), FsOptions::new()).unwrap();
    let mut file = volume.root_dir().create_file(name).unwrap();
    file.write_all(&vec![b'x'; len]).unwrap();
}

/// Bytes that are free on it.
#[must_use]
pub fn free_bytes(image: &mut [u8]) -> usize {
    let volume = FileSystem::new(partition_of(image), FsOptions::new()).unwrap();
    let stats = volume.stats().unwrap();
    stats.free_clusters() as usize * stats.cluster_size() as usize
}

/// All of one file in the root of a card.
///
/// # Errors
///
/// When there is none of that name, or the card's file system makes no sense.
pub fn contents(image: &mut [u8], name: &str) -> io::Result<Vec<u8>> {
    let volume = FileSystem::new(partition_of(image), FsOptions::new())?;
    let mut contents = Vec::new();
    let mut file = volume.root_dir().open_file(name)?;
    file.read_to_end(&mut contents)?;
    Ok(contents)
}

fn partition_of(image: &mut [u8]) -> Cursor<&mut [u8]> {
    Cursor::new(&mut image[FIRST * BLOCK..])
}

/// Takes a file off it.
pub fn remove(image: &mut [u8], name: &str) {
    let volume = FileSystem::new(partition_of(image), FsOptions::new()).unwrap();
    volume.root_dir().remove(name).unwrap();
}

/// Has the volume's hints, which FAT32 has, say that the next free cluster is the last one.
pub fn hint_at_the_last_cluster(image: &mut [u8]) {
    let volume = FileSystem::new(partition_of(image), FsOptions::new()).unwrap();
    let last = volume.stats().unwrap().total_clusters() + 1;
    drop(volume);
    let hint = (FIRST + 1) * BLOCK + 492;
    image[hint..hint + 4].copy_from_slice(&last.to_le_bytes());
}
