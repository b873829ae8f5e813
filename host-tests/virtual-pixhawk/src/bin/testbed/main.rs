//! `cargo xtask testbed --boards virtual`: the paper's experiment on virtual Pixhawks.
//!
//! *Purpose.* Two or more boards, each with a crystal and a receiver of its own, in one
//! world whose laptop sends PINGs to all of them at the same moments.
//!
//! *Design.* The boards get power within the same second, each at a moment of its own.
//! The first PING follows after `--settle`, the same for all methods. Each board has a
//! thread and runs alone, since nothing that it sends changes what the others receive; it
//! is run in steps of a second, so that Ctrl-C takes effect soon. UTC is the world's time
//! at the end of a PING's first byte. As in the paper, a message ends the test on the
//! boards, and each writes its log to the card in its slot.
//!
//! *Limits.* Crystals do not wander. The laptop's line takes what the board's own
//! 115200 baud take: a PING that is due while the one before still leaves, waits.

mod board;
mod outgoing;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser};
use indicatif::ProgressBar;
use testbed::{Boards, Method, Options, Place, Results, Run, progress};

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
    run(&options).unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

fn wrong_usage(message: &str) -> ! {
    Testbed::command()
        .error(ErrorKind::ValueValidation, message)
        .exit()
}

/// Every method with every seed.
fn run(options: &Options) -> anyhow::Result<ExitCode> {
    ctrlc::set_handler(|| IS_STOPPED.store(true, Ordering::Relaxed))?;
    let methods = options.methods();
    let mut results = Results::new(options, Place::Virtual, conditions(options))?;
    // The first second is the one in which the boards get power.
    let each_s = 1 + u64::from(options.settle + options.duration + board::AFTERWARDS_S);
    let bar = progress::bar(each_s * methods.len() as u64 * options.seeds);
    'all: for method in methods {
        for seed in options.seeds() {
            bar.set_message(format!("{method}, seed {seed}"));
            match one_run(options, method, seed, &bar) {
                // One that Ctrl-C ended before its first PING has nothing to keep.
                Ok(run) if run.lasted_s == 0 => {}
                Ok(run) => results.keep(run),
                Err(error) => {
                    results.cut_short(&format!("{method}, seed {seed}: {error:#}"));
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

/// The boards and their world in the report.
fn conditions(options: &Options) -> Vec<(&'static str, String)> {
    vec![
        (
            "boards",
            format!("{} virtual Pixhawk 1", options.crystals.ppb.len()),
        ),
        ("crystals", format!("{} ppm", options.crystals.text())),
        ("receivers", options.receiver.title().to_owned()),
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

/// One method with one seed.
fn one_run(options: &Options, method: Method, seed: u64, bar: &ProgressBar) -> anyhow::Result<Run> {
    let settings = (0..).zip(&options.crystals.ppb);
    let boards = settings
        .map(|(index, &crystal_ppb)| Prepared::new(options, method, seed, index, crystal_ppb))
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
        method,
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
