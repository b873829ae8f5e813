//! A card in memory with some of its blocks changed, under the eyes of a judge.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use card_file::{BLOCK, Disk, DiskError, NotSaved};
use fat_image::{Block, Foreign};

use super::specimens::Specimen;
use crate::card::made;

/// The card as it is now.
pub struct Overlay<'a> {
    specimen: &'a Specimen,
    changed: BTreeMap<u32, Block>,
    writes_left: u64,
    /// The first write that the judge refused.
    pub foreign: Option<Foreign>,
    pub written: u64,
}

/// What came of a file on a card.
pub enum Outcome {
    Saved,
    Refused(NotSaved),
    Panicked,
}

impl<'a> Overlay<'a> {
    pub const fn new(specimen: &'a Specimen) -> Self {
        Self {
            specimen,
            changed: BTreeMap::new(),
            writes_left: u64::MAX,
            foreign: None,
            written: 0,
        }
    }

    /// Has it lose its power after that many blocks that it takes.
    pub const fn cut_after(mut self, writes: u64) -> Self {
        self.writes_left = writes;
        self
    }

    /// Gives it power again.
    pub const fn powered(&mut self) {
        self.writes_left = u64::MAX;
    }

    pub fn block(&self, number: u32) -> Option<Block> {
        let at = number as usize * BLOCK;
        let stored = || self.specimen.image.get(at..at + BLOCK)?.try_into().ok();
        self.changed.get(&number).copied().or_else(stored)
    }

    /// Changes a block from outside.
    pub fn damage(&mut self, number: u32, act: impl FnOnce(&mut Block)) {
        if let Some(mut block) = self.block(number) {
            act(&mut block);
            self.changed.insert(number, block);
        }
    }

    /// All that it holds.
    pub fn image(&self) -> Vec<u8> {
        let mut image = self.specimen.image.clone();
        for (number, block) in &self.changed {
            image[*number as usize * BLOCK..][..BLOCK].copy_from_slice(block);
        }
        image
    }

    /// Has the board's code write `file` to it.
    pub fn save(&mut self, file: &[u8]) -> Outcome {
        let mut read = made::reader(file);
        let len = file.len() as u32;
        let saved = catch_unwind(AssertUnwindSafe(|| {
            card_file::save(self, len, &mut read, None)
        }));
        match saved {
            Ok(Ok(_)) => Outcome::Saved,
            Ok(Err(why)) => Outcome::Refused(why),
            Err(_) => Outcome::Panicked,
        }
    }
}

impl Outcome {
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Saved => "saved",
            Self::Refused(why) => why.word(),
            Self::Panicked => "PANIC",
        }
    }
}

impl Disk for Overlay<'_> {
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError> {
        *block = self.block(number).ok_or(DiskError::Beyond)?;
        Ok(())
    }

    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError> {
        let old = self.block(number).ok_or(DiskError::Beyond)?;
        self.writes_left = self.writes_left.checked_sub(1).ok_or(DiskError::Gone)?;
        self.written += 1;
        if let Err(foreign) = self.specimen.census.judge(number, &old, block) {
            self.foreign.get_or_insert(foreign);
        }
        self.changed.insert(number, *block);
        Ok(())
    }

    fn blocks(&self) -> u32 {
        (self.specimen.image.len() / BLOCK) as u32
    }
}
