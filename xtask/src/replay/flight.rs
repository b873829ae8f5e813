//! `replay` of a flight: the clock on what a board saw, held against the truth.
//!
//! *Purpose.* A table a window, a picture, the readings for other judges, and the
//! verdict on what is demanded of the flight.
//!
//! *Design.* [`::flight`] plays and judges; here it is printed.
//!
//! *Limits.* `misleading` adds up the runs of more than 1 s.

use std::fmt::Write as _;
use std::process::ExitCode;

use ::flight::demands::{self, Demand};
use ::flight::judge::Tally;
use ::flight::player::{Setup, Totals};
use ::flight::{Flight, Reading, Replayed, UNSET, WorldPicos, replay};
use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::flight_plot;
use super::options::Options;
use crate::csv_text;

/// The first line of a file of readings.
const READINGS_HEADER: &str = "us,utc_ns,uncertainty_ns,state";

/// No demand names the file.
const NOT_NAMED: u8 = 2;

/// Replays the flight `content`.
///
/// # Errors
///
/// When it or its demands cannot be read, or what is asked for cannot be written.
pub fn run(options: &Options, content: &[u8]) -> Result<ExitCode> {
    let path = options.file.display();
    let flight = Flight::parse(&String::from_utf8_lossy(content))
        .with_context(|| format!("{path} is no flight"))?;
    let name = options.file.file_name().unwrap_or_default();
    let name = name.to_string_lossy();
    let demands = match &options.demands {
        None => Vec::new(),
        Some(table) => {
            let demands = demands_of(table, &name)?;
            if demands.is_empty() {
                console::print_error!("{}: no row names {name}", table.display());
                return Ok(ExitCode::from(NOT_NAMED));
            }
            demands
        }
    };
    let setup = Setup {
        floor_utc_ns: options.floor_utc_ns()?,
    };
    let mut readings = options.readings.is_some().then(|| {
        let mut text = String::from(READINGS_HEADER);
        text.push('\n');
        text
    });
    let replayed = replay(&flight, &setup, &demands, |reading| {
        if let Some(text) = &mut readings {
            write_reading(text, reading);
        }
    });
    if let (Some(file), Some(text)) = (&options.readings, readings) {
        console::write_file(file, text.as_bytes())?;
    }
    let svg = options.svg()?;
    flight_plot::draw(&flight, &replayed, &name, &svg)
        .with_context(|| format!("cannot draw {}", svg.display()))?;
    if options.json {
        console::print_line!("{}", value(&replayed));
    } else {
        console::print_text!("{}", table(&flight, &replayed));
        console::print_line!("the picture is in {}", svg.display());
    }
    let mut is_met = true;
    for judged in &replayed.demands {
        let line = match judged.verdict() {
            Ok(()) => format!("met      {}", judged.demand),
            Err(unmet) => {
                is_met = false;
                format!("NOT MET  {}: {unmet}", judged.demand)
            }
        };
        // Beside the one JSON object it would be in the way.
        if options.json {
            console::print_error!("{line}");
        } else {
            console::print_line!("{line}");
        }
    }
    Ok(if is_met {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The rows of the table in the file `table` that name the flight.
fn demands_of(table: &std::path::Path, name: &str) -> Result<Vec<Demand>> {
    let path = table.display();
    let read = std::fs::read(table).with_context(|| format!("cannot read {path}"))?;
    let bytes = csv_text::plain(&read).with_context(|| format!("cannot read {path}"))?;
    let mut demands = demands::parse(&bytes).with_context(|| format!("{path} has no demands"))?;
    demands.retain(|demand| demand.file == name);
    Ok(demands)
}

/// A line of the file of readings.
fn write_reading(text: &mut String, reading: &Reading) {
    let us = reading.at.as_micros();
    let (utc_ns, uncertainty_ns, state) = match reading.claim() {
        Some((utc_ns, uncertainty_ns)) => (utc_ns, uncertainty_ns, reading.state),
        None => (0, 0, UNSET),
    };
    let written = writeln!(text, "{us:.4},{utc_ns},{uncertainty_ns},{state}");
    written.unwrap_or_else(|_| unreachable!("a String takes everything"));
}

/// For people.
fn table(flight: &Flight, replayed: &Replayed<'_>) -> String {
    let lasts_s = flight.end().as_secs();
    let mut text = format!("{} events in {lasts_s:.1} s\n", flight.events.len());
    let wide = replayed
        .windows
        .iter()
        .map(|(window, _)| window.name.chars().count())
        .max()
        .unwrap_or(0)
        .max("window".len());
    text += &format!(
        "{:<wide$} {:>8} {:>8} {:>11} {:>29} {:>23}  states; sources\n",
        "window", "readings", "held", "misleading", "error, ms", "uncertainty, ms"
    );
    for (window, tally) in &replayed.windows {
        let name = &window.name;
        let Tally { readings, held, .. } = tally;
        let misleading = match tally.misleading() {
            WorldPicos(0) => "no".to_owned(),
            lasts => format!("{:.1} s", lasts.as_secs()),
        };
        let error = span(tally.error_ns.map(|range| (ms(range.min), ms(range.max))));
        let claim = span(
            tally
                .uncertainty_ns
                .map(|range| (ms(range.min as i64), ms(range.max as i64))),
        );
        let states = words(&tally.states, *readings);
        let sources = words(&tally.sources, *readings);
        text += &format!(
            "{name:<wide$} {readings:>8} {held:>8} {misleading:>11} {error:>29} {claim:>23}  \
             {states}; {sources}\n"
        );
    }
    let Totals { steps, counters } = &replayed.totals;
    text += &format!("{steps} steps");
    for (name, count) in counters.iter().filter(|(_, count)| *count != 0) {
        text += &format!(", {name} {count}");
    }
    text.push('\n');
    text
}

fn ms(ns: i64) -> f64 {
    ns as f64 * 1e-6
}

fn span(range: Option<(f64, f64)>) -> String {
    let figure = |ms: f64| {
        if ms.abs() >= 1e6 {
            format!("{ms:.3e}")
        } else {
            format!("{ms:.6}")
        }
    };
    match range {
        None => "never set".to_owned(),
        Some((min, max)) => format!("{} .. {}", figure(min), figure(max)),
    }
}

/// Each word with its share, the most frequent first.
fn words(counts: &std::collections::BTreeMap<&str, u64>, of: u64) -> String {
    let mut counts: Vec<_> = counts.iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    let shares = counts.iter().map(|(word, count)| {
        let percent = 100.0 * **count as f64 / of.max(1) as f64;
        if **count == of {
            (**word).to_owned()
        } else {
            format!("{word} {percent:.1} %")
        }
    });
    shares.collect::<Vec<_>>().join(", ")
}

/// For programs.
fn value(replayed: &Replayed<'_>) -> Value {
    let windows: Vec<_> = replayed
        .windows
        .iter()
        .map(|(window, tally)| {
            json!({
                "name": window.name,
                "readings": tally.readings,
                "held": tally.held,
                "misleading_s": tally.misleading().as_secs(),
                "error_ns": tally.error_ns.map(|range| json!({ "min": range.min, "max": range.max })),
                "uncertainty_ns": tally
                    .uncertainty_ns
                    .map(|range| json!({ "min": range.min, "max": range.max })),
                "states": tally.states,
                "sources": tally.sources,
            })
        })
        .collect();
    let counters: serde_json::Map<_, _> = replayed
        .totals
        .counters
        .iter()
        .map(|(name, count)| ((*name).to_owned(), json!(count)))
        .collect();
    json!({ "windows": windows, "steps": replayed.totals.steps, "counters": counters })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 60 s of good marks, a second of them in the window.
    fn flight(header: &str) -> Flight {
        let mut text = header.to_owned();
        for k in 0..300_i64 {
            let at_us = k * 200_000 + 70_000;
            let utc_ns = 1_795_309_323_000_000_000 + k * 200_000_000;
            text += &format!("{at_us},mark,{utc_ns},25,37,0\n");
        }
        Flight::parse(&text).unwrap()
    }

    #[test]
    fn programs_are_told_in_the_shape_that_is_promised() {
        let flight = flight("# window 50 51 one second\n# window 70 80 nothing\n");
        let printed = value(&replay(&flight, &Setup::default(), &[], |_| {}));
        let [second, nothing] = &printed["windows"].as_array().unwrap()[..] else {
            panic!("two windows: {printed}");
        };
        let keys = |value: &Value| {
            let object = value.as_object().unwrap();
            object.keys().cloned().collect::<Vec<_>>().join(" ")
        };
        assert_eq!(keys(&printed), "counters steps windows");
        assert_eq!(
            keys(second),
            "error_ns held misleading_s name readings sources states uncertainty_ns"
        );
        assert_eq!(second["name"], "one second");
        assert_eq!(second["readings"], 27);
        assert_eq!(keys(&second["error_ns"]), "max min");
        assert_eq!(keys(&second["uncertainty_ns"]), "max min");
        let of_states = second["states"].as_object().unwrap().values();
        assert_eq!(of_states.filter_map(Value::as_u64).sum::<u64>(), 27);
        assert_eq!(nothing["readings"], 0);
        assert!(nothing["error_ns"].is_null() && nothing["uncertainty_ns"].is_null());
        assert!(printed["steps"].is_u64());
        // And a flight without windows is one.
        let bare = replay(&self::flight(""), &Setup::default(), &[], |_| {});
        assert_eq!(value(&bare)["windows"][0]["name"], "all");
    }

    #[test]
    fn readings_are_written_for_any_judge() {
        let mut text = String::new();
        write_reading(&mut text, &Reading::unset(WorldPicos(0), "nothing"));
        write_reading(
            &mut text,
            &Reading {
                at: WorldPicos::from_millis(37),
                utc_ns: Some(-5),
                uncertainty_ns: Some(u64::MAX),
                state: "holdover",
                source: "nothing",
            },
        );
        assert_eq!(
            text,
            "0.0000,0,0,unset\n37000.0000,-5,18446744073709551615,holdover\n"
        );
    }

    #[test]
    fn the_table_has_a_line_for_each_window() {
        let flight = flight("# window 0 30 first\n# window 30 60 second half\n");
        let text = table(&flight, &replay(&flight, &Setup::default(), &[], |_| {}));
        let starts: Vec<_> = text
            .lines()
            .map(|line| line.split_whitespace().next().unwrap_or_default())
            .collect();
        assert_eq!(starts[1..4], ["window", "first", "second"]);
        assert!(text.contains("no") && !text.contains("misleading 0"));
    }
}
