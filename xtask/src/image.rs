//! The firmware's images: which variant, built how, found where.
//!
//! *Design.* Each variant is built by cargo with its settings in the environment and
//! then copied to `target/images/`, so that the next variant does not overwrite it. A lock keeps
//! the builds of several verbs at the same time apart, and an image gets its name when it is
//! complete.

use std::fmt;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use variant::{Image, Variant};

/// The board's target.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// A board that there is an image for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    /// The Pixhawk 1, of metal or virtual.
    Pixhawk1,
    /// QEMU's `netduinoplus2`.
    Qemu,
}

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pixhawk1 => "pixhawk1",
            Self::Qemu => "qemu",
        })
    }
}

/// What an image is built with.
#[derive(Clone, Copy, Debug)]
pub struct Build {
    /// For which board.
    pub board: Board,
    /// With which settings; the firmware's build refuses those that it does not have.
    pub image: Image,
    /// Measures itself instead of keeping time.
    pub bench: bool,
    /// TELEM2 speaks STANAG 4586.
    pub stanag: bool,
    /// TELEM1 at the rate that a SiK radio has out of its box, 57600 Bd.
    pub for_radio: bool,
}

impl Build {
    /// What is flashed, for `board`.
    pub const fn standard(board: Board) -> Self {
        Self {
            board,
            image: Image::STANDARD,
            bench: false,
            stanag: false,
            for_radio: false,
        }
    }
}

impl fmt::Display for Build {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Image {
            variant,
            gps_baud,
            load,
        } = self.image;
        write!(f, "{}-", self.board)?;
        if !matches!(variant, Variant::Pixclock { .. }) {
            write!(f, "{}-", variant.name())?;
        }
        write!(f, "{}us", variant.tick_us())?;
        if gps_baud != Image::GPS_BAUD {
            write!(f, "-{gps_baud}bd")?;
        }
        if let Some(load) = load {
            write!(f, "-load-{}", load.to_string().replace(',', "-"))?;
        }
        if self.for_radio {
            write!(f, "-radio")?;
        }
        if self.bench {
            write!(f, "-bench")?;
        }
        if self.stanag {
            write!(f, "-stanag")?;
        }
        Ok(())
    }
}

/// The workspace's folder.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A call of cargo in the workspace.
pub fn cargo() -> Command {
    // The cargo that runs us, or rustup's, which knows the pinned one.
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(root());
    // What a user builds other things with would put ours elsewhere, or take the place of the flags that
    // the firmware is linked with.
    for foreign in ["CARGO_BUILD_TARGET", "CARGO_ENCODED_RUSTFLAGS", "RUSTFLAGS"] {
        cargo.env_remove(foreign);
    }
    cargo
}

/// Runs `command` to its end.
///
/// # Errors
///
/// When it cannot be started, or fails.
pub fn run(command: &mut Command) -> Result<()> {
    let status = command
        .status()
        .with_context(|| format!("cannot start {command:?}"))?;
    if !status.success() {
        bail!("{command:?} failed: {status}");
    }
    Ok(())
}

/// Builds what `build` says and returns its ELF file, which no other build overwrites.
///
/// # Errors
///
/// When the build fails; cargo has printed why.
pub fn build(build: Build) -> Result<PathBuf> {
    let mut features = build.board.to_string();
    if build.bench {
        features.push_str(",bench");
    }
    let Image {
        variant,
        gps_baud,
        load,
    } = build.image;
    let folder = folder()?;
    // All images leave cargo under the same name. Unlocked when it is dropped.
    let lock = File::create(folder.join("lock"))?;
    lock.lock()?;
    let mut cargo = cargo();
    if let Some(load) = load {
        cargo.env("PIXCLOCK_LOAD", load.to_string());
    }
    if build.for_radio {
        cargo.env("PIXCLOCK_MAVLINK_BAUD", "57600");
    }
    run(cargo
        .args(["build", "--quiet", "--release", "--package", "firmware"])
        .args(["--target", TARGET, "--no-default-features"])
        .args(["--features", &features])
        .env("PIXCLOCK_VARIANT", variant.name())
        .env("PIXCLOCK_TICK_US", variant.tick_us().to_string())
        .env("PIXCLOCK_GPS_BAUD", gps_baud.to_string())
        .env(
            "PIXCLOCK_STANAG",
            if build.stanag { "telem2" } else { "none" },
        ))?;
    let target = target_dir()?;
    let built = target.join(TARGET).join("release").join("firmware");
    let image = folder.join(format!("{build}.elf"));
    keep(&image, &std::fs::read(&built)?)
        .with_context(|| format!("cannot copy {} to {}", built.display(), image.display()))?;
    Ok(image)
}

/// Builds the stand-in for PX4's bootloader and returns its ELF file.
///
/// # Errors
///
/// When the build fails; cargo has printed why.
pub fn build_bootloader() -> Result<PathBuf> {
    const PACKAGE: &str = "bootloader-stand-in";
    run(cargo()
        .args(["build", "--quiet", "--release", "--package", PACKAGE])
        .args(["--target", TARGET]))?;
    Ok(target_dir()?.join(TARGET).join("release").join(PACKAGE))
}

/// Makes a file of these bytes, which has its name only when it is complete.
///
/// # Errors
///
/// When it cannot be written.
pub fn keep(path: &Path, bytes: &[u8]) -> Result<()> {
    let unfinished = path.with_extension(format!("{}.tmp", std::process::id()));
    console::write_file(&unfinished, bytes)?;
    Ok(std::fs::rename(&unfinished, path)?)
}

/// Where images are kept.
///
/// # Errors
///
/// When it cannot be made.
pub fn folder() -> Result<PathBuf> {
    let folder = target_dir()?.join("images");
    std::fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// Where cargo builds.
///
/// # Errors
///
/// When cargo does not say.
pub fn target_dir() -> Result<PathBuf> {
    Ok(metadata()?["target_directory"]
        .as_str()
        .context("cargo's metadata have no target directory")?
        .into())
}

/// What cargo knows of the workspace.
///
/// # Errors
///
/// When cargo does not answer as it should.
pub fn metadata() -> Result<serde_json::Value> {
    let output = cargo()
        .args(["metadata", "--format-version", "1", "--no-deps", "--locked"])
        .output()?;
    Ok(serde_json::from_slice(&output.stdout)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_user_builds_other_things_with_is_not_ours() {
        let cargo = cargo();
        for name in ["CARGO_BUILD_TARGET", "CARGO_ENCODED_RUSTFLAGS", "RUSTFLAGS"] {
            let taken_away = (std::ffi::OsStr::new(name), None);
            assert!(cargo.get_envs().any(|it| it == taken_away), "{name}");
        }
    }
}
