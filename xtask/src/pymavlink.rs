//! `pymavlink`: the library that most clients are built on, against ours.
//!
//! *Design.* A [`venv`] with the pinned pymavlink; `sim`, then `qemu`,
//! each started on a port of its own; the script of `host-tests/pymavlink` asks
//! them in MAVLink 1 and 2, `sim`'s board by TCP and by the pseudo-terminal that its USB is. What could not be tried is printed as SKIPPED, and in CI
//! (where `CI` is set) it is a failure.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

use crate::image;
use crate::qemu::machine;
use crate::venv::{self, Board, PYMAVLINK};

/// By which pymavlink opens serial ports.
const PYSERIAL: &str = "pyserial";
/// How long a board runs for the script, in s: the script ends it earlier.
const DURATION_S: &str = "90";

/// Tries both emulators.
///
/// # Errors
///
/// When an answer was wrong or missing; in CI also when pymavlink or QEMU is not to
/// be had.
pub fn run() -> Result<()> {
    let packages = [PYMAVLINK, PYSERIAL];
    let python = match venv::with("pymavlink-venv", "pymavlink, serial", &[&packages]) {
        Ok(python) => python,
        Err(error) if std::env::var_os("CI").is_none() => {
            console::print_line!("SKIPPED: pymavlink could not be installed: {error:#}");
            return Ok(());
        }
        Err(error) => return Err(error),
    };
    let (sim, qemu) = ("5790", "5791");
    let (mut board, usb) = Board::start_with_usb(sim, DURATION_S)?;
    let asked = ask(&python, &at(sim)).and_then(|()| ask(&python, &usb).context("over USB"));
    board.stop();
    asked.context("pymavlink and sim")?;
    if let Err(error) = machine::check() {
        if std::env::var_os("CI").is_some() {
            return Err(error);
        }
        console::print_line!("SKIPPED: {error}");
        return Ok(());
    }
    let mut board = Board::start("qemu", qemu, DURATION_S)?;
    let asked = ask(&python, &at(qemu));
    board.stop();
    asked.context("pymavlink and qemu")
}

/// A board's address for pymavlink.
fn at(port: &str) -> String {
    format!("tcp:127.0.0.1:{port}")
}

/// Has the script ask the board at `address`.
fn ask(python: &Path, address: &str) -> Result<()> {
    let script = image::root().join("host-tests/pymavlink/ask.py");
    image::run(Command::new(python).arg(script).arg(address))
}
