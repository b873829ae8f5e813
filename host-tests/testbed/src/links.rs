//! The links in the report and on the terminal.
//!
//! *Purpose.* What was measured of each link where the truth is known, and what a host cannot know of it elsewhere.
//!
//! *Limits.* The same figures as in the summary, with three digits.

use std::fmt::Write as _;

use maud::{Markup, html};

use crate::case::Case;
use crate::latency::{Latency, beyond_telem1, latencies};
use crate::link::Link;
use crate::run::{Experiment, Place};
use crate::units::{with_sign, with_unit};

/// The standard deviation of the difference of two waits, each even over a frame: its share of the frame, 1/√6.
const OF_TWO_WAITS: f64 = 0.408;
/// 95 % of a bell are within so many standard deviations.
const BELL_95: f64 = 1.96;

/// The rows of an experiment that has more than TELEM1 in it.
fn cases(experiment: &Experiment) -> Vec<Case> {
    let cases = experiment.cases();
    let is_needed = cases.iter().any(|case| case.link != Link::Telem1);
    if is_needed { cases } else { Vec::new() }
}

/// How much later than by TELEM1 the same PINGs were stamped, in a row by another link.
fn later(experiment: &Experiment, case: Case) -> Option<Latency> {
    let beyond = (case.link != Link::Telem1).then(|| beyond_telem1(experiment, case));
    beyond.flatten()
}

/// The section of the report.
pub(crate) fn section(experiment: &Experiment) -> Markup {
    let cases = cases(experiment);
    html! {
        @if !cases.is_empty() {
            h3 { "From sending to the stamp" }
            p {
                "How much later than a PING left the laptop’s program the board’s clock showed what it answered: the \
                 link, and what the clock is off by, which by messages is the receivers’ latency. A serial line \
                 begins at once and its first byte takes 87 µs. USB moves bytes in frames of 1 ms, so that a PING \
                 waits for the next one; both boards are at one controller here, whose frames they share. Jitter is \
                 the standard deviation."
            }
            div.scroll { table {
                thead { tr {
                    th { "method" } th { "board" } th { "least" } th { "mean" } th { "95 % below" }
                    th { "greatest" } th { "jitter" }
                } }
                tbody {
                    @for case in &cases {
                        @for (number, latency) in (1..).zip(latencies(experiment, *case)) {
                            tr {
                                td { @if number == 1 { (case) } }
                                td { (number) } (cells(latency))
                            }
                        }
                    }
                    @for case in &cases {
                        @if let Some(latency) = later(experiment, *case) {
                            tr { td { (case) " less TELEM1" } td { "all" } (cells(latency)) }
                        }
                    }
                }
            } }
        }
    }
}

fn cells(latency: Latency) -> Markup {
    html! {
        td { (with_sign(latency.least as f64)) } td { (with_sign(latency.mean)) }
        td { (with_sign(latency.p95 as f64)) } td { (with_sign(latency.greatest as f64)) }
        td { (with_unit(latency.deviation)) }
    }
}

/// The same for a terminal.
pub(crate) fn text(experiment: &Experiment) -> String {
    let mut out = String::new();
    let mut line = |name: String, latency: Latency| {
        let _ = writeln!(
            out,
            "{name}: {} to {}, mean {}, jitter {}",
            with_sign(latency.least as f64),
            with_sign(latency.greatest as f64),
            with_sign(latency.mean),
            with_unit(latency.deviation),
        );
    };
    for case in cases(experiment) {
        for (number, latency) in (1..).zip(latencies(experiment, case)) {
            line(
                format!("from sending to the stamp, {case}, board {number}"),
                latency,
            );
        }
        if let Some(latency) = later(experiment, case) {
            line(format!("stamped later than by TELEM1, {case}"), latency);
        }
    }
    out
}

/// What this host does not know of when its PINGs arrived, a line for each row.
pub(crate) fn unknown(experiment: &Experiment) -> Vec<String> {
    let is_known = matches!(experiment.place, Place::Virtual | Place::OneLine);
    let cases = experiment.cases().into_iter();
    let cases = cases.filter(|case| !is_known && case.link.unknown_ns() > 0);
    let line = |case: Case| {
        let frame = case.link.unknown_ns() as f64;
        let pairs = experiment.runs_of(case).map(|run| run.differences().len());
        let pairs: usize = pairs.sum();
        let of_mean = BELL_95 * OF_TWO_WAITS * frame / (pairs.max(1) as f64).sqrt();
        format!(
            "By {} a PING waits in this host for the next frame, up to {}, and no round trip shows how long: \
             a difference is known to ±{}, and the signed mean of {pairs} to ±{} (95 %) if each wait is another.",
            case.link,
            with_unit(frame),
            with_unit(frame),
            with_unit(of_mean),
        )
    };
    cases.map(line).collect()
}
