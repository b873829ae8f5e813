//! The file on images that another library formats and reads: contents, numbers, room, cards that
//! fail at any block, and images that are damaged anywhere.

use card_file::{BLOCK, Disk, DiskError, NotSaved, save};
use fat_image::{FIRST, Kind};
use proptest::prelude::*;
use timebase::CivilTime;

/// A card in memory that is gone after a number of blocks.
struct RamDisk {
    image: Vec<u8>,
    blocks_left: u64,
    error: DiskError,
    first_written: usize,
}

impl RamDisk {
    fn new(image: Vec<u8>) -> Self {
        Self {
            image,
            blocks_left: u64::MAX,
            error: DiskError::Gone,
            first_written: usize::MAX,
        }
    }

    fn block(&mut self, number: u32) -> Result<&mut [u8], DiskError> {
        self.blocks_left = self.blocks_left.checked_sub(1).ok_or(self.error)?;
        let at = number as usize * BLOCK;
        self.image.get_mut(at..at + BLOCK).ok_or(DiskError::Beyond)
    }
}

impl Disk for RamDisk {
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError> {
        block.copy_from_slice(self.block(number)?);
        Ok(())
    }

    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError> {
        self.block(number)?.copy_from_slice(block);
        self.first_written = self.first_written.min(number as usize);
        Ok(())
    }

    fn blocks(&self) -> u32 {
        (self.image.len() / BLOCK) as u32
    }
}

/// The contents of a file of `len` bytes.
fn contents(len: u32) -> Vec<u8> {
    (0..len).map(|at| (at % 251) as u8).collect()
}

fn save_on(disk: &mut RamDisk, len: u32) -> Result<u16, NotSaved> {
    let all = contents(len);
    let mut read = |offset: u32, out: &mut [u8]| {
        let rest = &all[offset as usize..];
        let count = rest.len().min(out.len());
        out[..count].copy_from_slice(&rest[..count]);
        count
    };
    let written = CivilTime {
        year: 2026,
        month: 2,
        day: 28,
        hour: 23,
        minute: 59,
        second: 60,
        nano: 0,
    };
    save(disk, len, &mut read, Some(written))
}

#[test]
fn files_of_any_length_are_there_in_full() {
    for kind in [Kind::Fat16, Kind::Fat32] {
        let mut disk = RamDisk::new(fat_image::formatted(kind));
        let lengths = [0, 1, 511, 512, 513, 1_024, 40_000, 548_931];
        for (number, len) in (1..).zip(lengths) {
            assert_eq!(save_on(&mut disk, len), Ok(number));
        }
        let files = fat_image::files(&disk.image);
        assert_eq!(files.len(), lengths.len());
        for (file, len) in files.values().zip(lengths) {
            assert!(file.contents == contents(len), "{len} bytes");
            let date = file.modified.date;
            assert_eq!((date.year, date.month, date.day), (2026, 2, 28));
        }
    }
}

#[test]
fn a_number_is_never_given_twice_and_behind_the_last_one_come_those_left_out() {
    let mut image = fat_image::formatted(Kind::Fat32);
    for name in ["TEST0001.CSV", "TEST0003.CSV", "TEST9998.CSV"] {
        fat_image::put(&mut image, name, 10);
    }
    let mut disk = RamDisk::new(image);
    for number in [9_999, 2, 4, 5] {
        assert_eq!(save_on(&mut disk, 10), Ok(number));
    }
}

