//! How an experiment ends.
//!
//! *Purpose.* Runs are kept as they come, and at the end all of it is written, printed and
//! judged, alike for virtual and for real boards.
//!
//! *Design.* [`Results`] holds the runs and the folder. A file that cannot be written ends
//! nothing: what was measured is written to the system's folder for temporary files at
//! the end, and both are printed.
//!
//! *Limits.* It prints to standard output, and what is wrong to standard error.

use std::fmt::Write as _;
use std::process::ExitCode;

use anyhow::Result;

use crate::files::{Folder, summary};
use crate::options::Options;
use crate::report::estimate_text;
use crate::run::{Experiment, Place, Run};
use crate::units::with_unit;
use crate::{bounds, links, report};

/// The runs of an experiment while they are made.
#[derive(Debug)]
pub struct Results {
    folder: Folder,
    experiment: Experiment,
    not_written: Option<anyhow::Error>,
}

impl Results {
    /// One that keeps the runs of the experiment that `options` ask for.
    ///
    /// # Errors
    ///
    /// When the folder for the results takes no file.
    pub fn new(
        options: &Options,
        place: Place,
        conditions: Vec<(&'static str, String)>,
    ) -> Result<Self> {
        Ok(Self {
            folder: Folder::create(&options.out)?,
            experiment: Experiment {
                command: options.command(),
                rate_hz: options.rate,
                place,
                conditions,
                runs: Vec::new(),
                cut_short: None,
            },
            not_written: None,
        })
    }

    /// Keeps a run.
    pub fn keep(&mut self, run: Run) {
        if let Err(error) = self.folder.write_run(&run) {
            self.not_written.get_or_insert(error);
        }
        self.experiment.runs.push(run);
    }

    /// There are no more runs, because of `why`.
    pub fn cut_short(&mut self, why: &str) {
        self.experiment.cut_short.get_or_insert(why.to_owned());
    }

    /// Writes, prints and judges. The exit code is a success if everything went well.
    ///
    /// # Errors
    ///
    /// When nothing can be written anywhere, or a figure cannot be drawn.
    pub fn end(self, options: &Options, by_ctrl_c: bool) -> Result<ExitCode> {
        let Self {
            folder,
            experiment,
            mut not_written,
        } = self;
        if let Err(error) = folder.write_summary(&experiment) {
            not_written.get_or_insert(error);
        }
        if options.json {
            console::print_line!("{:#}", summary(&experiment));
        } else {
            console::print_text!("{}", text(&experiment));
        }
        for run in &experiment.runs {
            for (board, anomaly) in run.anomalies() {
                console::print_error!("{}, seed {}: {board}: {anomaly}", run.case, run.seed);
            }
        }
        if let Some(why) = &experiment.cut_short {
            console::print_error!(
                "ended before its time: {why}; what was measured until then is kept"
            );
        }
        let mut kept_in = folder.path().to_owned();
        if let Some(error) = &not_written {
            kept_in = Folder::rescue(&experiment)?;
            console::print_error!(
                "{error:#}; everything was written to {} instead",
                kept_in.display()
            );
        }
        if !options.json {
            console::print_line!("the report: {}", kept_in.join("report.html").display());
        }
        let broken = bounds::judge(&experiment).iter().any(|bound| !bound.holds);
        let spoiled = experiment
            .runs
            .iter()
            .any(|run| run.anomalies().next().is_some())
            || experiment.runs.iter().any(|run| run.spread().is_none());
        let went_well = not_written.is_none()
            && !spoiled
            && (by_ctrl_c || experiment.cut_short.is_none())
            && !(options.check && broken);
        Ok(ExitCode::from(u8::from(!went_well)))
    }
}

/// The table, for a terminal.
#[must_use]
pub fn text(experiment: &Experiment) -> String {
    let cases = experiment.cases();
    let widest = cases.iter().map(|case| case.to_string().len()).max();
    let width = widest.unwrap_or(0);
    let mut out = format!(
        "{:<width$} {:>9} {:>22} {:>9} {:>9} {:>8} {:>8} {:>8} {:>7}\n",
        "method",
        "paper",
        "mean difference",
        "95 %",
        "largest",
        "pairs",
        "ticks",
        "PINGs",
        "less by"
    );
    for case in cases {
        let paper = case
            .method
            .paper_ms()
            .map_or_else(String::new, |ms| format!("{ms:.2} ms"));
        let mean = experiment
            .estimate(case)
            .map_or_else(|| "no pair".to_owned(), estimate_text);
        let spread = experiment.spread(case);
        let size = |pick: fn(&crate::Spread) -> u64| {
            spread
                .as_ref()
                .map_or_else(String::new, |spread| with_unit(pick(spread) as f64))
        };
        let lost = |count: fn(&Run) -> Option<u32>| {
            let all: Option<u32> = experiment.runs_of(case).map(count).sum();
            all.map_or_else(String::new, |lost| lost.to_string())
        };
        let missing: usize = experiment.runs_of(case).map(Run::missing).sum();
        let reduction = experiment.reduction(case);
        let _ = writeln!(
            out,
            "{:<width$} {paper:>9} {mean:>22} {:>9} {:>9} {:>8} {:>8} {missing:>8} {:>7}",
            case.to_string(),
            size(|spread| spread.p95),
            size(|spread| spread.max),
            spread.as_ref().map_or(0, |spread| spread.count),
            lost(Run::lost_ticks),
            reduction.map_or_else(String::new, |share| format!("{:.1} %", share * 100.0)),
        );
    }
    out += "(ticks: those lost; PINGs: those unanswered; less by: than the default under the same load)\n";
    if experiment.place != Place::Virtual {
        let _ = write!(out, "{}", report::noise_text(experiment));
    }
    out += &links::text(experiment);
    for run in experiment.runs.iter().filter(|run| run.missing() > 0) {
        let _ = write!(
            out,
            "{}, seed {}: {} answers missing",
            run.case,
            run.seed,
            run.missing()
        );
        let _ = match run.line_full() {
            Some(full) => writeln!(out, ", {full} frames not sent because the line was full"),
            None => writeln!(out),
        };
    }
    for bound in bounds::judge(experiment) {
        let verdict = if bound.holds { "holds" } else { "BROKEN" };
        let _ = writeln!(
            out,
            "{verdict}: {} (measured: {})",
            bound.text, bound.measured
        );
    }
    out
}
