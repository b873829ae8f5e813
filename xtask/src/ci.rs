//! `ci`: everything that has to hold, in one go.
//!
//! *Purpose.* The [steps] one after the other, or side by side where they mostly wait; the
//! first that fails ends it.
//!
//! *Design.* A step in turn writes where we do. Of steps side by side, all that one wrote is printed
//! when it has ended: lines of two steps never mix.

mod checks;
mod steps;

use std::process::{Command, Stdio};
use std::thread;
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail, ensure};

use steps::{Group, Step};

/// Runs every check, and stops at the first that fails.
///
/// # Errors
///
/// Names the step that failed.
pub fn run_all() -> Result<()> {
    let started = Instant::now();
    for group in steps::all()? {
        match group {
            Group::InTurn(steps) => steps.into_iter().try_for_each(in_turn)?,
            Group::SideBySide(steps) => side_by_side(steps)?,
        }
    }
    console::print_line!("all of it holds, after {} s", started.elapsed().as_secs());
    Ok(())
}

/// Runs a step that writes where we do.
fn in_turn(mut step: Step) -> Result<()> {
    console::print_line!("== {}", step.name);
    if is_skipped(&step)? {
        return Ok(());
    }
    let started = Instant::now();
    let ended = match step.check {
        None => crate::image::run(&mut step.command),
        Some(_) => {
            let Ended { output, result } = captured(&mut step);
            print(&output);
            result
        }
    };
    ended.with_context(|| format!("step `{}`", step.name))?;
    console::print_line!("== {}: {} s", step.name, started.elapsed().as_secs());
    Ok(())
}

/// Runs all of `steps` at once, to the end of each.
fn side_by_side(steps: Vec<Step>) -> Result<()> {
    let names: Vec<_> = steps.iter().map(|step| step.name.as_str()).collect();
    console::print_line!("== side by side: {}", names.join("; "));
    let failed = thread::scope(|scope| {
        let mut running = Vec::new();
        for mut step in steps {
            if is_skipped(&step)? {
                continue;
            }
            running.push(scope.spawn(move || {
                let started = Instant::now();
                let Ended { output, result } = captured(&mut step);
                let seconds = started.elapsed().as_secs();
                let verdict = if result.is_ok() { "" } else { ", failed" };
                let heading = format!("== {}: {seconds} s{verdict}\n", step.name);
                // In one write, so that no other step's output gets between.
                print(&[heading.as_bytes(), &output].concat());
                result.with_context(|| format!("step `{}`", step.name))
            }));
        }
        let ended = running.into_iter().map(|step| {
            let ended = step.join();
            ended.unwrap_or_else(|_| bail!("the thread of a step panicked"))
        });
        Ok::<_, anyhow::Error>(ended.filter_map(Result::err).collect::<Vec<_>>())
    })?;
    ensure!(
        failed.is_empty(),
        "{}",
        failed
            .iter()
            .map(|error| format!("{error:#}"))
            .collect::<Vec<_>>()
            .join("\n")
    );
    Ok(())
}

/// Whether `step` needs a program that is not here, which is allowed outside of CI.
fn is_skipped(step: &Step) -> Result<bool> {
    let Some(program) = step.needs else {
        return Ok(false);
    };
    let found = Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    if found.is_ok_and(|status| status.success()) {
        return Ok(false);
    }
    ensure!(
        std::env::var_os("CI").is_none(),
        "step `{}`: {program} is not on PATH, and CI must not go without it",
        step.name
    );
    console::print_line!(
        "SKIPPED: `{}` needs {program}, which is not on PATH",
        step.name
    );
    Ok(true)
}

/// All that a command wrote, and whether it is as it should be.
struct Ended {
    output: Vec<u8>,
    result: Result<()>,
}

/// Runs a step with its output in memory, and puts what it wrote to standard output to its check.
fn captured(step: &mut Step) -> Ended {
    let ended = step.command.stdin(Stdio::null()).output();
    let ended = match ended.with_context(|| format!("cannot start {:?}", step.command)) {
        Ok(ended) => ended,
        Err(error) => {
            return Ended {
                output: Vec::new(),
                result: Err(error),
            };
        }
    };
    let result = match step.check {
        _ if !ended.status.success() => Err(anyhow!("{:?}: {}", step.command, ended.status)),
        Some(check) => check(&String::from_utf8_lossy(&ended.stdout)),
        None => Ok(()),
    };
    // What went wrong stands last, where people look.
    let output = [ended.stdout, ended.stderr].concat();
    Ended { output, result }
}

fn print(output: &[u8]) {
    console::write_bytes(output);
}
