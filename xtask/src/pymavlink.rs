//! `pymavlink`: the library that most clients are built on, against ours.
//!
//! *Design.* A [`venv`] with the pinned pymavlink; `sim`, then `qemu`,
//! each started on a port of its own; the script of `host-tests/pymavlink` asks
//! them in MAVLink 1 and 2. What could not be tried is printed as SKIPPED, and in CI
//! (where `CI` is set) it is a failure.

use std::process::Command;

use anyhow::{Context, Result};

use crate::image;
use crate::qemu::machine;
use crate::venv::{self, Board, PYMAVLINK};

/// How long a board runs for the script, in s: the script ends it earlier.
const DURATION_S: &str = "90";

/// Tries both emulators.
///
/// # Errors
///
/// When an answer was wrong or missing; in CI also when pymavlink or QEMU is not to
/// be had.
pub fn run() -> Result<()> {
    let python = match venv::with("pymavlink-venv", "pymavlink", &[&[PYMAVLINK]]) {
        Ok(python) => python,
        Err(error) if std::env::var_os("CI").is_none() => {
            console::print_line!("SKIPPED: pymavlink could not be installed: {error:#}");
            return Ok(());
        }
        Err(error) => return Err(error),
    };
    for (emulator, port) in [("sim", "5790"), ("qemu", "5791")] {
        if emulator == "qemu"
            && let Err(error) = machine::check()
        {
            if std::env::var_os("CI").is_some() {
                return Err(error);
            }
            console::print_line!("SKIPPED: {error}");
            continue;
        }
        let mut board = Board::start(emulator, port, DURATION_S)?;
        let asked = image::run(
            Command::new(&python)
                .arg(image::root().join("host-tests/pymavlink/ask.py"))
                .arg(format!("tcp:127.0.0.1:{port}")),
        );
        board.stop();
        asked.with_context(|| format!("pymavlink and {emulator}"))?;
    }
    Ok(())
}
