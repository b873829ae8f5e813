//! The image that is flashed, and the stand-in for the bootloader before it.
//!
//! *Purpose.* [`Firmware`]: the ELF file that probe-rs would flash, its bytes for
//! the board's memory and its symbols for reading that memory.
//!
//! *Design.* The application is linked at 0x0800_4000, behind the bootloader of
//! PX4. In place of that bootloader stand two vectors, an initial stack pointer
//! and a reset vector, and the seven instructions that the reset vector points to.
//! They do what is left of PX4's bootloader once it has decided to boot: VTOR is
//! set to the application, its first word is loaded into SP, and its second is
//! jumped to. The check that leads to that decision is made here: a first word that
//! is erased, or a reset vector outside the application's flash, would leave the
//! real one waiting for an upload, and is refused.
//!
//! *Limits.* The real bootloader waits, blinks and starts clocks before, and puts
//! them back; of that nothing is to be seen here.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use console::Word;
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};
use rigless::image::Image;
use world::Recording;

/// Names the image that tests run, the one that is flashed; `cargo xtask board-test`
/// sets it.
pub const IMAGE_VARIABLE: &str = "PIXCLOCK_IMAGE";

/// Where the bootloader is, and where the application begins behind it.
const FLASH: u32 = 0x0800_0000;
pub(crate) const APPLICATION: u32 = FLASH + 0x4000;
/// The most that an application may be, in bytes (PX4-Bootloader, board id 9).
pub(crate) const APPLICATION_MAX: u32 = 1_008 * 1_024;
/// A stack for the stand-in, which uses none: the end of the first SRAM.
const STAND_IN_SP: u32 = 0x2001_C000;

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
    /// does not tell it.
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
            recording.tells_leap_seconds(),
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

    /// What a probe would have put into the flash.
    pub(crate) fn flash(&self) -> anyhow::Result<[Image; 2]> {
        Ok([
            Image::new(
                Path::new("stand-in for the bootloader"),
                bootloader_stand_in(),
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

/// Two vectors, seven instructions, two constants.
fn bootloader_stand_in() -> Vec<u8> {
    const VTOR: u32 = 0xE000_ED08;
    const CODE: [u16; 8] = [
        0x4803, // ldr  r0, =VTOR
        0x4904, // ldr  r1, =APPLICATION
        0x6001, // str  r1, [r0]
        0x680A, // ldr  r2, [r1, #0]
        0x4695, // mov  sp, r2
        0x684A, // ldr  r2, [r1, #4]
        0x4710, // bx   r2
        0xBF00, // nop, so that the constants are aligned
    ];
    const RESET: u32 = FLASH + 8;
    let mut bytes = Vec::new();
    bytes.extend(
        [STAND_IN_SP, RESET | 1]
            .map(u32::to_le_bytes)
            .as_flattened(),
    );
    bytes.extend(CODE.map(u16::to_le_bytes).as_flattened());
    bytes.extend([VTOR, APPLICATION].map(u32::to_le_bytes).as_flattened());
    bytes
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

    #[test]
    fn the_stand_in_is_two_vectors_and_what_the_second_points_to() {
        let bytes = bootloader_stand_in();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!(bytes.len(), 32);
        assert_eq!((word(0), word(4)), (STAND_IN_SP, 0x0800_0009));
        // The two constants lie where the first two instructions look for them.
        let literal = |at: usize| ((at + 4) & !3) + 4 * usize::from(bytes[at]);
        assert_eq!(word(literal(8)), 0xE000_ED08);
        assert_eq!(word(literal(10)), APPLICATION);
    }
}
