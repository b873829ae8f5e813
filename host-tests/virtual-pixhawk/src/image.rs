//! The image that is flashed.
//!
//! *Purpose.* [`Firmware`]: the ELF file that probe-rs would flash, its bytes for
//! the board's memory and its symbols for reading that memory.
//!
//! *Design.* The application is linked at 0x0800_4000, behind a bootloader; a
//! [`Bootloader`] stands in for that one. The check that leads it to its decision to
//! boot is made here: a first word that is erased, or a reset vector outside the
//! application's flash, would leave the real one waiting for an upload, and is
//! refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use console::Word;
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};
use rigless::image::Image;
use world::Recording;

use crate::bootloader::Bootloader;
use crate::flash::{APPLICATION, APPLICATION_MAX, FLASH};

/// Names the image that tests run, the one that is flashed; `cargo xtask board-test`
/// sets it.
pub const IMAGE_VARIABLE: &str = "PIXCLOCK_IMAGE";

/// A place in the board's memory that the image has a name for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Its address; for a function that of its first instruction.
    pub address: u32,
    /// Its size in bytes.
    pub size: u32,
}

/// The firmware as it is flashed.
#[derive(Clone, Debug)]
pub struct Firmware {
    path: PathBuf,
    elf: Vec<u8>,
    vectors: Vec<u32>,
    symbols: BTreeMap<String, Symbol>,
}

