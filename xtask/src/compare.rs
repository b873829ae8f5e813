//! `compare`: our clock and other people's in the simulated world.
//!
//! *Purpose.* The figures of every case over many seeds, the verdicts of the bounds,
//! and the check of both against the table that is kept in `docs/results`.
//!
//! *Design.* The crate `comparison` measures; here is what is asked for and printed.
//! The kept table is what `--check` and `--renew` print: all cases, all seeds.
//!
//! *Limits.* The speed that is printed at the end is this machine's.

use std::io::IsTerminal;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use comparison::bounds::judge;
use comparison::case::{self, CASES, Case, FIGURES};
use comparison::figures::Figures;
use comparison::{campaign, report};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;

/// Where the table is kept, from the workspace's root.
const KEPT: &str = "docs/results/compare.txt";

/// What a comparison can be asked for.
#[derive(Args)]
pub struct Options {
    /// How many seeds; no constant was tuned with them
    #[arg(long, value_name = "N", default_value_t = FIGURES.end - FIGURES.start, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// Tune: seeds from 0 on instead
    #[arg(long)]
    tuning: bool,
    /// Only these cases; `--list` names them
    #[arg(long = "case", value_name = "NAME", num_args = 1.., value_parser = find)]
    cases: Vec<&'static Case>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Name the cases
    #[arg(long)]
    list: bool,
    /// Fail if a bound breaks or the table is not the one that is kept
    #[arg(long, conflicts_with_all = ["seeds", "cases", "tuning", "renew"])]
    check: bool,
    /// Keep this table
    #[arg(long, conflicts_with_all = ["seeds", "cases", "tuning"])]
    renew: bool,
}

impl Options {
    /// The seeds of each case.
    fn seeds(&self) -> Range<u64> {
        let kind = if self.tuning { case::TUNING } else { FIGURES };
        kind.start..kind.start + self.seeds
    }

    /// The cases that are asked for, or all.
    fn cases(&self) -> Vec<&'static Case> {
        if self.cases.is_empty() {
            return CASES.iter().collect();
        }
        self.cases.clone()
    }
}

fn find(name: &str) -> Result<&'static Case, String> {
    case::find(name).ok_or_else(|| {
        let names: Vec<_> = CASES.iter().map(|case| case.name).collect();
        format!("the cases are {}", names.join(", "))
    })
}

/// Compares, and fails if a bound breaks.
///
/// # Errors
///
/// With `--check`, when the kept table is another one.
pub fn run(options: &Options) -> Result<ExitCode> {
    if options.list {
        for case in &CASES {
            console::print_line!("{:<14} {}", case.name, case.title);
        }
        return Ok(ExitCode::SUCCESS);
    }
    let (seeds, cases) = (options.seeds(), options.cases());
    let total: usize = cases
        .iter()
        .map(|case| campaign::trials(case, &seeds))
        .sum();
    let progress = bar(total as u64);
    let started = Instant::now();
    let mut text = heading(options.seeds, seeds.start);
    let mut all = Vec::new();
    for case in cases {
        progress.set_message(case.name);
        let figures = campaign::run(case, &seeds, &|| progress.inc(1))
            .with_context(|| format!("{}: there are no seeds", case.name))?;
        let section = format!("\n{}", report::text(&figures));
        text.push_str(&section);
        if !options.json {
            progress.suspend(|| console::print_text!("{section}"));
        }
        all.push(figures);
    }
    progress.finish_and_clear();
    let took_s = started.elapsed().as_secs_f64();
    let simulated_s: f64 = all.iter().map(|figures| figures.simulated_s() as f64).sum();
    if options.json {
        let cases: Vec<_> = all.iter().map(report::value).collect();
        console::print_line!(
            "{}",
            json!({ "seeds": [seeds.start, seeds.end], "cases": cases })
        );
    }
    console::print_error!(
        "{total} trials in {took_s:.1} s: boards run {:.0} times as fast as time",
        simulated_s / took_s
    );
    if options.renew {
        keep(&text)?;
    }
    if options.check {
        compare_with_kept(&text)?;
    }
    Ok(verdict(&all))
}

/// Names the cases whose bounds are broken, and how many.
fn verdict(all: &[Figures]) -> ExitCode {
    let mut code = ExitCode::SUCCESS;
    for figures in all {
        let verdicts = judge(figures);
        let broken = verdicts.iter().filter(|verdict| !verdict.holds).count();
        if broken > 0 {
            let (name, all) = (figures.case.name, verdicts.len());
            console::print_error!("{name}: {broken} of {all} bounds are broken");
            code = ExitCode::FAILURE;
        }
    }
    code
}

fn heading(count: u64, first: u64) -> String {
    let last = first + count - 1;
    format!(
        "The difference between two equal boards' published times.\n\
         Seeds {first} to {last}; made by `cargo xtask compare --renew`, checked by\n\
         `cargo xtask compare --check`. 'worst' is the largest mean of a trial,\n\
         'converged' when 95 % of the trials had come within 1 ms (harsh: 4 ms,\n\
         pulse: 1 us) and stayed there until 180 s.\n"
    )
}

fn bar(total: u64) -> ProgressBar {
    let bar = ProgressBar::new(total);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} ({eta})");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

fn kept() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(KEPT)
}

fn keep(text: &str) -> Result<()> {
    let path = kept();
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    console::write_file(&path, text.as_bytes())
}

fn compare_with_kept(text: &str) -> Result<()> {
    let before = std::fs::read_to_string(kept()).with_context(|| format!("cannot read {KEPT}"))?;
    let pairs = before.lines().zip(text.lines());
    let differs = (1..).zip(pairs).find(|(_, (before, now))| before != now);
    if let Some((number, (before, now))) = differs {
        bail!(
            "{KEPT}:{number} says\n{before}\nbut it is\n{now}\n\
             `cargo xtask compare --renew` keeps the new table"
        );
    }
    if before.lines().count() != text.lines().count() {
        bail!(
            "{KEPT} has another number of lines; `cargo xtask compare --renew` keeps the new table"
        );
    }
    Ok(())
}
