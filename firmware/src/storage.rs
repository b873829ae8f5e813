//! Thread level: the log of a test goes to the SD card, when it is asked for.
//!
//! *Purpose.* The file `TESTnnnn.CSV` in the card's root, with the next free number: nothing is ever
//! written over.
//!
//! *Design.* What may block does so below every interrupt. The card is found anew each time, so it may
//! have been put in a moment ago. Whatever happens to it, the log stays in memory, and asking again
//! tries again. [`volume`] looks before anything is written; [`medium`] guards what is; the file
//! system is `embedded-sdmmc`'s. The file's time is our clock's, in UTC.
//!
//! *Limits.* A card that is pulled while it is written has an empty file of that name, and blocks that
//! a check of its file system gives back. A file system with a damaged directory may lose files.

mod medium;
mod volume;

use embedded_sdmmc::{Block, Mode, TimeSource, Timestamp, VolumeIdx, VolumeManager};
use sample_log::csv;
use utc_clock::{ClockState, calendar};

use self::medium::{Failure, Medium};
use self::volume::{NoVolume, Volume};
use crate::drivers::card::{Card, CardError};
use crate::drivers::sdio::BusError;
use crate::drivers::time;
use crate::samples::SAMPLES;
use crate::shared::{CARD, CLOCK, NEWS, News};
use crate::{board, samples};

/// The highest number that a file can have.
const NUMBER_MAX: u16 = 9_999;

/// Why a log is not on the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum NotSaved {
    /// This board has no slot for one.
    NoSlot,
    /// There is no card in it.
    NoCard,
    /// It has no FAT16 or FAT32 volume in its first partition, or a damaged one.
    NotFat,
    /// It is write-protected.
    WriteProtected,
    /// It has no room, or no number, for the file.
    Full,
    /// It has been pulled, or another one has been put in.
    Pulled,
    /// It fails.
    Io,
    /// A new test has begun meanwhile: the log is that test's.
    Cleared,
}

impl From<Failure> for NotSaved {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Card(CardError::Bus(BusError::Silent) | CardError::Changed) => Self::Pulled,
            Failure::Card(CardError::WriteProtected) => Self::WriteProtected,
            Failure::Card(CardError::Beyond) | Failure::Damaged => Self::NotFat,
            Failure::Card(CardError::Bus(_) | CardError::Refused(_) | CardError::Busy) => Self::Io,
        }
    }
}

impl From<CardError> for NotSaved {
    fn from(error: CardError) -> Self {
        Failure::Card(error).into()
    }
}

