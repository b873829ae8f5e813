//! Where on a card a volume may be.
//!
//! *Design.* A place is judged by the boot record that it begins with, and not by the type that a
//! table gives it: the entries of a master boot record, those of a GUID table, then block 0 itself,
//! for a card without any table. Partitions for a computer's firmware (EFI) come last, because
//! computers hide them. A GUID table that was made over a volume which is a little longer, up to the
//! table's copy at the card's end, is right about what is the volume's: its partition cuts it. If there is no usable volume, the reason that says most is returned.
//!
//! *Limits.* Logical drives in an extended partition are not looked for.

use crate::bytes::{Block, byte, is_signed, word};
use crate::disk::{BLOCK, Disk};
use crate::not_saved::NotSaved;
use crate::stretch::Stretch;
use crate::volume::Volume;

/// Types of a master boot record's entries.
const EXTENDED: [u32; 3] = [0x05, 0x0F, 0x85];
const GUID_TABLE: u32 = 0xEE;
const EFI: u32 = 0xEF;

/// Bytes of an entry in a GUID table; tables with longer ones are not in use.
const GUID_ENTRY: usize = 128;

/// The first usable volume.
///
/// # Errors
///
/// Why there is none.
pub(crate) fn find(disk: &mut dyn Disk) -> Result<Volume, NotSaved> {
    let mut record = [0; BLOCK];
    disk.read(0, &mut record)?;
    let mut search = Search {
        disk,
        why: NotSaved::NoFileSystem,
    };
    if is_signed(&record) {
        for of_efi in [false, true] {
            if let Some(volume) = search.in_record(&record, of_efi)? {
                return Ok(volume);
            }
        }
    }
    let whole = Stretch {
        first: 0,
        blocks: search.disk.blocks(),
    };
    let volume = search.at(whole, false)?;
    volume.ok_or(search.why)
}

struct Search<'a> {
    disk: &'a mut dyn Disk,
    /// The reason that says most, so far.
    why: NotSaved,
}

impl Search<'_> {
    /// The volume that begins there, if it can be used; with `is_cut`, as far as its place goes.
    fn at(&mut self, place: Stretch, is_cut: bool) -> Result<Option<Volume>, NotSaved> {
        match Volume::at(self.disk, place, is_cut) {
            Ok(volume) => Ok(Some(volume)),
            Err(why) if why.is_of_the_card() => Err(why),
            Err(why) => {
                if why.weight() > self.why.weight() {
                    self.why = why;
                }
                Ok(None)
            }
        }
    }

    fn in_record(&mut self, record: &Block, of_efi: bool) -> Result<Option<Volume>, NotSaved> {
        for index in 0..4 {
            let (kind, place) = entry(record, index);
            let found = match kind {
                GUID_TABLE => self.in_guid_table(of_efi)?,
                _ if place.first == 0 || EXTENDED.contains(&kind) || of_efi != (kind == EFI) => {
                    None
                }
                _ => self.at(place, false)?,
            };
            let Some(volume) = found else { continue };
            if is_alone(record, index, volume.stretch()) {
                return Ok(Some(volume));
            }
            self.why = NotSaved::Beyond;
        }
        Ok(None)
    }

    fn in_guid_table(&mut self, of_efi: bool) -> Result<Option<Volume>, NotSaved> {
        /// The type's first word, of a partition for a computer's firmware.
        const EFI_WORD: u32 = 0xC12A_7328;
        /// The most entries that are looked at; every tool makes this many.
        const ENTRIES: u32 = 128;
        let mut block = [0; BLOCK];
        self.disk.read(1, &mut block)?;
        let is_header = block.starts_with(b"EFI PART") && word(&block, 84) == GUID_ENTRY as u32;
        let (table, above, count) = (word(&block, 72), word(&block, 76), word(&block, 80));
        if !is_header || above != 0 {
            return Ok(None);
        }
        let per_block = (BLOCK / GUID_ENTRY) as u32;
        for index in 0..count.min(ENTRIES) {
            let number = table.saturating_add(index / per_block);
            if number >= self.disk.blocks() {
                break;
            }
            self.disk.read(number, &mut block)?;
            let at = (index % per_block) as usize * GUID_ENTRY;
            let (kind, first, last) = (
                word(&block, at),
                word(&block, at + 32),
                word(&block, at + 40),
            );
            let beyond = word(&block, at + 36) | word(&block, at + 44);
            let blocks = last.saturating_sub(first).saturating_add(1);
            let is_one = first > 1 && last >= first && beyond == 0;
            if is_one
                && of_efi == (kind == EFI_WORD)
                && let Some(volume) = self.at(Stretch { first, blocks }, true)?
            {
                return Ok(Some(volume));
            }
        }
        Ok(None)
    }
}

/// The type and the place of an entry of a master boot record.
fn entry(record: &Block, index: usize) -> (u32, Stretch) {
    let at = 446 + 16 * index;
    let place = Stretch {
        first: word(record, at + 8),
        blocks: word(record, at + 12),
    };
    (byte(record, at + 4), place)
}

/// Whether no other entry of the record has blocks of the volume that entry `index` has.
fn is_alone(record: &Block, index: usize, volume: Stretch) -> bool {
    (0..4).filter(|&other| other != index).all(|other| {
        let (kind, place) = entry(record, other);
        // What is no entry, as in the code that stands there on a card without a table.
        let is_none = kind == 0 || byte(record, 446 + 16 * other) & 0x7F != 0;
        is_none || kind == GUID_TABLE || place.first == 0 || !place.overlaps(volume)
    })
}
