//! `card`: what the board makes of a memory card, by the board's own code.
//!
//! *Purpose.* Without `--write` the card, or an image of one, is only read: where its volume is,
//! what is free, and what is wrong with it. With `--write` the file is written into an image in
//! place, block for block as the board does.
//!
//! *Limits.* A device is never written. Exit codes: 0 = saved, or would be; 1 = refused; 2 = wrong
//! usage.

pub mod disk;
pub mod made;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use card_file::{BLOCK, Disk, Facts, NotSaved};
use clap::Args;
use serde_json::json;
use timebase::CivilTime;

use disk::ImageDisk;

/// What can be asked for.
#[derive(Args)]
pub struct Options {
    /// A card's image, or the device of a card (Linux)
    card: PathBuf,
    /// Write the file into the image, as the board does
    #[arg(long)]
    write: bool,
    /// The bytes of the file; otherwise a log of 8192 made samples
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What became of the file, or would.
enum Verdict {
    Saved(u16),
    WouldSave(u16),
    Refused(NotSaved),
}

/// Looks at the card, and says what it is good for.
///
/// # Errors
///
/// When a file cannot be read, or the image cannot be written.
pub fn run(options: &Options) -> Result<ExitCode> {
    let name = options.card.display();
    let log = match &options.log {
        Some(path) => {
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?
        }
        None => made::log(),
    };
    let len = u32::try_from(log.len()).context("FAT has no files of 4 GB and more")?;
    let mut disk = match ImageDisk::open(&options.card, options.write) {
        Ok(disk) => disk,
        Err(error) if options.write && ImageDisk::is_device(&options.card) => {
            console::print_error!("error: {error:#}");
            return Ok(ExitCode::from(2));
        }
        Err(error) => return Err(error.context(format!("cannot use {name}"))),
    };
    let facts = card_file::examine(&mut disk);
    let verdict = if disk.is_read_only() && options.write {
        Verdict::Refused(NotSaved::WriteProtected)
    } else if options.write {
        let saved = card_file::save(&mut disk, len, &mut made::reader(&log), now());
        saved.map_or_else(Verdict::Refused, Verdict::Saved)
    } else {
        card_file::look(&mut disk, len).map_or_else(Verdict::Refused, Verdict::WouldSave)
    };
    // The reason of the library is a class of its own; what the system says is more exact.
    if let Some(error) = disk.take_error() {
        return Err(error).with_context(|| format!("cannot use {name}"));
    }
    if options.json {
        console::print_line!("{}", verdict.json());
    } else {
        console::print_line!(
            "card     {}",
            in_bytes(u64::from(disk.blocks()) * BLOCK as u64)
        );
        if let Ok(facts) = facts {
            describe(&facts);
        }
        console::print_line!("{}", verdict.line(len));
    }
    Ok(match verdict {
        Verdict::Refused(_) => ExitCode::FAILURE,
        Verdict::Saved(_) | Verdict::WouldSave(_) => ExitCode::SUCCESS,
    })
}

impl Verdict {
    fn json(&self) -> serde_json::Value {
        match self {
            Self::Saved(file) => {
                json!({ "verdict": "saved", "file": file_name(*file), "reason": null })
            }
            Self::WouldSave(file) => {
                json!({ "verdict": "would save", "file": file_name(*file), "reason": null })
            }
            Self::Refused(why) => {
                json!({ "verdict": "refused", "file": null, "reason": reason(*why) })
            }
        }
    }

    fn line(&self, len: u32) -> String {
        let len = in_bytes(len.into());
        match self {
            Self::Saved(file) => format!("saved    {}, {len}", file_name(*file)),
            Self::WouldSave(file) => format!("would save {}, {len}", file_name(*file)),
            Self::Refused(why) => format!("refused  {}", reason(*why)),
        }
    }
}

/// The word that stays, then what is wrong and what to do.
pub fn reason(why: NotSaved) -> String {
    format!("{}: {why}", why.word())
}

/// The name that a number gives a file.
pub fn file_name(number: u16) -> String {
    format!("TEST{number:04}.CSV")
}

fn describe(facts: &Facts) {
    let kind = if facts.is_fat32 { "FAT32" } else { "FAT16" };
    let place = match facts.first_block {
        0 => "on the whole card".to_owned(),
        first => format!("in a partition from block {first} on"),
    };
    console::print_line!(
        "volume   {kind} {place}, {}",
        in_bytes(u64::from(facts.blocks) * BLOCK as u64)
    );
    let tables = if facts.tables == 1 { "table" } else { "tables" };
    console::print_line!(
        "clusters {} of {}, {} {tables}",
        facts.clusters,
        in_bytes(facts.cluster_bytes.into()),
        facts.tables,
    );
    let free = u64::from(facts.free_clusters) * u64::from(facts.cluster_bytes);
    console::print_line!("free     {}", in_bytes(free));
}

/// A number of bytes in a unit that people read.
fn in_bytes(bytes: u64) -> String {
    let units = [(30, "GB"), (20, "MB"), (10, "KB")];
    let unit = units.into_iter().find(|(power, _)| bytes >= 1 << power);
    match unit {
        Some((power, name)) => format!("{:.1} {name}", bytes as f64 / f64::from(1 << power)),
        None => format!("{bytes} bytes"),
    }
}

/// UTC by this computer's clock, as the board's clock would have it.
fn now() -> Option<CivilTime> {
    let now = jiff::Timestamp::now().to_zoned(jiff::tz::TimeZone::UTC);
    Some(CivilTime {
        year: now.year().try_into().ok()?,
        month: now.month().try_into().ok()?,
        day: now.day().try_into().ok()?,
        hour: now.hour().try_into().ok()?,
        minute: now.minute().try_into().ok()?,
        second: now.second().try_into().ok()?,
        nano: 0,
    })
}
