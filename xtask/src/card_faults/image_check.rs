//! One card's image: what the board's code makes of it, and whether that is right.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use card_file::{BLOCK, Disk, DiskError};
use fat_image::{Block, Census};

use crate::card::disk::ImageDisk;
use crate::card::{file_name, made, reason};

/// What became of a card.
pub struct Row {
    pub outcome: String,
    pub written: usize,
    pub fsck: String,
    /// What is not as it should be.
    pub wrong: Option<String>,
}

/// Saves the made log to the image, and judges it.
///
/// # Errors
///
/// When a program cannot be started, or the image cannot be used.
pub fn check(image: &Path, folder: &Path) -> Result<Row> {
    let mut disk = Watched {
        disk: ImageDisk::open(image, true)?,
        before: BTreeMap::new(),
    };
    let facts = card_file::examine(&mut disk);
    let before = match facts {
        Ok(facts) => Some((
            facts.first_block,
            Census::of(facts.first_block, &mut |number| disk.block(number)),
            fsck(image, facts.first_block, folder)?,
        )),
        Err(_) => None,
    };
    let log = made::log();
    let len = log.len() as u32;
    let saved = card_file::save(&mut disk, len, &mut made::reader(&log), None);
    let written = disk.before.len();
    let mut row = Row {
        outcome: match saved {
            Ok(number) => format!("saved as {}", file_name(number)),
            Err(why) => format!("refused: {}", reason(why)),
        },
        written,
        fsck: String::new(),
        wrong: None,
    };
    if saved.is_err() && written > 0 {
        row.wrong = Some("refused, and written to".to_owned());
    }
    if let (Ok(number), Some((first, census, fsck_before))) = (saved, before) {
        let fsck_after = fsck(image, first, folder)?;
        row.fsck = format!("{}, {}", fsck_before.exit, fsck_after.exit);
        row.wrong = judge(&mut disk, &census, number, &log, first);
        if row.wrong.is_none() && fsck_after.is_worse_than(&fsck_before) {
            row.wrong = Some(format!("fsck: {:?}", fsck_after.complaints));
        }
    }
    Ok(row)
}

/// What is wrong with a card that the file was saved on.
fn judge(
    disk: &mut Watched,
    census: &Census,
    number: u16,
    log: &[u8],
    first: u32,
) -> Option<String> {
    for (number, old) in disk.before.clone() {
        let new = disk.block(number);
        if let Err(foreign) = census.judge(number, &old, &new) {
            return Some(foreign.to_string());
        }
    }
    let after = Census::of(first, &mut |number| disk.block(number));
    if let Some(name) = after.missing(census) {
        return Some(format!("{name} is not as it was"));
    }
    if after.count() != census.count() + 1 {
        return Some(format!(
            "{} files, and then {}",
            census.count(),
            after.count()
        ));
    }
    let name = file_name(number).replace('.', "");
    let Some(item) = after.item(&name) else {
        return Some(format!("{name} is not there"));
    };
    let contents = after.contents(item, &mut |number| disk.block(number));
    (contents != log).then(|| format!("{name} has other contents"))
}

/// An image, with what its blocks were before they were written.
struct Watched {
    disk: ImageDisk,
    before: BTreeMap<u32, Block>,
}

impl Watched {
    fn block(&mut self, number: u32) -> Block {
        let mut block = [0; BLOCK];
        // What is behind the end of the card is nothing.
        let _ = self.disk.read(number, &mut block);
        block
    }
}

impl Disk for Watched {
    fn read(&mut self, number: u32, block: &mut [u8; BLOCK]) -> Result<(), DiskError> {
        self.disk.read(number, block)
    }

    fn write(&mut self, number: u32, block: &[u8; BLOCK]) -> Result<(), DiskError> {
        if !self.before.contains_key(&number) {
            let old = self.block(number);
            self.before.insert(number, old);
        }
        self.disk.write(number, block)
    }

    fn blocks(&self) -> u32 {
        self.disk.blocks()
    }
}

/// What `fsck.fat -n` says of a volume.
struct Fsck {
    exit: i32,
    /// Its lines, without numbers and names.
    complaints: Vec<String>,
}

impl Fsck {
    fn is_worse_than(&self, before: &Self) -> bool {
        let is_new = |line: &&String| !before.complaints.contains(line);
        self.exit > before.exit
            || self.exit != 0 && self.complaints.iter().any(|line| is_new(&line))
    }
}

/// Copies what is stored of a partition, and leaves the holes.
const EXTRACT: &str = "
import os, sys
source, target, first = sys.argv[1], sys.argv[2], int(sys.argv[3])
a, b = open(source, 'rb'), open(target, 'wb')
end, at = os.path.getsize(source), first
b.truncate(end - first)
while at < end:
    try: at = os.lseek(a.fileno(), at, os.SEEK_DATA)
    except OSError: break
    stop = os.lseek(a.fileno(), at, os.SEEK_HOLE)
    while at < stop:
        a.seek(at); data = a.read(min(1 << 20, stop - at))
        b.seek(at - first); b.write(data); at += len(data)
";

fn fsck(image: &Path, first: u32, folder: &Path) -> Result<Fsck> {
    let volume = folder.join("volume.img");
    let mut extract = Command::new("python3");
    extract.arg("-c").arg(EXTRACT).arg(image).arg(&volume);
    extract.arg((u64::from(first) * BLOCK as u64).to_string());
    let status = extract.status().context("cannot start python3")?;
    anyhow::ensure!(status.success(), "the partition could not be copied");
    let ended = Command::new("fsck.fat").arg("-n").arg(&volume).output();
    let ended = ended.context("cannot start fsck.fat, which is in dosfstools")?;
    std::fs::remove_file(&volume)?;
    let text = String::from_utf8_lossy(&ended.stdout).into_owned();
    let without_numbers = |line: &str| line.chars().filter(|c| !c.is_ascii_digit()).collect();
    Ok(Fsck {
        exit: ended.status.code().unwrap_or(-1),
        complaints: text.lines().map(without_numbers).collect(),
    })
}
