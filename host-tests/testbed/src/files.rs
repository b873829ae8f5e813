//! The folder with the results.
//!
//! *Purpose.* Every sample of every board, every difference, the summary and the
//! report, as files that other programs open.
//!
//! *Design.* `METHOD/seed-N/samples-1.csv` (a file a board), the board's own `log-1.csv`
//! where there is one, and `difference.csv` are written as soon as a run is over; at the
//! end follow `summary.json`, `report.html` and its figures, `figures/METHOD.svg`. On virtual
//! boards nothing in them depends on the hour or on the machine. When a file cannot be
//! written, the others still are; and all of it goes to the system's folder for temporary
//! files instead, if that takes it.
//!
//! *Limits.* Files of an earlier experiment in the same folder are overwritten where
//! they have the same name; those of other methods and seeds stay.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use console::write_file;
use serde_json::{Value, json};

use crate::latency::{Latency, beyond_telem1, latencies};
use crate::link::Link;
use crate::record::Record;
use crate::run::{Experiment, Run};
use crate::statistics::{Estimate, Spread};
use crate::{bounds, report};

/// Where results go.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// The folder `path`, made if it is not there.
    ///
    /// # Errors
    ///
    /// When it cannot be made, or takes no file.
    pub fn create(path: &Path) -> Result<Self> {
        // An earlier experiment's files stay as they are until there are new ones.
        let probe = path.join("can-be-written");
        fs::create_dir_all(path)
            .map_err(Into::into)
            .and_then(|()| write_file(&probe, b"yes\n"))
            .and_then(|()| Ok(fs::remove_file(&probe)?))
            .with_context(|| {
                format!(
                    "no results can be written to {}; name another folder with --out",
                    path.display()
                )
            })?;
        Ok(Self {
            path: path.to_owned(),
        })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a run's samples and differences.
    ///
    /// # Errors
    ///
    /// Names the first file that could not be written; the others are.
    pub fn write_run(&self, run: &Run) -> Result<()> {
        let folder = self.path.join(run.case.folder());
        let folder = folder.join(format!("seed-{}", run.seed));
        let mut written = fs::create_dir_all(&folder).map_err(Into::into);
        for (number, record) in (1..).zip(&run.records) {
            let file = folder.join(format!("samples-{number}.csv"));
            written = written.and(write_csv(&file, |csv| samples(csv, record)));
            let file = folder.join(format!("log-{number}.csv"));
            written = written.and(match &record.own_log {
                Some(log) => write_file(&file, log),
                None => remove(&file),
            });
        }
        let file = folder.join("difference.csv");
        written.and(write_csv(&file, |csv| differences(csv, run)))
    }

    /// Writes summary, report and the report's figures.
    ///
    /// # Errors
    ///
    /// Names the first file that could not be written; the others are.
    pub fn write_summary(&self, experiment: &Experiment) -> Result<()> {
        let summary = format!("{:#}\n", summary(experiment));
        let summary = write_file(&self.path.join("summary.json"), summary.as_bytes());
        let report = report::html(experiment)?;
        let report = write_file(&self.path.join("report.html"), report.as_bytes());
        let figures = self.path.join("figures");
        let mut written = fs::create_dir_all(&figures).map_err(Into::into);
        for run in report::first_runs(experiment) {
            let file = figures.join(format!("{}.svg", run.case.folder()));
            written = written.and(write_file(&file, report::picture(run)?.as_bytes()));
        }
        summary.and(report).and(written)
    }

    /// Writes all of it once more, into the system's folder for temporary files.
    ///
    /// # Errors
    ///
    /// When that cannot be written either.
    pub fn rescue(experiment: &Experiment) -> Result<PathBuf> {
        let name = format!("pixclock-testbed-{}", std::process::id());
        let folder = Self::create(&std::env::temp_dir().join(name))?;
        for run in &experiment.runs {
            folder.write_run(run)?;
        }
        folder.write_summary(experiment)?;
        Ok(folder.path)
    }
}

/// Takes away what an earlier run has left.
fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
    .with_context(|| format!("cannot write {}", path.display()))
}

fn write_csv(
    path: &Path,
    rows: impl FnOnce(&mut csv::Writer<Vec<u8>>) -> csv::Result<()>,
) -> Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    rows(&mut csv)?;
    let bytes = csv.into_inner().map_err(csv::IntoInnerError::into_error)?;
    write_file(path, &bytes)
}

