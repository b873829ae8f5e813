//! `cargo xtask testbed --boards virtual`: the paper's experiment on virtual Pixhawks.
//!
//! *Purpose.* Two or more boards, each with a crystal and a receiver of its own, in one
//! world whose laptop sends PINGs to all of them at the same moments.
//!
//! *Design.* The boards get power within the same second, each at a moment of its own.
//! The first PING follows after `--settle`, the same for all methods. Each board has a
//! thread and runs alone, since nothing that it sends changes what the others receive; it
//! is run in steps of a second, so that Ctrl-C takes effect soon. UTC is the world's time
//! at the end of a PING's first byte, and by USB at its leaving. As in the paper, a message ends the test on the
//! boards, and each writes its log to the card in its slot.
//!
//! *Limits.* By USB all boards are at one controller, whose frames of 1 ms they share. Crystals do not wander. The laptop's line takes what the board's own
//! 115200 baud take: a PING that is due while the one before still leaves, waits.

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod board;
mod outgoing;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser};
use indicatif::ProgressBar;
use testbed::{Boards, Case, Options, Place, Results, Run, progress};

use board::Prepared;

/// Ctrl-C was pressed.
static IS_STOPPED: AtomicBool = AtomicBool::new(false);

/// The paper's experiment on virtual Pixhawks.
#[derive(Parser, Debug)]
#[command(name = "testbed", bin_name = "cargo xtask testbed")]
struct Testbed {
    #[command(flatten)]
    options: Options,
}

fn main() -> ExitCode {
    let Testbed { options } = Testbed::parse();
    if options.boards != Boards::Virtual {
        wrong_usage("this program has virtual boards only; `cargo xtask testbed` has the others");
    }
    run(&options.made_quick()).unwrap_or_else(|error| {
        console::print_error!("error: {error:#}");
        ExitCode::FAILURE
    })
}

fn wrong_usage(message: &str) -> ! {
    Testbed::command()
        .error(ErrorKind::ValueValidation, message)
        .exit()
}

/// Every row with every seed.
fn run(options: &Options) -> anyhow::Result<ExitCode> {
    ctrlc::set_handler(|| IS_STOPPED.store(true, Ordering::Relaxed))?;
    let cases = options.cases();
    let mut results = Results::new(options, Place::Virtual, conditions(options))?;
    // The first second is the one in which the boards get power.
    let each_s = 1 + u64::from(options.settle + options.duration + board::AFTERWARDS_S);
    let bar = progress::bar(each_s * cases.len() as u64 * options.seeds);
    println_estimate(options, &cases, each_s);
    'all: for case in cases {
        for seed in options.seeds() {
            bar.set_message(format!("{case}, seed {seed}"));
            match one_run(options, case, seed, &bar) {
                // One that Ctrl-C ended before its first PING has nothing to keep.
                Ok(run) if run.lasted_s == 0 => {}
                Ok(run) => results.keep(run),
                Err(error) => {
                    results.cut_short(&format!("{case}, seed {seed}: {error:#}"));
                    break 'all;
                }
            }
            if IS_STOPPED.load(Ordering::Relaxed) {
                results.cut_short("it was stopped by Ctrl-C");
                break 'all;
            }
        }
    }
    bar.finish_and_clear();
    results.end(options, IS_STOPPED.load(Ordering::Relaxed))
}

/// How fast two boards run on two cores of the machine that the README speaks of, in seconds of theirs in one of
/// ours: without a load, and under one of 100 %, between which it is linear in the time that each takes.
const FASTER_THAN_LIFE: (f64, f64) = (30.0, 3.0);

/// Says how long it takes before it begins.
fn println_estimate(options: &Options, cases: &[Case], each_s: u64) {
    let (idle, busy) = FASTER_THAN_LIFE;
    let of_case = |case: &Case| {
        let load = f64::from(case.load) / 100.0;
        each_s as f64 * ((1.0 - load) / idle + load / busy)
    };
    let s = options.seeds as f64 * cases.iter().map(of_case).sum::<f64>();
    console::print_error!(
        "{} rows of {} seeds: about {:.0} minutes on two cores",
        cases.len(),
        options.seeds,
        (s / 60.0).ceil()
    );
}

/// The boards and their world in the report.
fn conditions(options: &Options) -> Vec<(&'static str, String)> {
    let receivers: Vec<_> = options.receivers.iter().map(|each| each.title()).collect();
    vec![
        (
            "boards",
            format!("{} virtual Pixhawk 1", options.crystals.ppb.len()),
        ),
        ("crystals", format!("{} ppm", options.crystals.text())),
        ("receivers", receivers.join("; ")),
        (
            "seeds",
            match options.seeds().end - 1 {
                last if last == options.seed => format!("{last}"),
                last => format!("{} to {last}", options.seed),
            },
        ),
        (
            "test",
            format!(
                "{} s, {} PINGs a second, the first one {} s after the boards' power",
                options.duration, options.rate, options.settle
            ),
        ),
    ]
}

/// One row with one seed.
fn one_run(options: &Options, case: Case, seed: u64, bar: &ProgressBar) -> anyhow::Result<Run> {
    let settings = (0..).zip(&options.crystals.ppb);
    let boards = settings
        .map(|(index, &crystal_ppb)| Prepared::new(options, case, seed, index, crystal_ppb))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let finished = thread::scope(|scope| {
        let running: Vec<_> = (0..)
            .zip(boards)
            .map(|(index, board)| {
                let bar = (index == 0).then_some(bar);
                scope.spawn(move || board.run(bar, &IS_STOPPED))
            })
            .collect();
        running
            .into_iter()
            .map(|board| {
                let ended = board.join();
                ended.unwrap_or_else(|_| anyhow::bail!("a board's thread panicked"))
            })
            .collect::<anyhow::Result<Vec<_>>>()
    })?;
    Ok(Run {
        case,
        seed,
        lasted_s: finished
            .iter()
            .map(|board| board.lasted_s)
            .min()
            .unwrap_or(0),
        records: finished.into_iter().map(|board| board.record).collect(),
        late_ns: Vec::new(),
    })
}
