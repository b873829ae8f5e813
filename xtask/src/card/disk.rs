//! A card's image, or a card in a reader, as the board's code sees a card.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use anyhow::{Context, Result, bail};
use card_file::{BLOCK, Disk, DiskError};

/// A file of blocks.
pub struct ImageDisk {
    file: File,
    blocks: u32,
    is_read_only: bool,
    error: Option<io::Error>,
}

impl ImageDisk {
    /// Opens it; to write, only a file that is an image.
    ///
    /// # Errors
    ///
    /// There is none, or it is a device that would be written.
    pub fn open(path: &Path, for_writing: bool) -> Result<Self> {
        if for_writing && Self::is_device(path) {
            bail!("{} is a device: only an image is written", path.display());
        }
        let mut is_read_only = !for_writing;
        let opened = OpenOptions::new().read(true).write(for_writing).open(path);
        let mut file = match opened {
            Err(error) if for_writing && error.kind() == ErrorKind::PermissionDenied => {
                is_read_only = true;
                File::open(path)?
            }
            other => other?,
        };
        // A device's metadata has no length.
        let bytes = file.seek(SeekFrom::End(0)).context("it has no length")?;
        Ok(Self {
            file,
            blocks: u32::try_from(bytes / BLOCK as u64).unwrap_or(u32::MAX),
            is_read_only,
            error: None,
        })
    }

    /// Whether it is there and no ordinary file.
    pub fn is_device(path: &Path) -> bool {
        std::fs::metadata(path).is_ok_and(|data| !data.is_file() && !data.is_dir())
    }

    /// Whether it can only be read.
    pub const fn is_read_only(&self) -> bool {
        self.is_read_only
    }

    /// What the system said when a block failed.
    pub const fn take_error(&mut self) -> Option<io::Error> {
        self.error.take()
    }

    fn at(
        &mut self,
        number: u32,
        act: impl FnOnce(&mut File) -> io::Result<()>,
    ) -> Result<(), DiskError> {
        if number >= self.blocks {
            return Err(DiskError::Beyond);
        }
        let place = SeekFrom::Start(u64::from(number) * BLOCK as u64);
        let done = self.file.seek(place).and_then(|_| act(&mut self.file));
        done.map_err(|error| {
            self.error = Some(error);
            DiskError::Failed
        })
    }
}

impl Disk for ImageDisk {
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError> {
        self.at(number, |file| file.read_exact(block))
    }

    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError> {
        if self.is_read_only {
            return Err(DiskError::WriteProtected);
        }
        self.at(number, |file| file.write_all(block))
    }

    fn blocks(&self) -> u32 {
        self.blocks
    }
}
