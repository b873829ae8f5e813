//! Bare `cargo run`: flash a Pixhawk 1 and show its log.

use std::process::Command;

use anyhow::{Result, bail};

use crate::image::{self, Board, Build};

/// What probe-rs calls the Pixhawk's chip.
const CHIP: &str = "STM32F427VITx";

/// Builds the image that is flashed and hands it to probe-rs.
///
/// # Errors
///
/// When probe-rs is not there, with how to get it; when the build or the flashing
/// fails.
pub fn flash() -> Result<()> {
    let is_there = Command::new("probe-rs").arg("--version").output().is_ok();
    if !is_there {
        bail!(
            "probe-rs is not on this machine: `cargo install probe-rs-tools --locked` gets it. \
             Without a board: `cargo xtask sim`"
        );
    }
    let image = image::build(Build::standard(Board::Pixhawk1))?;
    image::run(
        Command::new("probe-rs")
            .args(["run", "--chip", CHIP])
            .arg(image),
    )
}