impl Firmware {
    /// Reads the ELF file at `path`.
    ///
    /// # Errors
    ///
    /// It cannot be read, is no ELF file, or is none that the bootloader would
    /// boot.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let elf = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
        Self::parse(path, elf).with_context(|| format!("in {}", path.display()))
    }

    /// The image that the environment names in `variable`; `None`, and a line on
    /// standard error about it, if it names none.
    ///
    /// # Errors
    ///
    /// As for [`Firmware::read`].
    pub fn from_variable(variable: &str) -> anyhow::Result<Option<Self>> {
        let Some(path) = std::env::var_os(variable) else {
            eprintln!("SKIPPED: {variable} is not set; `cargo xtask board-test` sets it");
            return Ok(None);
        };
        Self::read(Path::new(&path)).map(Some)
    }

    fn parse(path: &Path, elf: Vec<u8>) -> anyhow::Result<Self> {
        let file = object::File::parse(&*elf)?;
        let table = file
            .section_by_name(".vector_table")
            .context("it has no vector table")?;
        ensure!(
            table.address() == u64::from(APPLICATION),
            "it is linked at {:#x}; behind the bootloader is {APPLICATION:#x}",
            table.address()
        );
        let words = table.data()?.as_chunks::<4>().0;
        let vectors = words.iter().copied().map(u32::from_le_bytes).collect();
        let symbols = file
            .symbols()
            .filter(object::ObjectSymbol::is_definition)
            .filter_map(|symbol| {
                let name = symbol.name().ok()?;
                // Bit 0 of a function's address means Thumb.
                let thumb = u64::from(symbol.kind() == object::SymbolKind::Text);
                let place = Symbol {
                    address: u32::try_from(symbol.address() & !thumb).ok()?,
                    size: u32::try_from(symbol.size()).ok()?,
                };
                Some((demangled(name), place))
            })
            .collect();
        let firmware = Self {
            path: path.to_owned(),
            vectors,
            symbols,
            elf,
        };
        firmware.check_as_the_bootloader_does()?;
        Ok(firmware)
    }

    fn check_as_the_bootloader_does(&self) -> anyhow::Result<()> {
        let (Some(sp), Some(reset)) = (self.vector(0), self.vector(1)) else {
            bail!("its vector table has no reset vector");
        };
        let flash = APPLICATION..APPLICATION + APPLICATION_MAX;
        ensure!(
            sp != u32::MAX && flash.contains(&reset),
            "the bootloader would not boot it: its first words are {sp:#010x} {reset:#010x}"
        );
        Ok(())
    }

    /// The same image, but that the function `name` begins with `instruction`.
    ///
    /// # Errors
    ///
    /// As for [`Firmware::symbol`]; or it is no function whose code is in the file.
    pub fn with_instruction(&self, name: &str, instruction: u16) -> anyhow::Result<Self> {
        let Symbol { address, size } = self.symbol(name)?;
        ensure!(size >= 2, "{name} is no function");
        let elf = console::patched(&self.elf, address.into(), &instruction.to_le_bytes())?;
        Self::parse(&self.path, elf)
    }

    /// The same image, but that `word` has this value: these words differ between virtual boards,
    /// and from what is flashed.
    ///
    /// # Errors
    ///
    /// The image has no such word.
    pub fn with_word(&self, word: Word, value: u32) -> anyhow::Result<Self> {
        Self::parse(&self.path, console::with_word(&self.elf, word, value)?)
    }

    /// The same image for a board that is played `recording`: its date floor is no later than the
    /// recording, or `floor_days` since 1970, and the leap count is configured where the recording
    /// does not say it.
    ///
    /// # Errors
    ///
    /// The image has no such words.
    pub fn for_recording(
        &self,
        recording: &Recording,
        floor_days: Option<u32>,
    ) -> anyhow::Result<Self> {
        let elf = console::for_recording(
            &self.elf,
            recording.began_utc_ns(),
            recording.has_leap_seconds(),
            floor_days,
        )?;
        Self::parse(&self.path, elf)
    }

    /// The whole ELF file.
    #[must_use]
    pub fn elf(&self) -> &[u8] {
        &self.elf
    }

    /// Word `number` of the application's vector table; 0 is the initial stack
    /// pointer.
    #[must_use]
    pub fn vector(&self, number: u16) -> Option<u32> {
        self.vectors.get(usize::from(number)).copied()
    }

    /// The place called `name`: the whole demangled path, or the end of one after
    /// a `::`.
    ///
    /// # Errors
    ///
    /// No symbol is called that, or several are.
    pub fn symbol(&self, name: &str) -> anyhow::Result<Symbol> {
        if let Some(&symbol) = self.symbols.get(name) {
            return Ok(symbol);
        }
        let ending = format!("::{name}");
        let mut found = self
            .symbols
            .iter()
            .filter(|(path, _)| path.ends_with(&ending));
        let (path, &symbol) = found
            .next()
            .with_context(|| format!("the image has no symbol {name}"))?;
        if let Some((other, _)) = found.next() {
            bail!("{name} can be {path} and {other}");
        }
        Ok(symbol)
    }

    /// Every symbol with its demangled path.
    pub fn symbols(&self) -> impl Iterator<Item = (&str, Symbol)> {
        self.symbols
            .iter()
            .map(|(name, &place)| (name.as_str(), place))
    }

    /// The function that the instruction at `address` belongs to.
    #[must_use]
    pub fn function_at(&self, address: u32) -> Option<&str> {
        self.symbols
            .iter()
            .find(|(_, place)| (place.address..place.address + place.size).contains(&address))
            .map(|(name, _)| name.as_str())
    }

    /// Its bytes in the flash, from the place behind the bootloader on.
    ///
    /// # Errors
    ///
    /// It stores something elsewhere.
    pub fn application(&self) -> anyhow::Result<Vec<u8>> {
        console::flash_bytes(&self.elf, APPLICATION.into(), APPLICATION_MAX as usize)
    }

    /// What a probe would have put into the flash, behind `bootloader`.
    pub(crate) fn flash(&self, bootloader: Bootloader) -> anyhow::Result<Vec<Image>> {
        Ok(vec![
            Image::new(
                Path::new("stand-in for the bootloader"),
                bootloader.bytes(),
                Some(u64::from(FLASH)),
            )?,
            // An ELF file states where its sections are stored.
            Image::new(&self.path, self.elf.clone(), None)?,
        ])
    }
}

/// The path that was compiled to `name`. The number that the compiler appends to
/// each part of a static that it has split is kept.
fn demangled(name: &str) -> String {
    let path = format!("{:#}", rustc_demangle::demangle(name));
    match name.rsplit_once('.') {
        Some((_, part)) if part.parse::<u32>().is_ok() && !path.ends_with(part) => {
            format!("{path}.{part}")
        }
        _ => path,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_a_split_static_keep_their_numbers() {
        let name = "_RNvNtNtCs1vurH30szMG_8firmware7drivers4time5WORDS";
        assert_eq!(demangled(name), "firmware::drivers::time::WORDS");
        let part = format!("{name}.2");
        assert_eq!(demangled(&part), "firmware::drivers::time::WORDS.2");
        assert_eq!(demangled("SysTick"), "SysTick");
    }
}
