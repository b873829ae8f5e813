//! `px4`: the firmware as a file that any uploader takes.

use std::path::PathBuf;

use anyhow::{Context, Result};
use console::Word;
use upload::{APPLICATION, FLASH_ROOM, Px4File};
use variant::{Image, Variant};

use crate::image::{self, Board, Build};

/// What can be asked for.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Where the file goes
    #[arg(value_name = "FILE", default_value = "pixclock.px4")]
    file: PathBuf,
    #[command(flatten)]
    ours: Ours,
}

/// What of our own image can be chosen.
#[derive(clap::Args, Debug)]
pub struct Ours {
    /// The board's MAVLink system id, 1 to 254; boards on one network need different ones
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=254))]
    pub system_id: Option<u8>,
    /// How the image keeps the clock, when it is built: pixclock, or as the paper did (paper-default,
    /// paper-step1, paper-step2:200, …)
    #[arg(long)]
    pub variant: Option<Variant>,
}

/// Builds the image and writes the file.
///
/// # Errors
///
/// When it cannot be built or written.
pub fn write(options: &Options) -> Result<()> {
    let file = options.ours.file()?;
    let path = options.file.display();
    image::keep(&options.file, file.to_json().as_bytes())
        .with_context(|| format!("cannot write {path}"))?;
    console::print_line!(
        "{path}: {} bytes, version {}",
        file.image.bytes().len(),
        file.version
    );
    Ok(())
}

impl Ours {
    /// The image, as a file.
    ///
    /// # Errors
    ///
    /// When it cannot be built.
    pub fn file(&self) -> Result<Px4File> {
        let mut file = make(self.variant.unwrap_or(Variant::STANDARD))?;
        if let Some(id) = self.system_id {
            file.set_system_id(id)?;
        }
        Ok(file)
    }
}

/// The image of this variant; its system id is the build's.
fn make(variant: Variant) -> Result<Px4File> {
    let elf = std::fs::read(image::build(Build {
        image: Image::of(variant),
        ..Build::standard(Board::Pixhawk1)
    })?)?;
    let bytes = console::flash_bytes(&elf, APPLICATION.into(), FLASH_ROOM as usize)?;
    let system_id_at = console::word_address(&elf, Word::SystemId)?.checked_sub(APPLICATION.into());
    let git_hash = git(&["rev-parse", "HEAD"]);
    Ok(Px4File {
        summary: format!("pixclock, variant {variant}"),
        version: git(&["describe", "--always", "--dirty", "--tags"])
            .unwrap_or_else(|| env!("CARGO_PKG_VERSION").to_owned()),
        git_hash: git_hash.unwrap_or_default(),
        // The commit's time, so that one commit makes one file.
        build_time: git(&["show", "--no-patch", "--format=%ct", "HEAD"])
            .and_then(|time| time.parse().ok())
            .unwrap_or_default(),
        system_id_at: system_id_at.and_then(|offset| u32::try_from(offset).ok()),
        ..Px4File::new(bytes)
    })
}

/// What git says; nothing outside a repository.
fn git(arguments: &[&str]) -> Option<String> {
    let output = std::process::Command::new("git")
        .current_dir(image::root())
        .args(arguments)
        .output()
        .ok()
        .filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
