//! A new file in the root of a memory card.
//!
//! *Purpose.* [`save`] writes `TESTnnnn.CSV`, with the next free number: nothing is ever written over.
//! What comes of it is a number or a small reason.
//!
//! *Design.* `volume` looks before anything is written; `medium` guards what is; the file system is
//! `embedded-sdmmc`'s. The card is a [`Disk`], so that all of this is compiled once, for size, and
//! tried on a host against images that are damaged and cards that fail at any block.
//!
//! *Limits.* A card that goes while it is written has an empty file of that name, and blocks that a
//! check of its file system gives back. A directory that is damaged already may lose files.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod bytes;
mod medium;
mod name;
mod volume;

use core::ops::ControlFlow;

use embedded_sdmmc::{Mode, TimeSource, Timestamp, VolumeIdx, VolumeManager};
use timebase::CivilTime;

use self::medium::{Failure, Medium};
use self::volume::{NoVolume, Volume};

/// Bytes of a block.
pub const BLOCK: usize = 512;

/// Why a disk did not give or take a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiskError {
    /// It does not answer any more, or is another one.
    Gone,
    /// It may not be written.
    WriteProtected,
    /// It has no such block.
    Beyond,
    /// Anything else.
    Failed,
}

/// Blocks of 512 bytes, by number.
pub trait Disk {
    /// Reads a block.
    ///
    /// # Errors
    ///
    /// Why it cannot be had.
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError>;

    /// Writes a block; it stays when this returns.
    ///
    /// # Errors
    ///
    /// Why it was not taken.
    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError>;

    /// How many it has.
    fn blocks(&self) -> u32;
}

/// Why there is no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSaved {
    /// There is no FAT16 or FAT32 volume in the first partition, or a damaged one.
    NotFat,
    /// The card may not be written.
    WriteProtected,
    /// It has no room, or no number, for the file.
    Full,
    /// It is gone, or another one has been put in.
    Gone,
    /// It fails.
    Failed,
    /// The contents came to an early end.
    Short,
}

impl From<DiskError> for NotSaved {
    fn from(error: DiskError) -> Self {
        match error {
            DiskError::Gone => Self::Gone,
            DiskError::WriteProtected => Self::WriteProtected,
            DiskError::Beyond => Self::NotFat,
            DiskError::Failed => Self::Failed,
        }
    }
}

impl From<Failure> for NotSaved {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Disk(error) => error.into(),
            Failure::Damaged => Self::NotFat,
        }
    }
}

impl From<NoVolume> for NotSaved {
    fn from(error: NoVolume) -> Self {
        match error {
            NoVolume::Disk(error) => error.into(),
            NoVolume::NotFat => Self::NotFat,
        }
    }
}

impl From<embedded_sdmmc::Error<Failure>> for NotSaved {
    fn from(error: embedded_sdmmc::Error<Failure>) -> Self {
        use embedded_sdmmc::Error;
        match error {
            Error::DeviceError(failure) => failure.into(),
            Error::DiskFull | Error::NotEnoughSpace => Self::Full,
            _ => Self::NotFat,
        }
    }
}

/// Writes a new file of `len` bytes; the number in its name. `read` gives the file's bytes from an
/// offset on, as many as there is room for; `written` is the file's time, in UTC.
///
/// # Errors
///
/// Why there is no such file.
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
    // What stopped the disk says more than what the file system made of it.
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

/// The time of a file; the beginning of FAT's time where it is not known.
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
