//! The heavy tools: programs of their own, built when they are asked for.
//!
//! *Design.* xtask stays light, so that every verb starts at once; what needs the
//! emulator is a program of the package `virtual-pixhawk`. The first build of that
//! takes minutes, and cargo shows its progress meanwhile.

use std::path::PathBuf;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result};

use crate::image::{self, cargo, run};

/// The package of the heavy tools.
const PACKAGE: &str = "virtual-pixhawk";

/// Builds the tool `name` and returns its program.
///
/// # Errors
///
/// When it cannot be built; cargo has printed why.
pub fn build(name: &str) -> Result<PathBuf> {
    run(cargo().args(["build", "--locked", "--package", PACKAGE, "--bin", name]))?;
    Ok(image::target_dir()?.join("debug").join(name))
}

/// Runs a tool to its end, and ends as it did. Ctrl-C is the tool's to handle.
///
/// # Errors
///
/// When it cannot be started.
pub fn hand_over(command: &mut Command) -> Result<ExitCode> {
    // The terminal sends it to both of us; the tool ends cleanly, and then we do.
    ctrlc::set_handler(|| ())?;
    let status = command
        .status()
        .with_context(|| format!("cannot start {command:?}"))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(code.map_or(ExitCode::FAILURE, ExitCode::from))
}
