//! `cargo xtask bench`: what each job costs on the virtual board, in instructions.
//!
//! *Purpose.* Compares the image that is flashed with its budget, and shows what other
//! projects spend on the same jobs.
//!
//! *Design.* Nothing is timed: one instruction is one cycle there, and every run is
//! the same. Interrupts and functions are metered as they are; what a job costs
//! beyond them is the difference of two runs that differ in that job alone, with
//! every wake-up and poll that it causes. The image has two functions more than the
//! flashed one, readings of the clock, since those are inlined everywhere else.
//!
//! *Limits.* No wait states, no stacking of interrupts, no bus contention: metal
//! takes longer. The other projects' figures were counted on another emulator (QEMU with
//! `-icount`), in the same unit.

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod board;
mod jobs;
mod noise;
mod table;
mod waits;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use virtual_pixhawk::{CyclesPerInstruction, Firmware};

use board::Subject;
use noise::Line;
use table::Row;

/// Instructions of each job, held against the budget.
#[derive(Parser)]
struct Bench {
    /// The image to measure; `cargo xtask bench` builds it and fills this in
    #[arg(long, value_name = "PATH")]
    image: PathBuf,
    /// The one whose TELEM2 speaks STANAG 4586
    #[arg(long, value_name = "PATH")]
    stanag_image: PathBuf,
    /// Print one JSON object instead of the table
    #[arg(long)]
    json: bool,
    /// Cycles that the board's core takes for an instruction
    #[arg(long, value_name = "N", default_value = "1.0")]
    cpi: CyclesPerInstruction,
}

fn main() -> anyhow::Result<ExitCode> {
    let Bench {
        image,
        stanag_image,
        json,
        cpi,
    } = Bench::parse();
    let subject = Subject {
        firmware: Firmware::read(&image)?,
        pace: cpi,
    };
    let (mut rows, byte) = jobs::interrupts_and_readings(&subject)?;
    rows.push(jobs::nav_pvt(&subject)?);
    rows.extend(jobs::estimators(&subject)?);
    rows.push(jobs::ping(&subject)?);
    let gps_noise = noise::costs(&subject, Line::Gps, byte.gps)?;
    let mavlink_noise = noise::costs(&subject, Line::Mavlink, byte.mavlink)?;
    let gps = noise::worst(
        "any byte on the GPS line, beyond its interrupt",
        &gps_noise,
        60.0,
        "crate ublox 454",
    );
    // While an answer to MON-VER or CFG-PRT is awaited, and in noise it always is, each byte is searched twice.
    rows.push(gps.for_now(95.0));
    let mavlink = noise::worst(
        "any byte on the MAVLink line, beyond its interrupt",
        &mavlink_noise,
        100.0,
        "crate mavlink 1550, C library 70",
    );
    // A wake-up is for some ten bytes, looks at three links, and is built for size.
    rows.push(mavlink.for_now(119.0));
    let stanag = Subject {
        firmware: Firmware::read(&stanag_image)?,
        pace: cpi,
    };
    // Both lines' interrupts are one driver's.
    let stanag_noise = noise::costs(&stanag, Line::Stanag, byte.mavlink)?;
    let on_stanag = noise::worst(
        "any byte on a line of STANAG 4586, beyond its interrupt",
        &stanag_noise,
        60.0,
        "",
    );
    // Zeros take 62 already: a call of the node for each byte.
    rows.push(on_stanag.for_now(118.0));
    rows.push(jobs::load(&subject)?);
    let (waits, sections) = waits::all(&subject)?;
    rows.extend(waits);
    let noise = [
        ("GPS", gps_noise),
        ("MAVLink", mavlink_noise),
        ("STANAG", stanag_noise),
    ];
    if json {
        console::print_line!("{}", table::to_json(&rows, &noise, &sections));
    } else {
        table::print(&rows, &noise, &sections);
    }
    Ok(if rows.iter().all(Row::is_allowed) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
