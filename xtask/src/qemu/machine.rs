//! A QEMU process with one of our images.
//!
//! *Purpose.* How QEMU is called, for every verb that uses it.
//!
//! *Design.* QEMU connects the board's UART4 to a port of ours, where a receiver is
//! [played](super::player()), and its USART2 where the caller wants it. The log comes out of its standard
//! output.

use std::io::ErrorKind;
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use variant::{Image, Variant};

use crate::image::{self, Board, Build};
use crate::system;

/// The emulator and its machine: an STM32F405 with SysTick at 168 MHz.
const QEMU: &str = "qemu-system-arm";
pub const MACHINE: &str = "netduinoplus2";

/// The one command that installs QEMU on Debian and its children.
const INSTALL: &str = "apt-get install -y qemu-system-arm";

/// Between two looks whether QEMU has connected its UART4.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Checks that QEMU is on this machine.
///
/// # Errors
///
/// When it is not, with how to get it.
pub fn check() -> Result<()> {
    let there = Command::new(QEMU)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    if !there.is_ok_and(|status| status.success()) {
        bail!(
            "{QEMU} is not on this machine; `{INSTALL}` installs it, and so does `cargo xtask qemu --install`"
        );
    }
    Ok(())
}

/// Installs QEMU.
///
/// # Errors
///
/// When that fails; apt-get has printed why.
pub fn install() -> Result<()> {
    image::run(Command::new("sh").args(["-c", INSTALL]))
}

/// Builds the image for QEMU.
///
/// # Errors
///
/// When the build fails.
pub fn build(variant: Variant) -> Result<PathBuf> {
    image::build(Build {
        image: Image::of(variant),
        ..Build::standard(Board::Qemu)
    })
}

/// QEMU with an image, not started yet: no window, the log on standard output.
pub fn command(image: &Path) -> Command {
    let mut qemu = Command::new(QEMU);
    qemu.args(["-machine", MACHINE, "-display", "none", "-monitor", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image)
        .stdin(Stdio::null())
        .stdout(Stdio::piped());
    system::keep_ctrl_c_from(&mut qemu);
    qemu
}

/// Starts `qemu` with its USART2 at `mavlink`, and returns it with the line of its UART4.
///
/// # Errors
///
/// When QEMU cannot be started or ends at once, a port being taken.
pub fn power_on(qemu: &mut Command, mavlink: &str) -> Result<(Running, TcpStream)> {
    let receiver_port = TcpListener::bind("127.0.0.1:0")?;
    let gps = format!("tcp:{}", receiver_port.local_addr()?);
    // In QEMU's order: USART1, 2, 3, UART4.
    let mut qemu = Running(
        qemu.args(["-serial", "null", "-serial", mavlink])
            .args(["-serial", "null", "-serial", &gps])
            .spawn()
            .context("cannot start QEMU")?,
    );
    receiver_port.set_nonblocking(true)?;
    loop {
        match receiver_port.accept() {
            Ok((line, _)) => {
                line.set_nonblocking(false)?;
                return Ok((qemu, line));
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
        if qemu.0.try_wait()?.is_some() {
            bail!(
                "QEMU ended by itself, see its message; is its port taken? `--mavlink-port` names another"
            );
        }
        thread::sleep(LOOK_EVERY);
    }
}

/// A QEMU that ends when it is dropped.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
