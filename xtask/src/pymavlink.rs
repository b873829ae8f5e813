//! `pymavlink`: other people's MAVLink against ours.
//!
//! *Design.* A venv under `target/` with the pinned pymavlink; `sim`, then `qemu`,
//! each started on a port of its own; the script of `host-tests/pymavlink` asks
//! them in MAVLink 1 and 2. What could not be tried is printed as SKIPPED, and in CI
//! (where `CI` is set) it is a failure.

use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result};

use crate::image;
use crate::qemu::machine;

/// The release whose behaviour the node was built for.
const PYMAVLINK: &str = "pymavlink==2.4.50";

/// How long a board runs for the script, in s: the script ends it earlier.
const DURATION_S: &str = "90";

/// Tries both emulators.
///
/// # Errors
///
/// When an answer was wrong or missing; in CI also when pymavlink or QEMU is not to
/// be had.
pub fn run() -> Result<()> {
    let python = match venv() {
        Ok(python) => python,
        Err(error) if std::env::var_os("CI").is_none() => {
            println!("SKIPPED: pymavlink could not be installed: {error:#}");
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
            println!("SKIPPED: {error}");
            continue;
        }
        let mut board = Board::start(emulator, port)?;
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

/// A board that is running for the script.
struct Board(Child);

impl Board {
    fn start(emulator: &str, port: &str) -> Result<Self> {
        let child = Command::new(std::env::current_exe()?)
            .args([emulator, "--boards", "1", "--duration", DURATION_S])
            .args(["--mavlink-port", port])
            .stdout(Stdio::null())
            // With the tool that it starts, for one signal to both, as Ctrl-C gives.
            .process_group(0)
            .spawn()?;
        Ok(Self(child))
    }

    fn stop(&mut self) {
        // It may have ended by itself; then there is nothing to stop.
        let group = format!("-{}", self.0.id());
        let _ = Command::new("kill").args(["-INT", "--", &group]).status();
        let _ = self.0.wait();
    }
}

/// A Python with pymavlink, made at the first call.
fn venv() -> Result<PathBuf> {
    let folder = image::target_dir()?.join("pymavlink-venv");
    let python = folder.join("bin").join("python");
    if !has_pymavlink(&python) {
        image::run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        let mut pip = Command::new(&python);
        image::run(pip.args(["-m", "pip", "install", "--quiet", PYMAVLINK]))?;
    }
    Ok(python)
}

fn has_pymavlink(python: &Path) -> bool {
    Command::new(python)
        .args(["-c", "import pymavlink"])
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}
