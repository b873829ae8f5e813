//! The heavy tools: programs of their own, built when they are asked for.
//!
//! *Design.* xtask stays light, so that every verb starts at once; what needs the
//! emulator is a program of the package `virtual-pixhawk`. The first build of that
//! takes minutes, and cargo shows its progress meanwhile.

use std::os::unix::process::CommandExt as _;
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

/// Becomes a tool: it takes over this process with its id, so that whoever signals or waits for the one
/// that was started has the tool itself. Returns only the reason why it cannot be started.
pub fn become_it(command: &mut Command) -> Result<ExitCode> {
    let error = command.exec();
    Err(error).with_context(|| format!("cannot start {command:?}"))
}
