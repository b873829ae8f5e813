//! The cards that are damaged and pulled: small, with files on them.

use fat_image::{BLOCK, Census, FIRST, Kind};

/// A card as it is before anything happens to it.
pub struct Specimen {
    pub name: &'static str,
    pub image: Vec<u8>,
    pub census: Census,
}

impl Specimen {
    fn new(name: &'static str, image: Vec<u8>) -> Self {
        let census = Census::of(FIRST as u32, &mut |number| block(&image, number));
        Self {
            name,
            image,
            census,
        }
    }
}

/// A block of an image.
pub fn block(image: &[u8], number: u32) -> fat_image::Block {
    let at = number as usize * BLOCK;
    let found = image
        .get(at..at + BLOCK)
        .and_then(|some| some.try_into().ok());
    found.unwrap_or([0; BLOCK])
}

/// Four with two tables: two FAT16, two FAT32.
pub fn four() -> Vec<Specimen> {
    vec![
        Specimen::new("FAT16 with some files", some_files(Kind::Fat16)),
        Specimen::new("FAT16, fragmented", fragmented(Kind::Fat16)),
        Specimen::new("FAT32 with some files", some_files(Kind::Fat32)),
        Specimen::new("FAT32, root full", root_full(Kind::Fat32)),
    ]
}

/// Six that grow, are full or fragmented.
pub fn six() -> Vec<Specimen> {
    vec![
        Specimen::new("FAT16, fragmented", fragmented(Kind::Fat16)),
        Specimen::new("FAT16, nearly full", nearly_full(fragmented(Kind::Fat16))),
        Specimen::new("FAT32, fragmented", fragmented(Kind::Fat32)),
        Specimen::new("FAT32, nearly full", nearly_full(fragmented(Kind::Fat32))),
        Specimen::new("FAT32, root full", root_full(Kind::Fat32)),
        Specimen::new(
            "FAT32, root full, nearly full",
            nearly_full(root_full(Kind::Fat32)),
        ),
    ]
}

fn some_files(kind: Kind) -> Vec<u8> {
    let mut image = fat_image::formatted(kind);
    fat_image::put(&mut image, "PHOTO.JPG", 300_000);
    fat_image::put(&mut image, "notes of a flight.txt", 8_000);
    fat_image::put(&mut image, "TEST0001.CSV", 5_000);
    image
}

/// Every second cluster of its beginning is free.
fn fragmented(kind: Kind) -> Vec<u8> {
    let mut image = some_files(kind);
    for n in 0..60 {
        fat_image::put(&mut image, &format!("F{n:03}.BIN"), 512);
    }
    for n in (0..60).step_by(2) {
        fat_image::remove(&mut image, &format!("F{n:03}.BIN"));
    }
    image
}

/// What was deleted before lies where the root grows.
fn root_full(kind: Kind) -> Vec<u8> {
    let mut image = some_files(kind);
    fat_image::put(&mut image, "OLD.TXT", 60_000);
    fat_image::remove(&mut image, "OLD.TXT");
    let census = Census::of(FIRST as u32, &mut |number| block(&image, number));
    for (n, (number, at)) in census.unused_entries().into_iter().enumerate() {
        let entry = &mut image[number as usize * BLOCK + at..][..32];
        entry.fill(0);
        entry[..11].copy_from_slice(format!("E{n:07}BIN").as_bytes());
        entry[11] = 0x20;
    }
    image
}

/// Only so much is free that one file of the campaigns fits.
fn nearly_full(mut image: Vec<u8>) -> Vec<u8> {
    let free = fat_image::free_bytes(&mut image);
    fat_image::put(&mut image, "FILL.BIN", free - 40 * 1_024);
    image
}
