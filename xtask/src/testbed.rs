//! `testbed`: the paper's experiment, on virtual boards, on QEMU or on real boards.
//!
//! *Purpose.* Builds what each method needs, and runs it where the options ask for it.
//!
//! *Design.* The crate `testbed` knows the experiment. Virtual boards are a heavy tool
//! of their own; here are the boards at the end of a line, which QEMU's are, too:
//! [`board`] talks with one, [`test`](mod@test) with all of them at once, [`emulated`] starts QEMU.
//!
//! *Limits.* QEMU has no input capture, hence no method with the pulse. Real boards run
//! what they were flashed with, one method a call.

mod board;
mod emulated;
mod test;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

use anyhow::{Result, bail};
use clap::error::ErrorKind;
use clap::{Args as _, Command as Clap};
use testbed::{Boards, Case, Link as By, Options, Place, Results, progress};
use variant::Image;

use crate::ctrl_c;
use crate::image::{self, Board, Build};
use crate::link::{Address, Link};
use crate::qemu;
use crate::{system, tool};
use board::Connected;

/// Runs the experiment.
///
/// # Errors
///
/// When something cannot be built or started, or a board is not as it has to be.
pub fn run(options: &Options, arguments: &[OsString]) -> Result<ExitCode> {
    if options.one_line && !matches!(options.boards, Boards::At(_)) {
        wrong_usage("--one-line is about the wiring of real boards: name them with --boards");
    }
    if options.has_load() && options.boards != Boards::Virtual {
        wrong_usage(
            "--load is for virtual boards; a real one has the load that it is built with (PIXCLOCK_LOAD)",
        );
    }
    if options.boards == Boards::Qemu && options.links() != [By::Telem1] {
        wrong_usage("QEMU has no USB, and its boards are asked by TELEM1 alone");
    }
    if matches!(options.boards, Boards::At(_)) && options.links().len() > 1 {
        wrong_usage("real boards are asked by one link: the one that their addresses are");
    }
    if options.one_line && options.first_link() == By::Usb {
        wrong_usage("--one-line is a serial line to all boards, and USB is none");
    }
    match &options.boards {
        Boards::Virtual => on_virtual_boards(options, arguments),
        Boards::Qemu => on_qemu(options),
        Boards::At(addresses) => on_lines(options, addresses),
    }
}

fn wrong_usage(message: &str) -> ! {
    Options::augment_args(Clap::new("cargo xtask testbed"))
        .error(ErrorKind::ValueValidation, message)
        .exit()
}

/// An image of the experiment, built for `board`.
fn build(board: Board, image: Image) -> Result<PathBuf> {
    image::build(Build {
        image,
        ..Build::standard(board)
    })
}

/// The images of `cases`, each once.
fn images(cases: &[Case], boards: usize) -> Vec<Image> {
    let mut images = Vec::new();
    for case in cases {
        for image in (0..boards).map(|index| case.image(index)) {
            if !images.contains(&image) {
                images.push(image);
            }
        }
    }
    images
}

fn on_virtual_boards(options: &Options, arguments: &[OsString]) -> Result<ExitCode> {
    let mut command = Command::new(tool::build("testbed")?);
    command.args(arguments);
    for image in images(&options.cases(), options.crystals.ppb.len()) {
        let path = build(Board::Pixhawk1, image)?;
        command
            .arg("--image")
            .arg(format!("{image}={}", path.display()));
    }
    system::become_it(&mut command)
}

fn on_qemu(options: &Options) -> Result<ExitCode> {
    let mut methods = options.methods();
    methods.retain(|method| !method.has_pulse());
    if methods.is_empty() {
        wrong_usage("QEMU has no input capture, so no board of it can follow a pulse");
    }
    qemu::machine::check()?;
    ctrl_c::catch()?;
    let mut results = Results::new(options, Place::Qemu, conditions(options, "2 on QEMU"))?;
    let each_s = u64::from(options.settle) + u64::from(options.duration);
    let bar = progress::bar(each_s * methods.len() as u64 * options.seeds);
    'all: for method in methods {
        let paths = [0, 1].map(|index| build(Board::Qemu, method.image(index)));
        let [one, other] = paths;
        let paths = [one?, other?];
        for seed in options.seeds() {
            bar.set_message(format!("{method}, seed {seed}"));
            let run = emulated::with_boards(options, seed, &paths, |boards| {
                let prepared = test::prepare(options, boards, &bar)?;
                test::run(options, method, seed, prepared, &bar)
            });
            match run {
                Ok(run) => results.keep(run),
                Err(error) => {
                    results.cut_short(&format!("{method}, seed {seed}: {error:#}"));
                    break 'all;
                }
            }
            if ctrl_c::is_pressed() {
                results.cut_short("it was stopped by Ctrl-C");
                break 'all;
            }
        }
    }
    bar.finish_and_clear();
    results.end(options, ctrl_c::is_pressed())
}

fn on_lines(options: &Options, addresses: &[String]) -> Result<ExitCode> {
    let named = options.named_methods();
    if named.len() > 1 {
        wrong_usage(
            "real boards run the one method that they were flashed for: name one --method, or none",
        );
    }
    let addresses = addresses
        .iter()
        .map(|text| {
            text.parse::<Address>()
                .unwrap_or_else(|wrong| wrong_usage(&wrong))
        })
        .collect::<Vec<_>>();
    ctrl_c::catch()?;
    let what = format!("{} real ones", addresses.len());
    let place = if options.one_line {
        Place::OneLine
    } else {
        Place::Lines
    };
    let mut results = Results::new(options, place, conditions(options, &what))?;
    let boards = connect(options, &addresses)?;
    let bar = progress::bar(u64::from(options.settle) + u64::from(options.duration));
    bar.set_message("waiting for the clocks");
    let prepared = test::prepare(options, boards, &bar)?;
    test::check_systems(&prepared)?;
    let method = test::method_of(&prepared)?;
    if let Some(wanted) = named.first().filter(|wanted| **wanted != method) {
        bail!(
            "these boards run {method}, not {wanted}: flash them with what docs/hardware.md says \
             for it, or ask for --method {method}"
        );
    }
    bar.set_message(method.to_string());
    let seed = options.seed;
    let run = test::run(options, method, seed, prepared, &bar)?;
    if ctrl_c::is_pressed() && run.lasted_s < options.duration {
        results.cut_short("it was stopped by Ctrl-C");
    }
    results.keep(run);
    bar.finish_and_clear();
    results.end(options, ctrl_c::is_pressed())
}

/// Opens the lines to the boards.
fn connect(options: &Options, addresses: &[Address]) -> Result<Vec<Connected>> {
    let mut boards: Vec<Connected> = Vec::new();
    for address in addresses {
        let (name, line) = (address.to_string(), Link::open(address)?);
        let board = match boards.first() {
            Some(first) if options.one_line => Connected::with_lines(name, first.outgoing()?, line),
            _ => Connected::new(name, line)?,
        };
        boards.push(board);
    }
    Ok(boards)
}

fn conditions(options: &Options, boards: &str) -> Vec<(&'static str, String)> {
    let mut conditions = vec![("boards", boards.to_owned())];
    if options.boards == Boards::Qemu {
        conditions.push(("receivers", options.first_receivers().title().to_owned()));
    }
    if options.one_line {
        conditions.push((
            "wiring",
            "all boards receive on the first one's line".to_owned(),
        ));
    }
    conditions.push((
        "test",
        format!(
            "{} s, {} PINGs a second, the first one when every board had been up for {} s and \
             its clock was set",
            options.duration, options.rate, options.settle
        ),
    ));
    conditions
}
