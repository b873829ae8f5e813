//! `size`: what the image takes of flash and RAM.

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind};

use crate::image::{self, Board, Build};

/// The most that the image may take, in bytes, with every receiver, link and upload in it.
const FLASH_LIMIT: u64 = 160 * 1024;
const RAM_LIMIT: u64 = 48 * 1024;

/// What STANAG 4586 on a line may take more, in bytes.
const STANAG_LIMIT: u64 = 8 * 1024;
/// The limit is not kept yet: more than this fails, so that it gets no worse.
const STANAG_FOR_NOW: u64 = 11 * 1024;
/// No symbol may have these in its name without the setting that brings it: STANAG 4586 on a line, and the synthetic
/// flight stack of `PIXCLOCK_LOAD`.
const ONLY_BY_SETTING: [&str; 4] = ["stanag", "flight_load", "firmware4load", "PIXCLOCK_LOAD"];

/// `RAM` of `memory.x`.
const COMMON_RAM: Range<u64> = 0x2000_0000..0x2002_0000;

/// Bytes of an image.
#[derive(Clone, Copy, Debug, Default)]
pub struct Size {
    /// What is flashed: code, constants, first values of variables.
    pub flash: u64,
    /// Static variables in the common RAM, the rings and the log's buffer among them; not the
    /// stack.
    pub ram: u64,
    /// What stands in the other memories (`memory.x`): the samples of a test.
    pub elsewhere: u64,
}

/// Measures the image that is flashed and holds it against the limits.
///
/// # Errors
///
/// When it cannot be built or is too large.
pub fn check(json: bool) -> Result<()> {
    let standard = Build::standard(Board::Pixhawk1);
    let image = image::build(standard)?;
    let size = measure(&image)?;
    ensure_plain(&image)?;
    let stanag = measure(&image::build(Build {
        stanag: true,
        ..standard
    })?)?;
    let stanag_more = stanag.flash.saturating_sub(size.flash);
    if json {
        let value = serde_json::json!({
            "flash_bytes": size.flash, "flash_limit_bytes": FLASH_LIMIT,
            "ram_bytes": size.ram, "ram_limit_bytes": RAM_LIMIT,
            "elsewhere_bytes": size.elsewhere,
            "stanag_bytes_more": stanag_more, "stanag_limit_bytes": STANAG_LIMIT,
        });
        console::print_line!("{value}");
    } else {
        console::print_line!(
            "flash      {:>6} of {FLASH_LIMIT} bytes{}",
            size.flash,
            mark(size.flash, FLASH_LIMIT)
        );
        console::print_line!(
            "static RAM {:>6} of {RAM_LIMIT} bytes{}",
            size.ram,
            mark(size.ram, RAM_LIMIT)
        );
        console::print_line!("samples    {:>6} bytes in CCM and SRAM3", size.elsewhere);
        console::print_line!(
            "STANAG     {stanag_more:>6} of {STANAG_LIMIT} bytes of flash more{}; none without",
            mark(stanag_more, STANAG_LIMIT)
        );
    }
    if size.flash > FLASH_LIMIT || size.ram > RAM_LIMIT {
        bail!("the image is larger than it may be");
    }
    if stanag_more > STANAG_FOR_NOW {
        bail!("the image with STANAG 4586 on a line is larger than it may be");
    }
    Ok(())
}

/// What stands behind a figure that is beyond its limit.
const fn mark(bytes: u64, limit: u64) -> &'static str {
    if bytes > limit { " !" } else { "" }
}

/// Nothing of what a setting brings may be in an image without it.
fn ensure_plain(path: &Path) -> Result<()> {
    let bytes = std::fs::read(path)?;
    let elf = object::File::parse(&*bytes)?;
    let mut names = elf.symbols().filter_map(|symbol| symbol.name().ok());
    let is_extra = |name: &&str| ONLY_BY_SETTING.iter().any(|part| name.contains(part));
    if let Some(name) = names.find(is_extra) {
        bail!("{name} is in an image that is built without its setting");
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
        if writable && COMMON_RAM.contains(&section.address()) {
            size.ram += section.size();
        } else if writable {
            size.elsewhere += section.size();
        }
    }
    Ok(size)
}
