//! `size`: what the image takes of flash and RAM.

use std::path::Path;

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, SectionFlags, SectionKind};

use crate::image::{self, Board, Variant};

/// The most that the image may take, in bytes.
const FLASH_LIMIT: u64 = 64 * 1024;
const RAM_LIMIT: u64 = 32 * 1024;

/// Bytes of an image.
#[derive(Clone, Copy, Debug, Default)]
pub struct Size {
    /// What is flashed: code, constants, first values of variables.
    pub flash: u64,
    /// Static variables, the rings and the log's buffer among them; not the stack.
    pub ram: u64,
}

/// Measures the image that is flashed and holds it against the limits.
///
/// # Errors
///
/// When it cannot be built or is too large.
pub fn check(json: bool) -> Result<()> {
    let size = measure(&image::build(Variant::standard(Board::Pixhawk1))?)?;
    if json {
        let value = serde_json::json!({
            "flash_bytes": size.flash, "flash_limit_bytes": FLASH_LIMIT,
            "ram_bytes": size.ram, "ram_limit_bytes": RAM_LIMIT,
        });
        println!("{value}");
    } else {
        println!("flash      {:>6} of {FLASH_LIMIT} bytes", size.flash);
        println!("static RAM {:>6} of {RAM_LIMIT} bytes", size.ram);
    }
    if size.flash > FLASH_LIMIT || size.ram > RAM_LIMIT {
        bail!("the image is larger than it may be");
    }
    Ok(())
}

/// The size of the image in `path`.
///
/// # Errors
///
/// When it is no ELF file.
pub fn measure(path: &Path) -> Result<Size> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let elf = object::File::parse(&*bytes)?;
    let mut size = Size::default();
    for section in elf.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else {
            continue;
        };
        if !sh_flags.contains(object::elf::SHF_ALLOC) {
            continue;
        }
        let zeroed = section.kind() == SectionKind::UninitializedData;
        let writable = sh_flags.contains(object::elf::SHF_WRITE);
        if !zeroed {
            size.flash += section.size();
        }
        if writable {
            size.ram += section.size();
        }
    }
    Ok(size)
}