fn samples(csv: &mut csv::Writer<Vec<u8>>, record: &Record) -> csv::Result<()> {
    csv.write_record([
        "sequence",
        "sent_ns",
        "board_time_ns",
        "source",
        "round_trip_ns",
        "error_to_utc_ns",
        "verdict",
    ])?;
    for sample in &record.samples {
        let error = sample.error_ns.map(|ns| ns.to_string());
        csv.write_record([
            sample.sequence.to_string(),
            sample.sent_ns.to_string(),
            sample.board_ns.to_string(),
            if sample.is_from_log { "log" } else { "answer" }.to_owned(),
            sample.round_trip_ns.to_string(),
            error.unwrap_or_default(),
            sample.verdict.to_string(),
        ])?;
    }
    Ok(())
}

fn differences(csv: &mut csv::Writer<Vec<u8>>, run: &Run) -> csv::Result<()> {
    csv.write_record(["sequence", "sent_ns", "board", "less_board_1_ns"])?;
    for difference in run.differences() {
        csv.write_record([
            difference.sequence.to_string(),
            difference.at_ns.to_string(),
            (difference.board + 1).to_string(),
            difference.ns.to_string(),
        ])?;
    }
    Ok(())
}

/// The summary: what was asked for, and each method's figures. \[ns\]
#[must_use]
pub fn summary(experiment: &Experiment) -> Value {
    let methods: Vec<Value> = experiment
        .cases()
        .into_iter()
        .map(|case| {
            let method = case.method;
            let runs: Vec<Value> = experiment.runs_of(case).map(run_value).collect();
            json!({
                "method": method.to_string(),
                "load_percent": case.load,
                "receivers": case.receivers.name(),
                "link": case.link.name(),
                "arrival_unknown_ns": case.link.unknown_ns(),
                "paper_mean_ns": method.paper_ms().map(|ms| (ms * 1e6).round()),
                "mean_of_runs": experiment.estimate(case).map(estimate_value),
                "difference": experiment.spread(case).map(spread_value),
                "error_to_utc":
                    experiment.errors(case).into_iter().map(spread_value).collect::<Vec<_>>(),
                "sending_to_stamp":
                    latencies(experiment, case).into_iter().map(latency_value).collect::<Vec<_>>(),
                "stamp_less_telem1": beyond_telem1(experiment, case)
                    .filter(|_| case.link != Link::Telem1)
                    .map(latency_value),
                "reduction": experiment.reduction(case),
                "runs": runs,
            })
        })
        .collect();
    let conditions: serde_json::Map<_, _> = experiment
        .conditions
        .iter()
        .map(|(name, value)| ((*name).to_owned(), value.clone().into()))
        .collect();
    let bounds: Vec<Value> = bounds::judge(experiment)
        .iter()
        .map(|bound| json!({ "bound": bound.text, "measured": bound.measured, "holds": bound.holds }))
        .collect();
    json!({
        "command": experiment.command,
        "conditions": conditions,
        "cut_short": experiment.cut_short,
        "methods": methods,
        "bounds": bounds,
    })
}

fn run_value(run: &Run) -> Value {
    let boards: Vec<Value> = run
        .records
        .iter()
        .map(|record| {
            let trips = record.samples.iter().map(|sample| sample.round_trip_ns);
            let delays = record.send_delays_ns.iter().copied();
            json!({
                "name": record.name,
                "asked": record.asked,
                "answered": record.samples.len(),
                "line_full": record.line_full,
                "lost_ticks": record.lost_ticks,
                "overruns": record.overruns,
                "used": record.good().count(),
                "in_own_log": record.samples.iter().filter(|s| s.is_from_log).count(),
                "round_trip": Spread::of(trips).map(spread_value),
                "send_delay": Spread::of(delays).map(spread_value),
                "anomalies": record.anomalies.iter().map(ToString::to_string).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "seed": run.seed,
        "lasted_s": run.lasted_s,
        "difference": run.spread().map(spread_value),
        "late_ns": run.late_ns,
        "boards": boards,
    })
}

fn spread_value(spread: Spread) -> Value {
    json!({
        "count": spread.count,
        "mean_ns": spread.mean,
        "p50_ns": spread.p50,
        "p95_ns": spread.p95,
        "p99_ns": spread.p99,
        "max_ns": spread.max,
    })
}

fn latency_value(latency: Latency) -> Value {
    json!({
        "count": latency.count,
        "least_ns": latency.least,
        "mean_ns": latency.mean,
        "p95_ns": latency.p95,
        "greatest_ns": latency.greatest,
        "deviation_ns": latency.deviation,
    })
}

fn estimate_value(estimate: Estimate) -> Value {
    json!({
        "mean_ns": estimate.mean,
        "confidence_95_ns": estimate.half_width,
        "runs": estimate.runs,
    })
}
