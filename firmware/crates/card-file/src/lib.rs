//! A new file in the root of a memory card that may fail or be pulled at any moment.
//!
//! *Purpose.* The log of a test goes to the card as `TESTnnnn.CSV`, with the next free number: no
//! file is ever overwritten. The names that matter:
//!
//! - [`Disk`], the card: blocks of 512 bytes, which the user of this crate reads and writes;
//! - [`save`], which writes the file and returns the number in its name;
//! - [`NotSaved`], the reason if it could not;
//! - [`look`] and [`examine`], which say what would become of it, and write nothing.
//!
//! *Design.* A card is believed as far as it was checked. [`save`] first looks round: `partition.rs`
//! finds the volume, `volume.rs` holds its boot record against everything that repeats it, `root.rs`
//! reads the root, `table.rs` finds clusters that both tables call free. Only then `file.rs` writes,
//! to those clusters and to unused entries, and says "saved" when entry, chain and contents have been
//! read back. The card is a trait object, so that all of this is compiled once, for size. Each loop
//! ends, whatever is on the card.
//!
//! *Limits.* Files go into the root. A card that is pulled while it is written has lost clusters at
//! worst, and two tables that differ, which a check of its file system mends.
//!
//! ```
//! use card_file::{BLOCK, Disk, DiskError, NotSaved, save};
//!
//! /// A card in memory.
//! struct Image(Vec<[u8; BLOCK]>);
//!
//! impl Disk for Image {
//!     fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError> {
//!         *block = *self.0.get(number as usize).ok_or(DiskError::Beyond)?;
//!         Ok(())
//!     }
//!
//!     fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError> {
//!         *self.0.get_mut(number as usize).ok_or(DiskError::Beyond)? = *block;
//!         Ok(())
//!     }
//!
//!     fn blocks(&self) -> u32 {
//!         self.0.len() as u32
//!     }
//! }
//!
//! let formatted = fat_image::formatted(fat_image::Kind::Fat16);
//! let mut card = Image(formatted.as_chunks().0.to_vec());
//! let contents = b"time,uncertainty\n";
//! // Called with growing offsets until the whole file is there.
//! let mut read = |offset: u32, block: &mut [u8]| {
//!     let rest = &contents[offset as usize..];
//!     let len = rest.len().min(block.len());
//!     block[..len].copy_from_slice(&rest[..len]);
//!     len
//! };
//! // The first file is TEST0001.CSV, and no name is given twice.
//! assert_eq!(save(&mut card, contents.len() as u32, &mut read, None), Ok(1));
//! assert_eq!(save(&mut card, contents.len() as u32, &mut read, None), Ok(2));
//!
//! // A card that was never formatted is left as it is.
//! let mut empty = Image(vec![[0; BLOCK]; 4_096]);
//! let refused = save(&mut empty, 100, &mut read, None);
//! assert_eq!(refused, Err(NotSaved::NoFileSystem));
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod bytes;
mod checksum;
mod disk;
mod file;
mod name;
mod not_saved;
mod partition;
mod root;
mod stretch;
mod table;
mod volume;

use timebase::CivilTime;

pub use self::disk::{BLOCK, Disk, DiskError};
pub use self::not_saved::NotSaved;

use self::file::Plan;
use self::table::{FreeClusters, Tables};
use self::volume::FIRST_CLUSTER;

/// Writes a new file of `len` bytes, and returns the number in its name.
///
/// `read` fills a block with the file's bytes from an offset on, and returns how many; `written` is
/// the file's time, in UTC.
///
/// # Errors
///
/// Why there is no file. Nothing was written unless the card fails, does not keep what it took, or
/// is stopped.
pub fn save(
    disk: &mut dyn Disk,
    len: u32,
    read: &mut dyn FnMut(u32, &mut [u8]) -> usize,
    written: Option<CivilTime>,
) -> Result<u16, NotSaved> {
    plan(disk, len)?.write(read, date_and_time(written))
}

/// The number that a new file of `len` bytes would get; writes nothing.
///
/// # Errors
///
/// Why there would be no file.
pub fn look(disk: &mut dyn Disk, len: u32) -> Result<u16, NotSaved> {
    plan(disk, len).map(|plan| plan.number())
}

/// What is known of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facts {
    /// The volume's first block on the card.
    pub first_block: u32,
    /// The volume's length. \[blocks\]
    pub blocks: u32,
    /// Whether it is FAT32, and not FAT16.
    pub is_fat32: bool,
    /// How many tables are in use.
    pub tables: u32,
    /// The size of a cluster. \[bytes\]
    pub cluster_bytes: u32,
    /// How many clusters there are.
    pub clusters: u32,
    /// How many of them both tables call free.
    pub free_clusters: u32,
}

/// Describes the volume that a file would go to; reads all of its tables, and writes nothing.
///
/// # Errors
///
/// Why there is none.
pub fn examine(disk: &mut dyn Disk) -> Result<Facts, NotSaved> {
    let volume = partition::find(disk)?;
    let all = FreeClusters::from(FIRST_CLUSTER, volume.clusters);
    Ok(Facts {
        first_block: volume.stretch().first,
        blocks: volume.stretch().blocks,
        is_fat32: volume.has_32_bits,
        tables: volume.tables,
        cluster_bytes: volume.cluster_bytes(),
        clusters: volume.clusters,
        free_clusters: Tables::new(disk, volume).count(all, volume.clusters)?,
    })
}

fn plan(disk: &mut dyn Disk, len: u32) -> Result<Plan<'_>, NotSaved> {
    let volume = partition::find(disk)?;
    Plan::make(Tables::new(disk, volume), len)
}

/// As FAT has them; if the time is not known, the beginning of FAT's time.
fn date_and_time(civil: Option<CivilTime>) -> (u16, u16) {
    /// The first of January 1980: years are kept in 7 bits from then on.
    const BEGINNING: (u16, u16) = (1 << 5 | 1, 0);
    civil.map_or(BEGINNING, |civil| {
        let year = civil.year.saturating_sub(1980).min(127);
        let date = year << 9 | u16::from(civil.month) << 5 | u16::from(civil.day);
        // Seconds in steps of two.
        let second = u16::from(civil.second.min(59)) / 2;
        let time = u16::from(civil.hour) << 11 | u16::from(civil.minute) << 5 | second;
        (date, time)
    })
}
