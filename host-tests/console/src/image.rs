//! Words of an image that are written after it is built.
//!
//! *Purpose.* Boards on one network need different system ids, a recording needs the clock's settings
//! of its own time, and none of them another build: [`with_word`] writes a [`Word`] of an ELF file.
//!
//! *Design.* The firmware has each word under its name and reads it at run time.
//!
//! *Limits.* Only what the file holds can be written, not what the firmware makes at its start.

use std::path::Path;

use anyhow::{Context as _, anyhow, bail, ensure};
use object::read::elf::ProgramHeader as _;
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};

/// A word of the image that tools write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// The board's MAVLink system id, 1 to 254.
    SystemId,
    /// The earliest date that the clock believes, in days since 1970; 0 is the release's.
    DateFloor,
    /// GPS less UTC for a receiver that does not send it, in s; 0: it has to be proved.
    LeapSeconds,
    /// In an image with a load, what that is drawn from.
    LoadSeed,
}

impl Word {
    /// The firmware's name for it.
    const fn symbol(self) -> &'static str {
        match self {
            Self::SystemId => "PIXCLOCK_SYSTEM_ID",
            Self::DateFloor => "PIXCLOCK_DATE_FLOOR",
            Self::LeapSeconds => "PIXCLOCK_LEAP_SECONDS",
            Self::LoadSeed => "PIXCLOCK_LOAD_SEED",
        }
    }
}

/// The image `elf`, but that `word` has this value.
///
/// # Errors
///
/// `elf` is no ELF file, or has no such word.
pub fn with_word(elf: &[u8], word: Word, value: u32) -> anyhow::Result<Vec<u8>> {
    patched(elf, word_address(elf, word)?, &value.to_le_bytes())
}

/// Where `word` is in the board's memory.
///
/// # Errors
///
/// As for [`with_word`].
pub fn word_address(elf: &[u8], word: Word) -> anyhow::Result<u64> {
    let name = word.symbol();
    let file = object::File::parse(elf)?;
    let place = file
        .symbols()
        .find(|symbol| symbol.name() == Ok(name))
        .with_context(|| format!("the image has no word {name}"))?;
    ensure!(place.size() == 4, "{name} is no word");
    Ok(place.address())
}

/// The bytes that the flash holds from `start` on when the image `elf` is in it; 0xFF where the image
/// has gaps.
///
/// # Errors
///
/// `elf` is no ELF file, or stores something before `start` or more than `limit` bytes from there on.
pub fn flash_bytes(elf: &[u8], start: u64, limit: usize) -> anyhow::Result<Vec<u8>> {
    let file = object::File::parse(elf)?;
    let object::File::Elf32(file) = file else {
        bail!("the image is for another kind of processor");
    };
    let mut bytes = Vec::new();
    for segment in file.elf_program_headers() {
        let data = segment.data(file.endian(), file.data());
        let data = data.map_err(|()| anyhow!("the file is cut off"))?;
        if segment.p_type(file.endian()) != object::elf::PT_LOAD || data.is_empty() {
            continue;
        }
        let address = u64::from(segment.p_paddr(file.endian()));
        let offset = address
            .checked_sub(start)
            .and_then(|offset| usize::try_from(offset).ok());
        let offset = offset.with_context(|| {
            format!("{address:#x} is before the application's flash, which begins at {start:#x}")
        })?;
        let end = offset.saturating_add(data.len());
        ensure!(
            end <= limit,
            "the image is larger than the {limit} bytes of the flash"
        );
        bytes.resize(bytes.len().max(end), 0xFF);
        bytes[offset..end].copy_from_slice(data);
    }
    ensure!(!bytes.is_empty(), "the image stores nothing");
    Ok(bytes)
}

/// The bytes of the recording at `path`.
///
/// # Errors
///
/// When it cannot be read, or is none to read as a whole: a pipe or a device may have no end.
pub fn read_recording(path: &Path) -> anyhow::Result<Vec<u8>> {
    let name = path.display();
    let facts = std::fs::metadata(path).with_context(|| format!("cannot read {name}"))?;
    ensure!(
        facts.is_file(),
        "{name} is no file of bytes: a recording has an end"
    );
    std::fs::read(path).with_context(|| format!("cannot read {name}"))
}

/// GPS less UTC since 2017. [s]
const LEAP_SECONDS: u32 = 18;

/// The image `elf`, but with the clock's settings for a recording: no date before the day of
/// `began_utc_ns`, or before `floor_days` since 1970, is believed; and the leap count is configured
/// unless the recording `has_leap_seconds`.
///
/// # Errors
///
/// As for [`with_word`].
pub fn for_recording(
    elf: &[u8],
    began_utc_ns: Option<i64>,
    has_leap_seconds: bool,
    floor_days: Option<u32>,
) -> anyhow::Result<Vec<u8>> {
    const DAY_NS: i64 = 86_400_000_000_000;
    let began = began_utc_ns.and_then(|ns| u32::try_from(ns / DAY_NS).ok());
    let floor = floor_days.or(began).unwrap_or(0);
    let leap_seconds = if has_leap_seconds { 0 } else { LEAP_SECONDS };
    let elf = with_word(elf, Word::DateFloor, floor)?;
    with_word(&elf, Word::LeapSeconds, leap_seconds)
}

/// The image `elf`, but that `bytes` are at `address` of the memory it is loaded to.
///
/// # Errors
///
/// `elf` is no ELF file, or does not hold that place.
pub fn patched(elf: &[u8], address: u64, bytes: &[u8]) -> anyhow::Result<Vec<u8>> {
    let file = object::File::parse(elf)?;
    let place = file.sections().find_map(|section| {
        let (offset, size) = section.file_range()?;
        let inside = address.checked_sub(section.address())?;
        let is_whole = inside.checked_add(bytes.len() as u64)? <= size;
        // Sections that are not loaded, as debug information, have the address 0.
        (section.address() > 0 && is_whole).then_some(offset + inside)
    });
    let start = usize::try_from(place.with_context(|| format!("nothing stored at {address:#x}"))?)?;
    let mut elf = elf.to_vec();
    let old = elf.get_mut(start..start + bytes.len());
    old.context("the file is cut off")?.copy_from_slice(bytes);
    Ok(elf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_end_is_refused_at_once() {
        for path in ["/dev/zero", "/", "/nowhere.ubx"] {
            let error = read_recording(Path::new(path)).unwrap_err();
            assert!(error.to_string().contains(path), "{error}");
        }
    }
}
