//! `cargo xtask sim`: virtual Pixhawks with their receivers, in real time.
//!
//! *Purpose.* How far each board's clock is from the true time and from the other's, once a second,
//! on boards that programs can talk to.
//!
//! *Design.* All boards share one world, whose time starts when they get power and runs as this
//! host's clock does. Each has a [thread](life) that brings it to the present once a ms, and reports
//! to the one [`Screen`]. Their crystals are off by what was measured on real boards; their
//! receivers differ in their seeds; and each is a MAVLink system of its own, by the one word of the
//! image that is not as it is flashed.
//!
//! *Limits.* A board is up to a ms behind the host, more if the host is busy; the summary says how
//! far it once was. Exit code 1 if after `--duration` a clock had never been set, 2 for a wrong
//! option; a run that Ctrl-C ends is no failure.

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod life;
mod serial_port;
mod setup;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Instant;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser};
use console::{Contents, Screen, SimOptions, Verdict};

use setup::Setup;

/// Virtual Pixhawks with simulated or replayed receivers, in real time.
#[derive(Parser, Debug)]
#[command(name = "sim", bin_name = "cargo xtask sim")]
struct Sim {
    #[command(flatten)]
    options: SimOptions,
}

/// Ctrl-C, or a board that cannot go on.
static ASKED_TO_END: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    let Sim { options } = Sim::parse();
    let setup = Setup::new(&options).unwrap_or_else(|error| {
        let message = format!("{error:#}");
        Sim::command()
            .error(ErrorKind::ValueValidation, message)
            .exit()
    });
    run(&options, &setup).unwrap_or_else(|error| {
        console::print_error!("error: {error:#}");
        ExitCode::FAILURE
    })
}

/// Runs all boards until the end of `--duration` or Ctrl-C.
fn run(options: &SimOptions, setup: &Setup) -> anyhow::Result<ExitCode> {
    ctrlc::set_handler(|| ASKED_TO_END.store(true, Ordering::Relaxed))?;
    // The world begins now: what powering on takes is made up for at once.
    let started = Instant::now();
    let lives = (0..options.boards())
        .map(|index| setup.power_on(index))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let json = options.shared.json;
    if json {
        // Nobody can know these beforehand.
        for port in lives.iter().filter_map(|life| life.usb.as_ref()) {
            console::print_error!("{port}");
        }
    } else {
        for line in setup.announcement(&lives) {
            console::print_line!("{line}");
        }
    }
    let mut screen = Screen::new(Contents {
        boards: lives.len(),
        errors: options.shared.ubx.is_none(),
        verbose: options.shared.verbose,
    });
    let (sender, reports) = channel();
    let endings = thread::scope(|scope| {
        let running: Vec<_> = lives
            .into_iter()
            .map(|life| {
                let sender = sender.clone();
                scope.spawn(move || {
                    let ended = life.live(started, &sender, &ASKED_TO_END);
                    if ended.is_err() {
                        ASKED_TO_END.store(true, Ordering::Relaxed);
                    }
                    ended
                })
            })
            .collect();
        // The reports end when each board's sender is gone.
        drop(sender);
        console::show(&mut screen, &reports, None, json);
        running
            .into_iter()
            .map(|board| {
                let ended = board.join();
                ended.unwrap_or_else(|_| anyhow::bail!("a board's thread panicked"))
            })
            .collect::<anyhow::Result<Vec<_>>>()
    })?;
    console::print_summary(&screen, &endings, json);
    let never_set = screen.verdict() == Verdict::NeverSet;
    let came_to_its_end = !ASKED_TO_END.load(Ordering::Relaxed);
    Ok(ExitCode::from(u8::from(never_set && came_to_its_end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_options_have_no_conflicting_names() {
        Sim::command().debug_assert();
    }

    #[test]
    fn wrong_options_have_the_exit_code_of_wrong_usage() {
        let parsed = Sim::try_parse_from(["sim", "--boards", "none"]);
        assert_eq!(parsed.map(drop).unwrap_err().exit_code(), 2);
    }
}
