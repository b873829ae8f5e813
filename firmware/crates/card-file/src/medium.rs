//! The disk as `embedded-sdmmc` uses it.
//!
//! *Design.* Three guards against what the library does not exclude. The number of blocks is
//! limited, because a damaged chain of clusters may have no end. Nothing is written outside of the
//! volume. And every access after the first failure fails too, because at some places the library
//! takes a failure for a full or an empty card, and would try to repair a card that is gone.

use core::cell::{Cell, RefCell};
use core::fmt;

use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};

use crate::disk::{Disk, DiskError};
use crate::volume::Volume;

/// The most blocks that may be read and written for one file: 16 times what 8 192 samples need with
/// the smallest clusters.
const BLOCKS_MAX: u32 = 131_072;

/// Why the file system was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    /// The disk failed.
    Disk(DiskError),
    /// The file system needed too many blocks, or one outside of its volume.
    Damaged,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Disk(error) => error.fmt(f),
            Self::Damaged => f.pad("the file system is damaged"),
        }
    }
}

impl core::error::Error for Failure {}

/// A disk with a volume, while one file is written.
pub(crate) struct Medium<'a> {
    disk: RefCell<&'a mut dyn Disk>,
    volume: Volume,
    blocks_left: Cell<u32>,
    failure: Cell<Option<Failure>>,
}

impl<'a> Medium<'a> {
    /// `volume` on `disk`.
    pub(crate) const fn new(disk: &'a mut dyn Disk, volume: Volume) -> Self {
        Self {
            disk: RefCell::new(disk),
            volume,
            blocks_left: Cell::new(BLOCKS_MAX),
            failure: Cell::new(None),
        }
    }

    /// The first failure, if there was one.
    pub(crate) fn failure(&self) -> Option<Failure> {
        self.failure.get()
    }

    /// Reads or writes a block, unless something has failed before.
    fn act(
        &self,
        is_allowed: bool,
        act: impl FnOnce(&mut dyn Disk) -> Result<(), DiskError>,
    ) -> Result<(), Failure> {
        if let Some(failure) = self.failure.get() {
            return Err(failure);
        }
        let left = self.blocks_left.get();
        self.blocks_left.set(left.saturating_sub(1));
        let result = match self.disk.try_borrow_mut() {
            Ok(mut disk) if is_allowed && left > 0 => act(*disk).map_err(Failure::Disk),
            _ => Err(Failure::Damaged),
        };
        self.failure.set(result.err());
        result
    }
}

impl BlockDevice for Medium<'_> {
    type Error = Failure;

    fn read(&self, blocks: &mut [Block], first: BlockIdx) -> Result<(), Failure> {
        for (number, block) in (first.0..).zip(blocks) {
            self.act(true, |disk| disk.read(number, block))?;
            self.volume.without_hint(number, block);
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], first: BlockIdx) -> Result<(), Failure> {
        for (number, block) in (first.0..).zip(blocks) {
            self.act(self.volume.contains(number), |disk| {
                disk.write(number, block)
            })?;
        }
        Ok(())
    }

    fn num_blocks(&self) -> Result<BlockCount, Failure> {
        Ok(BlockCount(self.disk.borrow().blocks()))
    }
}
