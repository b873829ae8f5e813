//! A bootloader that takes uploads.
//!
//! *Purpose.* In place of a [`Bootloader`](crate::Bootloader) that does nothing but jump: a program of its
//! own, the crate `bootloader-stand-in`, which erases and programs the board's flash.
//!
//! *Limits.* The chip's one-time programmable memory is blank.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use rigless::image::Image;

use crate::flash::APPLICATION;

/// Names its ELF file; `cargo xtask board-test` sets it.
const VARIABLE: &str = "PIXCLOCK_BOOTLOADER";

/// Where the chip has its flash's size, in KB: what the bootloader asks it for (RM0090, chapter 39).
const FLASH_KB_AT: u32 = 0x1FFF_7A22;
const FLASH_KB: u16 = 2_048;

/// A bootloader that takes uploads.
#[derive(Clone, Debug)]
pub struct UploadBootloader {
    path: PathBuf,
    elf: Vec<u8>,
}

impl UploadBootloader {
    /// The one that the environment names; `None`, and a line on standard error about it, if it names
    /// none.
    ///
    /// # Errors
    ///
    /// It cannot be read.
    pub fn from_environment() -> anyhow::Result<Option<Self>> {
        let Some(path) = std::env::var_os(VARIABLE).map(PathBuf::from) else {
            eprintln!("SKIPPED: {VARIABLE} is not set; `cargo xtask board-test` sets it");
            return Ok(None);
        };
        let elf = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
        Ok(Some(Self { path, elf }))
    }

    /// What is in the memories of a board with this `application` behind it.
    pub(crate) fn flash(&self, application: Vec<u8>) -> anyhow::Result<Vec<Image>> {
        let raw = |name: &str, bytes, address: u32| {
            Image::new(Path::new(name), bytes, Some(address.into()))
        };
        let mut images = vec![
            Image::new(&self.path, self.elf.clone(), None)?,
            raw(
                "the flash's size",
                FLASH_KB.to_le_bytes().to_vec(),
                FLASH_KB_AT,
            )?,
        ];
        if !application.is_empty() {
            images.push(raw("the application", application, APPLICATION)?);
        }
        Ok(images)
    }
}