/// Puts a GUID table with one partition over a card's master boot record.
fn with_guid_table(image: &mut [u8], last: u32) {
    let put = |image: &mut [u8], block: usize, at: usize, bytes: &[u8]| {
        image[block * BLOCK + at..][..bytes.len()].copy_from_slice(bytes);
    };
    image[446..510].fill(0);
    put(image, 0, 450, &[0xEE]);
    put(image, 0, 454, &[1, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
    put(image, 1, 0, b"EFI PART");
    put(image, 1, 72, &2_u64.to_le_bytes());
    put(image, 1, 80, &[128, 0, 0, 0, 128, 0, 0, 0]);
    put(image, 2, 0, &[0xA2, 0xA0, 0xD0, 0xEB]);
    put(image, 2, 32, &(FIRST as u64).to_le_bytes());
    put(image, 2, 40, &u64::from(last).to_le_bytes());
}

#[test]
fn a_partition_of_a_guid_table_cuts_a_volume_that_is_longer() {
    let whole = fat_image::formatted(Kind::Fat32);
    let blocks = (whole.len() / BLOCK) as u32;
    let last = blocks - 2_100;
    let mut disk = RamDisk::new(whole);
    with_guid_table(&mut disk.image, last);
    let behind = (last as usize + 1) * BLOCK;
    disk.image[behind..].fill(0xA5);
    let before = disk.image.clone();
    assert_eq!(save_on(&mut disk, 40_000), Ok(1));
    assert!(disk.image[behind..] == before[behind..]);
    // All of what is inside, and nothing more.
    let mut saved = 1;
    while save_on(&mut disk, 4_000_000).is_ok() {
        saved += 1;
    }
    assert!(saved > 2, "{saved}");
    while save_on(&mut disk, 4_000).is_ok() {}
    assert_eq!(save_on(&mut disk, 4_000), Err(NotSaved::NoRoom));
    assert!(disk.image[behind..] == before[behind..]);
    // One that has no room for the tables, or a volume that is longer than the card, is refused.
    for (blocks_of_it, cut) in [(9, 0), (2_000, 4_000)] {
        let mut image = before.clone();
        with_guid_table(&mut image, FIRST as u32 + blocks_of_it);
        image.truncate(image.len() - cut * BLOCK);
        let mut disk = RamDisk::new(image);
        assert_eq!(save_on(&mut disk, 4_000), Err(NotSaved::Beyond));
        assert_eq!(disk.first_written, usize::MAX);
    }
}

/// A card with `free` bytes free, at its beginning, and a hint at its end.
fn nearly_full(kind: Kind, free: usize) -> Vec<u8> {
    let mut image = fat_image::formatted(kind);
    fat_image::put(&mut image, "first.bin", free);
    let all = fat_image::free_bytes(&mut image);
    fat_image::put(&mut image, "rest.bin", all);
    fat_image::remove(&mut image, "first.bin");
    assert_eq!(fat_image::free_bytes(&mut image), free);
    if matches!(kind, Kind::Fat32) {
        fat_image::hint_at_the_last_cluster(&mut image);
    }
    image
}

#[test]
fn the_last_free_cluster_is_used_and_nothing_is_begun_that_does_not_fit() {
    const FREE: u32 = 100 * 1_024;
    for kind in [Kind::Fat16, Kind::Fat32] {
        let image = nearly_full(kind, FREE as usize);
        let before = fat_image::files(&image);
        let mut disk = RamDisk::new(image.clone());
        assert_eq!(save_on(&mut disk, FREE), Ok(1), "{kind:?}");
        let mut after = fat_image::files(&disk.image);
        assert!(after.remove("TEST0001.CSV").unwrap().contents == contents(FREE));
        assert!(after == before);
        let mut disk = RamDisk::new(image.clone());
        assert_eq!(save_on(&mut disk, FREE + 1), Err(NotSaved::NoRoom));
        assert!(disk.image == image, "nothing is begun that does not fit");
    }
}

#[test]
fn a_card_that_fails_at_any_block_says_so_and_keeps_its_other_files() {
    for kind in [Kind::Fat16, Kind::Fat32] {
        let mut image = fat_image::formatted(kind);
        fat_image::put(&mut image, "other.bin", 3_000);
        let before = fat_image::files(&image);
        let errors = [
            (DiskError::Gone, NotSaved::Gone),
            (DiskError::Swapped, NotSaved::Swapped),
            (DiskError::Failed, NotSaved::Failed),
            (DiskError::WriteProtected, NotSaved::WriteProtected),
        ];
        let mut disk = RamDisk::new(image);
        for (blocks, (error, reason)) in (0..).zip(errors.into_iter().cycle()) {
            disk.blocks_left = blocks;
            disk.error = error;
            let saved = save_on(&mut disk, 5_000);
            if saved.is_ok() {
                assert!(blocks > 20, "{blocks}");
                break;
            }
            assert_eq!(saved, Err(reason), "after {blocks} blocks");
            let files = fat_image::files(&disk.image);
            assert_eq!(files.get("other.bin"), before.get("other.bin"));
        }
    }
}

#[test]
fn contents_that_end_early_are_reported() {
    let mut disk = RamDisk::new(fat_image::formatted(Kind::Fat16));
    let mut read = |offset: u32, _: &mut [u8]| if offset == 0 { 512 } else { 100 };
    let saved = save(&mut disk, 2_000, &mut read, None);
    assert_eq!(saved, Err(NotSaved::Short));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn a_damaged_image_is_no_panic_and_nothing_is_written_before_its_volume(
        is_32 in any::<bool>(),
        damage in prop::collection::vec((0_usize..4, 0_usize..BLOCK, any::<u8>()), 1..6),
    ) {
        let kind = if is_32 { Kind::Fat32 } else { Kind::Fat16 };
        let mut disk = RamDisk::new(fat_image::formatted(kind));
        for (which, at, value) in damage {
            // The boot records, the hints, and the table's beginning.
            let block = [0, FIRST, FIRST + 1, FIRST + if is_32 { 8 } else { 1 }][which];
            disk.image[block * BLOCK + at] = value;
        }
        disk.blocks_left = 200_000;
        let saved = save_on(&mut disk, 20_000);
        prop_assert!(saved != Err(NotSaved::Gone), "it went round and round");
        prop_assert!(disk.first_written > 0);
    }
}
