//! `clients`: MAVProxy and MAVSDK beside each other against `sim`.
//!
//! *Design.* A [`venv`] with the pinned releases; one board; the script of
//! `host-tests/clients`, which lets both connect, read version and parameters, ping, and download a
//! log, and watches that neither asks for anything again and again.
//!
//! *Limits.* What cannot be had here is SKIPPED, in CI too: these are programs of other people, for
//! some machines only.

use std::net::{Ipv4Addr, TcpListener};
use std::process::Command;

use anyhow::{Context, Result};

use crate::image;
use crate::venv::{self, Board, PYMAVLINK};

/// MAVProxy draws in a whole desktop unless its dependencies are named here.
const PACKAGES: [&[&str]; 2] = [
    &[PYMAVLINK, "pyserial", "defusedxml", "mavsdk==3.17.4"],
    &["--no-deps", "MAVProxy==1.8.75"],
];

const PORT: u16 = 5_792;
/// How long the board runs, in s: the script ends it earlier.
const DURATION_S: &str = "240";

/// Lets both meet a board.
///
/// # Errors
///
/// When one of them did not get what it wanted, or wants something for ever.
pub fn run() -> Result<()> {
    let python = match venv::with("clients-venv", "mavsdk, MAVProxy", &PACKAGES) {
        Ok(python) => python,
        Err(error) => {
            console::print_line!("SKIPPED: MAVProxy and MAVSDK could not be installed: {error:#}");
            return Ok(());
        }
    };
    let mut board = Board::start("sim", &PORT.to_string(), DURATION_S)?;
    let met = image::run(
        Command::new(&python)
            .arg(image::root().join("host-tests/clients/meet.py"))
            .arg(PORT.to_string()),
    );
    board.stop();
    // The signal went to the one process that was started.
    TcpListener::bind((Ipv4Addr::LOCALHOST, PORT))
        .context("sim was sent a signal, and its port is still taken")?;
    met.context("MAVProxy and MAVSDK")
}
