//! `replay` of a CSV of arrivals: every clock on what a real board logged.
//!
//! *Purpose.* A table of how each clock's published time spreads about the best
//! smooth line, and a picture.
//!
//! *Design.* [`comparison::trace`] measures; here it is printed.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result};
use comparison::trace::{Replayed, Trace};
use serde_json::json;
use utc_clock::{Settings, UtcNanos};

use super::options::Options;
use super::plot;

/// Replays the trace `content`.
///
/// # Errors
///
/// When it is a bad one, or the picture cannot be written.
pub fn run(options: &Options, content: &[u8]) -> Result<ExitCode> {
    let path = options.file.display();
    let floor = options
        .floor_utc_ns()?
        .map_or(Settings::DATE_FLOOR, UtcNanos);
    let trace = Trace::parse_from(&String::from_utf8_lossy(content), floor)
        .with_context(|| format!("{path} is no trace of arrivals"))?;
    let replayed = trace.replay();
    let svg = options.svg()?;
    let title = options.file.file_stem().unwrap_or_default();
    plot::draw(&replayed, &title.to_string_lossy(), &svg)
        .with_context(|| format!("cannot draw {}", svg.display()))?;
    if options.json {
        console::print_line!("{}", value(&trace, &replayed, &svg));
    } else {
        print(&trace, &replayed);
        console::print_line!("the picture is in {}", svg.display());
    }
    Ok(match replayed.violation {
        None => ExitCode::SUCCESS,
        Some(violation) => {
            console::print_error!("our clock violates an invariant: {violation}");
            ExitCode::FAILURE
        }
    })
}

fn print(trace: &Trace, replayed: &Replayed) {
    let rows = &trace.rows;
    let lasts = rows[rows.len() - 1].arrival - rows[0].arrival;
    console::print_line!("{} arrivals in {:.1} s", rows.len(), lasts as f64 * 1e-9);
    if trace.lifted_days > 0 {
        console::print_line!(
            "their dates are older than any that the clock believes: lifted by {} days",
            trace.lifted_days
        );
    }
    console::print_line!("published time about the best smooth line, in ms:");
    console::print_line!(
        "{:>11} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "",
        "ahead",
        "mean",
        "p50",
        "p95",
        "p99",
        "max"
    );
    let ms = |ns: f64| format!("{:.3}", ns / 1e6);
    for track in &replayed.tracks {
        let Some((ahead, spread)) = track.spread() else {
            console::print_line!("{:>11} never set", track.name);
            continue;
        };
        let [p50, p95, p99, max] =
            [spread.p50, spread.p95, spread.p99, spread.max].map(|ns| ms(f64::from(ns)));
        console::print_line!(
            "{:>11} {:>9} {:>9} {p50:>9} {p95:>9} {p99:>9} {max:>9}",
            track.name,
            ms(ahead as f64),
            ms(spread.mean)
        );
    }
    let counters = &replayed.counters;
    console::print_line!(
        "ours: {} accepted, {} refused, {} steps forward, {} back",
        counters.accepted,
        counters.refused(),
        counters.steps_forward,
        counters.steps_back
    );
}

fn value(trace: &Trace, replayed: &Replayed, svg: &Path) -> serde_json::Value {
    let clocks: Vec<_> = replayed
        .tracks
        .iter()
        .map(|track| {
            let (ahead, spread) = track.spread().unzip();
            json!({
                "name": track.name, "ahead_ns": ahead,
                "mean_ns": spread.map(|spread| spread.mean),
                "p50_ns": spread.map(|spread| spread.p50),
                "p95_ns": spread.map(|spread| spread.p95),
                "p99_ns": spread.map(|spread| spread.p99),
                "max_ns": spread.map(|spread| spread.max),
            })
        })
        .collect();
    let counters = &replayed.counters;
    json!({
        "arrivals": trace.rows.len(), "lifted_days": trace.lifted_days,
        "clocks": clocks, "svg": svg,
        "accepted": counters.accepted, "refused": counters.refused(),
        "steps_forward": counters.steps_forward, "steps_back": counters.steps_back,
    })
}
