//! Every verb that a person or CI needs: `cargo xtask VERB`.
//!
//! *Design.* One file a verb; here is only who is called. What takes long to build
//! is a program of its own that a verb starts ([`tool`]).
//!
//! *Limits.* Exit codes: 0 = did it, 1 = found a failure, 2 = wrong usage.

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod bench;
mod board_test;
mod card;
mod card_faults;
mod ci;
mod clients;
mod compare;
mod csv_text;
mod ctrl_c;
mod curve;
mod deps;
mod device_id;
mod devices;
mod flash;
mod gateway;
mod image;
mod integrity;
mod link;
mod ping;
mod px4;
mod pymavlink;
mod qemu;
mod qemu_ticks;
mod replay;
mod sim;
mod size;
mod status;
mod synapse;
mod system;
mod testbed;
mod tool;
mod upload;
mod venv;

use std::ffi::OsString;
use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

/// pixclock's tools. Without a verb (bare `cargo run`): flash a Pixhawk 1 by
/// probe-rs and show its log
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct CommandLine {
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Virtual Pixhawks in real time: how far their clocks are off, and apart
    Sim(console::SimOptions),
    /// The same on QEMU, the second opinion
    Qemu(qemu::QemuOptions),
    /// Count the tick's interrupts on QEMU, at all four settings
    QemuTicks,
    /// Ask nodes for their time, and how far they are apart
    Ping(ping::Options),
    /// A board's line that speaks STANAG 4586, in a group of datagrams
    Gateway(gateway::Options),
    /// Put a recording of a receiver through the parser and the clock
    Replay(replay::Options),
    /// Our clock and other people's in the simulated world, beside the bounds
    Compare(compare::Options),
    /// Count misleading readings over random schedules of faults
    Integrity(integrity::Options),
    /// The paper's experiment, on virtual boards, on QEMU or on real boards
    Testbed(::testbed::Options),
    /// What each job costs, in instructions, beside its budget
    Bench(bench::Options),
    /// What the image takes of flash and RAM
    Size {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// Write the firmware file `pixclock.px4`, for `upload` and for ground stations
    Px4(px4::Options),
    /// Put firmware on a board through its bootloader, over USB or a serial line, without a probe
    Upload(upload::Options),
    /// Show all that a running board says of itself: its status line, over MAVLink
    Status(status::Options),
    /// Check who depends on whom: no forbidden dependency, no circle of files
    Deps,
    /// What curves between waypoints save, and what a clock is worth on them
    Curve(curve::Options),
    /// What a running board has: each device with its id and how it is, over MAVLink
    Devices(devices::Options),
    /// What PX4's device ids mean, and the ids of what has a name
    DeviceId(device_id::Options),
    /// Run the tests of the flashed image on the virtual board
    BoardTest {
        /// Cycles an instruction, instead of 1.0 and 1.6
        #[arg(long = "cpi", value_name = "N,N", value_delimiter = ',')]
        paces: Vec<String>,
        /// Handed to `cargo test`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// What a board makes of a memory card, or of an image of one
    Card(card::Options),
    /// What becomes of damaged cards, and of cards that are pulled
    CardFaults(card_faults::Options),
    /// Ask `sim` and `qemu` for their time with pymavlink, in a venv of its own
    Pymavlink,
    /// Let MAVProxy and MAVSDK meet `sim`, beside each other, in a venv of their own
    Clients,
    /// Let `synapse-cdm` judge what a board says in STANAG 4586, in a venv of its own
    Synapse,
    /// Everything that has to hold
    Ci,
}

fn main() -> ExitCode {
    let ended = run();
    if console::is_output_gone() {
        return ExitCode::FAILURE;
    }
    ended.unwrap_or_else(|error| {
        console::print_error!("error: {error:#}");
        ExitCode::FAILURE
    })
}

fn run() -> Result<ExitCode> {
    let Some(verb) = CommandLine::parse().verb else {
        return done(flash::flash());
    };
    match verb {
        Verb::Sim(options) => sim::run(&options, &own_arguments()),
        Verb::Qemu(options) => qemu::run(&options),
        Verb::QemuTicks => done(qemu_ticks::check()),
        Verb::Ping(options) => ping::run(&options),
        Verb::Gateway(options) => done(gateway::run(&options)),
        Verb::Replay(options) => replay::run(&options),
        Verb::Compare(options) => compare::run(&options),
        Verb::Integrity(options) => integrity::run(&options),
        Verb::Testbed(options) => testbed::run(&options, &own_arguments()),
        Verb::Bench(options) => bench::run(&options),
        Verb::Size { json } => done(size::check(json)),
        Verb::Px4(options) => done(px4::write(&options)),
        Verb::Upload(options) => done(upload::run(&options)),
        Verb::Status(options) => done(status::run(&options)),
        Verb::Deps => done(deps::check()),
        Verb::Curve(options) => done(curve::run(&options)),
        Verb::Devices(options) => done(devices::run(&options)),
        Verb::DeviceId(options) => Ok(device_id::run(&options)),
        Verb::BoardTest { paces, arguments } => done(board_test::run(&paces, &arguments)),
        Verb::Card(options) => card::run(&options),
        Verb::CardFaults(options) => done(card_faults::run(&options)),
        Verb::Pymavlink => done(pymavlink::run()),
        Verb::Clients => done(clients::run()),
        Verb::Synapse => done(synapse::run()),
        Verb::Ci => done(ci::run_all()),
    }
}

/// The arguments after the verb, for the tool that reads the same options.
fn own_arguments() -> Vec<OsString> {
    std::env::args_os().skip(2).collect()
}

fn done(result: Result<()>) -> Result<ExitCode> {
    result.map(|()| ExitCode::SUCCESS)
}
