//! Figures and verdicts, for people and for programs.
//!
//! *Purpose.* The table that is printed and kept in `docs/results`, and the same as
//! JSON.
//!
//! *Design.* Three significant digits: more than the seeds are worth, and few enough
//! that another machine's mathematics prints the same.
//!
//! *Limits.* Plain text, 80 columns.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::bounds::{Quantity, Verdict, judge};
use crate::case::{Floor, SECOND, SETTLED_S, Temperature, Unit};
use crate::figures::{Figures, Row};
use crate::spread::Spread;

/// A case as text: a heading, a line a candidate, a line a bound.
#[must_use]
pub fn text(figures: &Figures) -> String {
    let unit = figures.case.unit;
    let mut out = heading(figures);
    for row in &figures.rows {
        line(&mut out, format_args!("{}", candidate(row, unit)));
    }
    if figures.case.floor != Floor::Still {
        let spread = sizes("floors", &figures.floors, unit);
        line(&mut out, format_args!("{spread}"));
    }
    line(&mut out, format_args!("{}", own(figures)));
    let ours = figures.ours();
    let trial = |(seed, kind): (u64, Temperature)| format!("seed {seed} {}", kind.name());
    let (worst, largest) = (trial(ours.worst), trial(ours.largest));
    line(
        &mut out,
        format_args!("ours: worst mean {worst}; largest {largest}"),
    );
    for verdict in judge(figures) {
        line(&mut out, format_args!("{}", described(&verdict, unit)));
    }
    if let Some(violation) = &figures.first_violation {
        line(&mut out, format_args!("the first violation: {violation}"));
    }
    out
}

/// Title, trials and the head of the table.
fn heading(figures: &Figures) -> String {
    let case = figures.case;
    let window = &case.window_s;
    let when = if case.one_moment {
        format!("at {} s", window.start)
    } else {
        format!("{} to {} s", window.start, window.end)
    };
    let (name, title, trials) = (case.name, case.title, figures.trials);
    format!(
        "{name}: {title}\n\
         {trials} trials, {when}, in {}\n\
         {:>11} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}\n",
        case.unit.name(),
        "",
        "mean",
        "p50",
        "p95",
        "p99",
        "max",
        "worst",
        "converged"
    )
}

/// A spread under the head of the table.
fn sizes(name: &str, spread: &Spread, unit: Unit) -> String {
    let mean = in_unit(spread.mean, unit);
    let [p50, p95, p99, max] =
        [spread.p50, spread.p95, spread.p99, spread.max].map(|ns| in_unit(f64::from(ns), unit));
    format!("{name:>11} {mean:>8} {p50:>8} {p95:>8} {p99:>8} {max:>8}")
}

/// Uncertainty and rates of our clock.
fn own(figures: &Figures) -> String {
    let mut own = format!(
        "uncertainty: holds {} %, is {} of the error",
        three(figures.coverage * 100.0),
        three(figures.width)
    );
    if let Some(rates) = figures.rates {
        let (unit, size) = if rates.p99 < 1_000_000 {
            ("ppb", 1e3)
        } else {
            ("ppm", 1e6)
        };
        let mean = three(rates.mean / size);
        let p99 = three(f64::from(rates.p99) / size);
        let _ = write!(own, "\nrate over a minute: mean {mean}, p99 {p99} {unit}");
    }
    own
}

/// A case as JSON; times in ns.
#[must_use]
pub fn value(figures: &Figures) -> Value {
    let rows: Vec<_> = figures
        .rows
        .iter()
        .map(|row| {
            let spread = &row.spread;
            json!({
                "name": row.name,
                "mean_ns": spread.mean, "p50_ns": spread.p50, "p95_ns": spread.p95,
                "p99_ns": spread.p99, "max_ns": spread.max,
                "worst_mean_ns": row.worst_mean, "worst_seed": row.worst.0,
                "largest_seed": row.largest.0,
                "converged_p95_ns": row.converged_p95(),
            })
        })
        .collect();
    let bounds: Vec<_> = judge(figures)
        .iter()
        .map(|verdict| {
            json!({
                "quantity": named(verdict.bound.quantity),
                "limit": verdict.bound.limit,
                "measured": verdict.measured,
                "holds": verdict.holds,
            })
        })
        .collect();
    json!({
        "case": figures.case.name, "title": figures.case.title, "trials": figures.trials,
        "candidates": rows, "bounds": bounds,
        "floors_mean_ns": figures.floors.mean, "floors_p99_ns": figures.floors.p99,
        "coverage": figures.coverage, "width": figures.width,
        "rate_p99_ppt": figures.rates.map(|rates| rates.p99),
        "grown_p95_ns": figures.grown.map(|grown| grown.p95),
    })
}

