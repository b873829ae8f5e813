//! Words of an image that are written after it is built.
//!
//! *Purpose.* Boards on one network need different system ids, and none of them another build:
//! [`with_system_id`] writes the one word of an ELF file that differs from board to board.
//!
//! *Design.* The firmware has the word as `PIXCLOCK_SYSTEM_ID` and reads it at run time.
//!
//! *Limits.* Only what the file holds can be written, not what the firmware makes at its start.

use anyhow::{Context as _, ensure};
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};

/// The firmware's name for the word that holds its MAVLink system id.
const SYSTEM_ID: &str = "PIXCLOCK_SYSTEM_ID";

/// The image `elf`, but that its board is MAVLink system `id`.
///
/// # Errors
///
/// `elf` is no ELF file, or has no such word.
pub fn with_system_id(elf: &[u8], id: u8) -> anyhow::Result<Vec<u8>> {
    let file = object::File::parse(elf)?;
    let word = file
        .symbols()
        .find(|symbol| symbol.name() == Ok(SYSTEM_ID))
        .with_context(|| format!("the image has no word {SYSTEM_ID}"))?;
    ensure!(word.size() == 4, "{SYSTEM_ID} is no word");
    patched(elf, word.address(), &u32::from(id).to_le_bytes())
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
