//! A new file in the root of a memory card that may fail or be pulled at any moment.
//!
//! *Purpose.* The log of a test goes to the card as `TESTnnnn.CSV`, with the next free number: no
//! file is ever overwritten. The names that matter:
//!
//! - [`Disk`], the card: blocks of 512 bytes, which the user of this crate reads and writes;
//! - [`save`], which writes the file and returns the number in its name;
//! - [`NotSaved`], the reason if it could not.
//!
//! *Design.* `volume.rs` checks the card before anything is written, `medium.rs` guards each
//! access, and the file system is `embedded-sdmmc`'s. The card is a trait object, so that all of
//! this is compiled once, for size. On a host it is tested with damaged images and with cards that
//! fail at any block.
//!
//! *Limits.* A card that is pulled while it is written keeps an empty file of that name, and lost
//! blocks that a check of its file system frees. A directory that was damaged before may lose
//! files.
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
//! assert_eq!(refused, Err(NotSaved::NotFat));
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
mod disk;
mod medium;
mod name;
mod not_saved;
mod volume;

use core::ops::ControlFlow;

use embedded_sdmmc::{Mode, TimeSource, Timestamp, VolumeIdx, VolumeManager};
use timebase::CivilTime;

pub use self::disk::{BLOCK, Disk, DiskError};
pub use self::not_saved::NotSaved;

use self::medium::Medium;
use self::volume::Volume;

/// Writes a new file of `len` bytes, and returns the number in its name.
///
/// `read` fills a block with the file's bytes from an offset on, and returns how many; `written` is
/// the file's time, in UTC.
///
/// # Errors
///
/// Why there is no file.
pub fn save(
    disk: &mut dyn Disk,
    len: u32,
    read: &mut dyn FnMut(u32, &mut [u8]) -> usize,
    written: Option<CivilTime>,
) -> Result<u16, NotSaved> {
    let volume = Volume::on(disk)?;
    if !volume.has_room(disk, len)? {
        return Err(NotSaved::Full);
    }
    let medium = Medium::new(disk, volume);
    let volumes = Volumes::new_with_limits(medium, Written(written), 0);
    let saved = write(&volumes, len, read);
    // The failure of the disk is more exact than the file system's error that follows from it.
    match volumes.device(|medium| medium.failure()) {
        Some(failure) => Err(failure.into()),
        None => saved,
    }
}

/// One volume, one directory and one file at a time.
type Volumes<'a> = VolumeManager<Medium<'a>, Written, 1, 1, 1>;

fn write(
    volumes: &Volumes<'_>,
    len: u32,
    read: &mut dyn FnMut(u32, &mut [u8]) -> usize,
) -> Result<u16, NotSaved> {
    let volume = volumes.open_volume(VolumeIdx(0))?;
    let root = volume.open_root_dir()?;
    let mut last = 0;
    root.iterate_dir(|entry| {
        let number = name::number(entry.name.base_name(), entry.name.extension());
        last = last.max(number.unwrap_or(0));
        ControlFlow::Continue(())
    })?;
    let number = last + 1;
    let name = name::of(number).ok_or(NotSaved::Full)?;
    let file = root.open_file_in_dir(name.as_str(), Mode::ReadWriteCreate)?;
    let mut offset = 0;
    let mut block = [0; BLOCK];
    while offset < len {
        let wanted = (len - offset).min(BLOCK as u32);
        let made = read(offset, &mut block);
        let stretch = block.get(..made.min(wanted as usize)).unwrap_or_default();
        if stretch.len() < wanted as usize {
            return Err(NotSaved::Short);
        }
        file.write(stretch)?;
        offset += wanted;
    }
    file.close()?;
    root.close()?;
    volume.close()?;
    Ok(number)
}

/// The time of a file; if it is not known, the beginning of FAT's time.
struct Written(Option<CivilTime>);

impl TimeSource for Written {
    fn get_timestamp(&self) -> Timestamp {
        /// Years are kept in 7 bits from 1980 on.
        const BEGINNING: Timestamp = Timestamp {
            year_since_1970: 10,
            zero_indexed_month: 0,
            zero_indexed_day: 0,
            hours: 0,
            minutes: 0,
            seconds: 0,
        };
        self.0.map_or(BEGINNING, |civil| Timestamp {
            year_since_1970: civil.year.saturating_sub(1970).min(137) as u8,
            zero_indexed_month: civil.month.saturating_sub(1),
            zero_indexed_day: civil.day.saturating_sub(1),
            hours: civil.hour,
            minutes: civil.minute,
            seconds: civil.second.min(59),
        })
    }
}
