//! The card as `embedded-sdmmc` sees it.
//!
//! *Design.* Between the file system and the card stands what the library does not promise: a chain
//! that goes round for ever ends with the number of blocks; nothing is written outside the volume;
//! and the first failure stays, because the library takes a failure at some places for a full or
//! an empty card, and would try to put things in order on a card that is gone.

use core::cell::{Cell, RefCell};
use core::fmt;

use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};

use super::volume::Volume;
use crate::drivers::card::{Card, CardError};

/// So many blocks may be read and written for one file: 16 times what 8 192 samples take with the
/// smallest clusters.
const BLOCKS_MAX: u32 = 131_072;

/// Why the file system was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The card failed.
    Card(CardError),
    /// It went round in circles, or out of its volume.
    Damaged,
}

impl fmt::Display for Failure {
    fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Nobody prints it; the trait asks for it.
        Ok(())
    }
}

impl core::error::Error for Failure {}

/// A card with a volume, for one file.
pub struct Medium<'a> {
    card: RefCell<&'a mut Card>,
    volume: Volume,
    blocks_left: Cell<u32>,
    failure: Cell<Option<Failure>>,
}

impl<'a> Medium<'a> {
    /// `volume` on `card`.
    pub const fn new(card: &'a mut Card, volume: Volume) -> Self {
        Self {
            card: RefCell::new(card),
            volume,
            blocks_left: Cell::new(BLOCKS_MAX),
            failure: Cell::new(None),
        }
    }

    /// What stopped it, if something did.
    pub fn failure(&self) -> Option<Failure> {
        self.failure.get()
    }

    /// Moves a block, unless something has failed before.
    fn act(
        &self,
        is_allowed: bool,
        act: impl FnOnce(&mut Card) -> Result<(), CardError>,
    ) -> Result<(), Failure> {
        if let Some(failure) = self.failure.get() {
            return Err(failure);
        }
        let left = self.blocks_left.get();
        self.blocks_left.set(left.saturating_sub(1));
        let result = match self.card.try_borrow_mut() {
            Ok(mut card) if is_allowed && left > 0 => act(&mut card).map_err(Failure::Card),
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
            self.act(true, |card| card.read(number, block))?;
            self.volume.without_hint(number, block);
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], first: BlockIdx) -> Result<(), Failure> {
        for (number, block) in (first.0..).zip(blocks) {
            self.act(self.volume.contains(number), |card| {
                card.write(number, block)
            })?;
        }
        Ok(())
    }

    fn num_blocks(&self) -> Result<BlockCount, Failure> {
        Ok(BlockCount(self.card.borrow().blocks()))
    }
}
