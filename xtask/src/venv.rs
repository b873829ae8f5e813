//! Other people's Python programs, and a board for them to talk to.
//!
//! *Design.* A venv under `target/` with pinned releases, made at the first call and again when one of
//! them is another. The board is a verb of our own, started on a port of its own.

use std::io::{self, BufRead as _, BufReader, Read as _};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;

use anyhow::{Context as _, Result};

use crate::{image, system};

/// The release whose behaviour the node was built for.
pub const PYMAVLINK: &str = "pymavlink==2.4.50";

/// A Python that has these packages: each list is given to one call of pip. `module` is one of theirs.
///
/// # Errors
///
/// When there is no Python, or pip cannot have them.
pub fn with(name: &str, module: &str, packages: &[&[&str]]) -> Result<PathBuf> {
    let folder = image::target_dir()?.join(name);
    let python = folder.join(system::IN_VENV);
    let stamp = folder.join("packages");
    let wanted = format!("{packages:?}");
    let is_made = std::fs::read_to_string(&stamp).is_ok_and(|made| made == wanted)
        && has_module(&python, module);
    if !is_made {
        image::run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        for list in packages {
            let mut pip = Command::new(&python);
            image::run(pip.args(["-m", "pip", "install", "--quiet"]).args(*list))?;
        }
        std::fs::write(&stamp, wanted)?;
    }
    Ok(python)
}

fn has_module(python: &PathBuf, module: &str) -> bool {
    Command::new(python)
        .args(["-c", &format!("import {module}")])
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// A board that is running for a script; it ends with this.
pub struct Board(Child);

impl Board {
    /// Starts one board on `sim` or `qemu`.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start(emulator: &str, port: &str, duration_s: &str) -> Result<Self> {
        Self::start_with(emulator, port, duration_s, &[])
    }

    /// The same, with `options` of that verb.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start_with(
        emulator: &str,
        port: &str,
        duration_s: &str,
        options: &[&str],
    ) -> Result<Self> {
        let child = Command::new(std::env::current_exe()?)
            .args([emulator, "--boards", "1", "--duration", duration_s])
            .args(["--mavlink-port", port])
            .args(options)
            .stdout(Stdio::null())
            .spawn()?;
        Ok(Self(child))
    }

    /// Starts one board on `sim` with its USB plugged in, and returns the device that it is here.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start_with_usb(port: &str, duration_s: &str) -> Result<(Self, String)> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(["sim", "--usb", "--boards", "1", "--duration", duration_s])
            .args(["--mavlink-port", port])
            .stdout(Stdio::piped())
            .spawn()?;
        let output = child.stdout.take().context("its output is not here")?;
        let board = Self(child);
        let mut output = BufReader::new(output);
        let device = output
            .by_ref()
            .lines()
            .map_while(Result::ok)
            .find_map(|line| {
                let (_, after) = line.split_once("serial:")?;
                Some(after.split(',').next().unwrap_or(after).to_owned())
            });
        // It goes on printing, and may not have to wait for a reader.
        thread::spawn(move || io::copy(&mut output, &mut io::sink()));
        Ok((board, device.context("sim does not say where its USB is")?))
    }

    /// Ends it as Ctrl-C does.
    pub fn stop(&mut self) {
        // It may have ended by itself; then there is nothing to stop.
        let _ = system::interrupt(&mut self.0);
        let _ = self.0.wait();
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.stop();
    }
}
