//! The heavy tools: programs of their own, built when they are asked for.
//!
//! *Design.* xtask stays light, so that every verb starts at once; what needs the
//! emulator is a program of the package `virtual-pixhawk`. The first build of that
//! takes minutes, and cargo shows its progress meanwhile.

use std::path::PathBuf;

use anyhow::Result;

use crate::image::{self, cargo, run};
use crate::system;

/// The package of the heavy tools.
const PACKAGE: &str = "virtual-pixhawk";

/// Builds the tool `name` and returns its program.
///
/// # Errors
///
/// When it cannot be built; cargo has printed why.
pub fn build(name: &str) -> Result<PathBuf> {
    run(cargo().args(["build", "--locked", "--package", PACKAGE, "--bin", name]))?;
    Ok(image::target_dir()?
        .join("debug")
        .join(system::program(name)))
}