fn line(out: &mut String, text: std::fmt::Arguments) {
    let _ = writeln!(out, "{}", text.to_string().trim_end());
}

fn candidate(row: &Row, unit: Unit) -> String {
    let worst = in_unit(row.worst_mean, unit);
    let converged_s = row.converged_p95().div_ceil(SECOND);
    let converged = if converged_s >= SETTLED_S {
        "never".to_owned()
    } else {
        format!("{converged_s} s")
    };
    let spread = sizes(row.name, &row.spread, unit);
    format!("{spread} {worst:>8} {converged:>9}")
}

/// A verdict in words.
#[must_use]
pub fn described(verdict: &Verdict, unit: Unit) -> String {
    let quantity = verdict.bound.quantity;
    let value = |value: f64| match quantity {
        Quantity::Mean
        | Quantity::P95
        | Quantity::P99
        | Quantity::Max
        | Quantity::WorstMean
        | Quantity::GrownP95
        | Quantity::GrownMax => format!("{} {}", in_unit(value, unit), unit.name()),
        Quantity::Rate if value >= 1_000.0 => format!("{} ppm", three(value / 1e3)),
        Quantity::Rate => format!("{} ppb", three(value)),
        Quantity::ConvergedBy(_) | Quantity::Coverage | Quantity::CoverageUtc => {
            format!("{} %", three(value * 100.0))
        }
        Quantity::Violations => format!("{value}"),
        _ => three(value),
    };
    format!(
        "{:>11} {} {} {}: {}",
        if verdict.holds { "holds" } else { "BROKEN" },
        named(quantity),
        if quantity.is_at_least() { ">=" } else { "<=" },
        value(verdict.bound.limit),
        value(verdict.measured)
    )
}

/// What a quantity is called.
#[must_use]
pub fn named(quantity: Quantity) -> String {
    match quantity {
        Quantity::Mean => "mean",
        Quantity::P95 => "p95",
        Quantity::P99 => "p99",
        Quantity::Max => "max",
        Quantity::WorstMean => "worst trial's mean",
        Quantity::GrownP95 => "p95 of the change since the loss",
        Quantity::GrownMax => "max of the change since the loss",
        Quantity::Rate => "p99 of a minute's rate",
        Quantity::MeanOverBaselines => "mean over the best baseline's",
        Quantity::P99OverBaselines => "p99 over the best baseline's",
        Quantity::PaperOverMean => "mean of the paper over ours",
        Quantity::MeanOverFloors => "mean over the floors'",
        Quantity::P99OverFloors => "p99 over the floors'",
        Quantity::EverOverFloors => "mean over the floors' at all times",
        Quantity::ConvergedBy(s) => return format!("converged by {s} s"),
        Quantity::Coverage => "uncertainty holds the error",
        Quantity::CoverageUtc => "uncertainty and the latency's hold UTC",
        Quantity::Width => "uncertainty over error",
        Quantity::Violations => "readings that violate an invariant",
    }
    .to_owned()
}

fn in_unit(ns: f64, unit: Unit) -> String {
    three(ns / unit.ns())
}

/// Three significant digits, as an integer from 100 on.
fn three(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    let decimals = match rounded.abs() {
        0.0 => 0,
        size => (2 - size.log10().floor() as i32).max(0) as usize,
    };
    format!("{rounded:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_three_digits() {
        for (value, expected) in [
            (0.0, "0"),
            (0.071_26, "0.0713"),
            (0.999_6, "1.00"),
            (9.995, "9.99"),
            (12.34, "12.3"),
            (99.96, "100"),
            (1_234.0, "1230"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(three(value), expected);
        }
    }
}