impl From<NoVolume> for NotSaved {
    fn from(error: NoVolume) -> Self {
        match error {
            NoVolume::Card(error) => error.into(),
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

/// Runs for ever.
pub fn run(mut slot: Option<Card>) -> ! {
    loop {
        board::sleep_until(samples::is_save_wanted);
        samples::begin_save();
        let began = time::now();
        let saved = slot.as_mut().map_or(Err(NotSaved::NoSlot), save);
        let took_us = time::now().since(began) / i64::from(timebase::CORE_HZ / 1_000_000);
        let errors = slot.as_ref().map(Card::errors).unwrap_or_default();
        CARD.tell(errors);
        let news = match saved {
            Ok((file, samples)) => {
                defmt::info!(
                    "the log is saved: TEST{=u16:04}.CSV, samples {=u32}, took {=i64} us",
                    file,
                    samples,
                    took_us
                );
                News::Saved { file, samples }
            }
            Err(why) => {
                defmt::warn!("the log is not saved: {}, took {=i64} us", why, took_us);
                News::NotSaved(why)
            }
        };
        // A full queue means that nobody listens; the log has it.
        let _ = NEWS.try_send(news);
    }
}

/// Writes the log to whatever card is there; the number of the file, and its samples.
fn save(card: &mut Card) -> Result<(u16, u32), NotSaved> {
    let saved = match card.find() {
        Err(CardError::Bus(BusError::Silent)) => Err(NotSaved::NoCard),
        Err(error) => Err(error.into()),
        Ok(()) if card.is_write_protected() => Err(NotSaved::WriteProtected),
        Ok(()) => write(card),
    };
    card.release();
    saved
}

fn write(card: &mut Card) -> Result<(u16, u32), NotSaved> {
    let samples = SAMPLES.len();
    let bytes = csv::file_len(samples);
    let volume = Volume::on(card)?;
    if !volume.has_room(card, bytes)? {
        return Err(NotSaved::Full);
    }
    let volumes =
        VolumeManager::<_, _, 1, 1, 1>::new_with_limits(Medium::new(card, volume), Utc, 0);
    let written = write_file(&volumes, bytes);
    // What stopped the card says more than what the file system made of it.
    match volumes.device(|medium| medium.failure()) {
        Some(failure) => Err(failure.into()),
        None => written.map(|number| (number, samples)),
    }
}

fn write_file(
    volumes: &VolumeManager<Medium<'_>, Utc, 1, 1, 1>,
    bytes: u32,
) -> Result<u16, NotSaved> {
    let volume = volumes.open_volume(VolumeIdx(0))?;
    let root = volume.open_root_dir()?;
    let mut last = 0;
    root.iterate_dir(|entry| {
        if entry.name.extension() == b"CSV" {
            last = last.max(number_in(entry.name.base_name()).unwrap_or(0));
        }
        core::ops::ControlFlow::Continue(())
    })?;
    let number = last + 1;
    if number > NUMBER_MAX {
        return Err(NotSaved::Full);
    }
    let name = name(number);
    let name = core::str::from_utf8(&name).map_err(|_| NotSaved::Io)?;
    let file = root.open_file_in_dir(name, Mode::ReadWriteCreate)?;
    let mut offset = 0;
    let mut block = [0; Block::LEN];
    while offset < bytes {
        let wanted = (bytes - offset).min(Block::LEN_U32);
        let made = SAMPLES.read(offset, &mut block);
        // A log that was cleared has fewer.
        let stretch = block.get(..made).unwrap_or_default();
        if stretch.len() < wanted as usize || !SAMPLES.with(|log| log.is_frozen()) {
            return Err(NotSaved::Cleared);
        }
        file.write(stretch)?;
        offset += wanted;
    }
    file.close()?;
    root.close()?;
    volume.close()?;
    Ok(number)
}

/// The number in a file's name, if it is one of ours.
fn number_in(base_name: &[u8]) -> Option<u16> {
    let digits: [u8; 4] = base_name.strip_prefix(b"TEST")?.try_into().ok()?;
    digits.into_iter().try_fold(0, |number, digit| {
        digit
            .is_ascii_digit()
            .then(|| number * 10 + u16::from(digit - b'0'))
    })
}

/// The name of the file with that number.
const fn name(number: u16) -> [u8; 12] {
    let mut name = *b"TEST0000.CSV";
    let mut rest = number;
    let mut place = 7;
    while place > 3 {
        name[place] += (rest % 10) as u8;
        rest /= 10;
        place -= 1;
    }
    name
}

/// The time of a file: our clock's, the beginning of FAT's time before it is set.
struct Utc;

impl TimeSource for Utc {
    fn get_timestamp(&self) -> Timestamp {
        let reading = CLOCK.reading_at(time::now());
        let civil = match reading.state {
            ClockState::Unset => None,
            ClockState::Set | ClockState::Holdover => calendar::from_utc(reading.utc),
        };
        civil.map_or(
            Timestamp {
                year_since_1970: 10,
                zero_indexed_month: 0,
                zero_indexed_day: 0,
                hours: 0,
                minutes: 0,
                seconds: 0,
            },
            |civil| Timestamp {
                year_since_1970: (civil.year - 1970) as u8,
                zero_indexed_month: civil.month - 1,
                zero_indexed_day: civil.day - 1,
                hours: civil.hour,
                minutes: civil.minute,
                seconds: civil.second,
            },
        )
    }
}
