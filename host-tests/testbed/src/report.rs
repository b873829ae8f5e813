//! The report: one page for people.
//!
//! *Purpose.* The paper's figures redrawn, its table beside ours, how it was measured,
//! and what it does not show.
//!
//! *Design.* One HTML file that needs nothing else: pictures and style are in it, there
//! is no script, and it fits a phone and black-and-white paper. It holds no date and no
//! path, so that the same runs make the same page.
//!
//! *Limits.* The figures show the first seed, and with more than two boards the second
//! against the first.

use std::fmt::Write as _;

use anyhow::Result;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::bounds;
use crate::case::Case;
use crate::links;
use crate::method::Method;
use crate::pairing::Difference;
use crate::plot::{self, Curve, Level};
use crate::run::{Experiment, Place, Run};
use crate::statistics::{Estimate, Spread};
use crate::units::with_unit;

const STYLE: &str = include_str!("report.css");
const MEAN_DASHES: (u32, u32) = (10, 6);
const PAPER_DASHES: (u32, u32) = (2, 5);
/// The paper's mean is drawn when it is at most this many times what we measured: a wider
/// range would flatten the curve.
const SHOWN_UP_TO: f64 = 10.0;

/// The page.
///
/// # Errors
///
/// When a figure cannot be drawn.
pub fn html(experiment: &Experiment) -> Result<String> {
    let cases = experiment.cases();
    let figures = first_runs(experiment)
        .map(|run| figure(experiment, run))
        .collect::<Result<Vec<Markup>>>()?;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "pixclock: the paper's experiment" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "How far apart are two flight controllers?" }
                (introduction(experiment))
                (anomalies(experiment))
                h2 { "The table" }
                (table(experiment))
                @if experiment.place == Place::Virtual { (errors(experiment)) (links::section(experiment)) }
                @else { (noise(experiment)) }
                (over_the_load(experiment)?)
                h2 { "The figures" }
                p {
                    "The size of the difference between the boards at each PING, and its mean \
                     as a dashed line; where it fits the scale, the paper's mean as a dotted one."
                }
                @for figure in &figures { (figure) }
                h2 { "How it was made" }
                (how(experiment))
                @if cases.iter().any(|case| case.method.is_papers()) {
                    h2 { "Beside the paper" }
                    (beside_the_paper(experiment))
                }
            }
        }
    };
    Ok(page.into_string() + "\n")
}

fn introduction(experiment: &Experiment) -> Markup {
    let boards = match experiment.place {
        Place::Virtual => {
            "on virtual boards: emulated STM32F427 that run the very images that \
            are flashed, with simulated receivers. Nothing here was measured on metal"
        }
        Place::Qemu => "on QEMU, with simulated receivers. Nothing here was measured on metal",
        Place::Lines => "on boards at lines of this host",
        Place::OneLine => "on boards that receive on one line of this host",
    };
    html! {
        p {
            "Shim, Joo and Kim (" cite { "Minimizing GPS Clock Synchronization Error for \
            PX4-Based Unmanned Aircraft" } ", 2021) let a laptop send MAVLink PINGs to two flight \
            controllers at once. Each notes its own GPS time at a PING's arrival, and the \
            difference between the two is what their clocks disagree by. This is that \
            experiment, " (boards) "."
        }
    }
}

fn anomalies(experiment: &Experiment) -> Markup {
    let several = experiment.runs.len() > 1;
    html! {
        @if let Some(why) = &experiment.cut_short {
            p.anomaly { "It ended before its time: " (why) ". What was measured until then is here." }
        }
        @for run in &experiment.runs {
            @for (board, anomaly) in run.anomalies() {
                p.anomaly {
                    @if several { (run.case) ", seed " (run.seed) ", " }
                    (board) ": " (anomaly) "."
                }
            }
        }
    }
}

fn table(experiment: &Experiment) -> Markup {
    let cases = experiment.cases();
    let has_load = cases.iter().any(|case| case.load > 0);
    let has_receivers = cases
        .iter()
        .any(|case| case.receivers != cases[0].receivers);
    html! {
        div.scroll { table {
            thead { tr {
                th { "method" }
                @if has_receivers { th { "receivers" } }
                @if has_load { th { "load" } }
                th { "the paper’s mean" } th { "our mean" }
                th { "95 % below" } th { "largest" } th { "pairs" }
                @if has_load { th { "ticks lost" } th { "PINGs unanswered" } th { "less than the default by" } }
            } }
            tbody {
                @for case in cases {
                    @let method = case.method;
                    tr.ours[!method.is_papers()] {
                        td { (method.title()) }
                        @if has_receivers { td { (case.receivers.name()) } }
                        @if has_load { td { (case.load) " %" } }
                        td { (method.paper_ms().map_or_else(|| "–".to_owned(), |ms| format!("{ms:.2} ms"))) }
                        td.wide { (estimate(experiment.estimate(case))) }
                        @let spread = experiment.spread(case);
                        td { (spread.map_or_else(none, |s| with_unit(s.p95 as f64))) }
                        td { (spread.map_or_else(none, |s| with_unit(s.max as f64))) }
                        td { (spread.map_or(0, |s| s.count)) }
                        @if has_load {
                            @let lost: Option<u32> = experiment.runs_of(case).map(Run::lost_ticks).sum();
                            td { (lost.map_or_else(none, |lost| lost.to_string())) }
                            td { (experiment.runs_of(case).map(Run::missing).sum::<usize>()) }
                            @let reduction = experiment.reduction(case).filter(|_| method.is_papers());
                            td { (reduction.map_or_else(none, |share| format!("{:.1} %", share * 100.0))) }
                        }
                    }
                }
            }
        } }
        @if experiment.runs.iter().any(|run| run.seed != experiment.runs[0].seed) {
            p {
                "± is half the 95 % confidence interval of the mean over the seeds (Student’s t); \
                 percentiles are over all seeds together."
            }
        }
        @if has_load {
            p {
                "A load is a synthetic flight stack in the image, made after PX4’s own figures: interrupts, sections \
                 that mask them, and tasks. Ticks are lost when SysTick waits for longer than one of them; the paper’s \
                 clock, a base time and counted ticks, goes slow by each. The paper’s own reduction is 84.1 %, from \
                 21.64 ms to 3.44."
            }
        }
        p {
            "The paper has one default. It names unequal baud rates as a cause of its \
             difference, so ours comes with equal and with unequal ones. "
            @let missing: usize = experiment.runs.iter().map(Run::missing).sum();
            @let asked: u32 = experiment.runs.iter().flat_map(|run| &run.records).map(|r| r.asked).sum();
            (asked) " PINGs were sent, " (missing) " answers are missing"
            @let full: Option<u32> = experiment.runs.iter().map(Run::line_full).sum();
            @if let Some(full) = full.filter(|_| missing > 0) {
                "; the boards counted " (full) " frames that found their line full"
            }
            "."
        }
        @let bounds = bounds::judge(experiment);
        @if !bounds.is_empty() {
            h3 { "Bounds" }
            ul { @for bound in &bounds {
                li { (bound.text) ": " (bound.measured) ", " b { (if bound.holds { "holds" } else { "broken" }) } }
            } }
        }
    }
}

/// The mean difference over the load, a figure for each of the receivers.
fn over_the_load(experiment: &Experiment) -> Result<Markup> {
    let cases = experiment.cases();
    let mut receivers: Vec<_> = cases.iter().map(|case| case.receivers).collect();
    receivers.sort();
    receivers.dedup();
    let mut figures = Vec::new();
    for receivers in receivers {
        let mut curves: Vec<Curve> = Vec::new();
        for case in cases.iter().filter(|case| case.receivers == receivers) {
            let Some(estimate) = experiment.estimate(*case) else {
                continue;
            };
            let name = case.method.to_string();
            let point = (case.load, estimate.mean);
            match curves.iter_mut().find(|curve| curve.name == name) {
                Some(curve) => curve.points.push(point),
                None => curves.push(Curve {
                    name,
                    points: vec![point],
                }),
            }
        }
        if curves.iter().any(|curve| curve.points.len() > 1) {
            figures.push((receivers, plot::over_load(&curves)?));
        }
    }
    Ok(html! {
        @if !figures.is_empty() {
            h2 { "Over the load" }
            @for (receivers, picture) in &figures {
                figure role="img" aria-label={ "difference over the load, receivers " (receivers.name()) } {
                    (PreEscaped(picture))
                    figcaption {
                        "The mean difference over the load, with the receivers " code { (receivers.name()) } ": "
                        (receivers.title()) "."
                    }
                }
            }
        }
    })
}

fn errors(experiment: &Experiment) -> Markup {
    html! {
        h3 { "Each board against UTC" }
        p {
            "On virtual boards the truth is known: a PING arrives with its first byte, and by USB it counts from \
             its leaving. A clock that knows nothing of its receiver’s \
             latency is late by its floor; between equal receivers that cancels. The pulse has none: what \
             is left with it is the interrupt that stamps a PING"
            @if !experiment.is_to_the_ns() {
                ", and that answers are rounded down to whole microseconds, by half of one on average"
            }
            "."
        }
        div.scroll { table {
            thead { tr { th { "method" } th { "board" } th { "mean" } th { "95 % below" } th { "largest" } } }
            tbody {
                @for case in experiment.cases() {
                    @for (number, spread) in (1..).zip(experiment.errors(case)) {
                        tr {
                            td { @if number == 1 { (case.title()) } }
                            td { (number) } (cells(spread))
                        }
                    }
                }
            }
        } }
    }
}

fn noise(experiment: &Experiment) -> Markup {
    html! {
        h3 { "This host’s own noise" }
        p {
            @if experiment.place == Place::OneLine {
                "All boards receive the same PING, so that the difference has nothing of this host in it."
            } @else {
                "A difference is no better known than the moments at which two PINGs arrived. What \
                 is beyond the least round trip was lost in one of the two directions; late samples were \
                 discarded before the table was made."
            }
        }
        @for line in links::unknown(experiment) { p { (line) } }
        div.scroll { table {
            thead { tr {
                th { "method" } th { "board" } th { "least round trip" } th { "median" } th { "95 % below" }
                th { "used up to" } th { "sent late, mean" } th { "at most" }
            } }
            tbody {
                @for run in &experiment.runs {
                    @for (index, record) in run.records.iter().enumerate() {
                        @let least = record.samples.iter().map(|s| s.round_trip_ns).min();
                        @let trips = Spread::of(record.samples.iter().map(|s| s.round_trip_ns));
                        @let delays = Spread::of(record.send_delays_ns.iter().copied());
                        tr {
                            td { @if index == 0 { (run.case.title()) } }
                            td { (index + 1) }
                            td { (least.map_or_else(none, |ns| with_unit(ns as f64))) }
                            td { (trips.map_or_else(none, |s| with_unit(s.p50 as f64))) }
                            td { (trips.map_or_else(none, |s| with_unit(s.p95 as f64))) }
                            td { (run.late_ns.get(index).map_or_else(none, |&ns| with_unit(ns as f64))) }
                            td { (delays.map_or_else(none, |s| with_unit(s.mean))) }
                            td { (delays.map_or_else(none, |s| with_unit(s.max as f64))) }
                        }
                    }
                }
            }
        } }
    }
}

/// The same in a line a board, for a terminal.
pub(crate) fn noise_text(experiment: &Experiment) -> String {
    let mut out = String::new();
    for run in &experiment.runs {
        for record in &run.records {
            let trips = Spread::of(record.samples.iter().map(|s| s.round_trip_ns));
            let delays = Spread::of(record.send_delays_ns.iter().copied());
            let (Some(trips), Some(delays)) = (trips, delays) else {
                continue;
            };
            let _ = writeln!(
                out,
                "this host's noise, {}: round trip {} at the median, {} at 95 %; sent {} late on average, {} at most",
                record.name,
                with_unit(trips.p50 as f64),
                with_unit(trips.p95 as f64),
                with_unit(delays.mean),
                with_unit(delays.max as f64),
            );
        }
    }
    for line in links::unknown(experiment) {
        let _ = writeln!(out, "{line}");
    }
    out
}

fn cells(spread: Spread) -> Markup {
    html! {
        td { (with_unit(spread.mean)) } td { (with_unit(spread.p95 as f64)) } td { (with_unit(spread.max as f64)) }
    }
}

/// The runs that are drawn: each row's first.
pub(crate) fn first_runs(experiment: &Experiment) -> impl Iterator<Item = &Run> {
    let cases = experiment.cases().into_iter();
    cases.filter_map(|case| experiment.runs_of(case).next())
}

/// The differences of a run that are drawn.
fn drawn(run: &Run) -> Vec<Difference> {
    let mut differences = run.differences();
    differences.retain(|difference| difference.board == 1);
    differences
}

/// The picture of a run, as SVG.
///
/// # Errors
///
/// When it cannot be drawn.
pub(crate) fn picture(run: &Run) -> Result<String> {
    let differences = drawn(run);
    let mut levels = Vec::new();
    let spread = Spread::of(differences.iter().map(|difference| difference.ns));
    if let Some(spread) = spread {
        levels.push(Level {
            ns: spread.mean,
            name: format!("mean {}", with_unit(spread.mean)),
            dashes: MEAN_DASHES,
        });
    }
    let most = spread.map_or(0.0, |spread| spread.max as f64);
    if let Some(ms) = run
        .case
        .method
        .paper_ms()
        .filter(|ms| ms * 1e6 <= SHOWN_UP_TO * most)
    {
        levels.push(Level {
            ns: ms * 1e6,
            name: format!("the paper's mean {ms:.2} ms"),
            dashes: PAPER_DASHES,
        });
    }
    plot::svg(&differences, run.lasted_s, &levels)
}

fn figure(experiment: &Experiment, run: &Run) -> Result<Markup> {
    let spread = Spread::of(drawn(run).iter().map(|difference| difference.ns));
    let several = experiment.runs_of(run.case).count() > 1;
    Ok(html! {
        figure role="img" aria-label=(run.case.title()) {
            h3 { (run.case.title()) }
            (PreEscaped(picture(run)?))
            figcaption {
                code { (run.case) }
                @if let Some(number) = run.case.method.paper_figure() { ", as the paper’s figure " (number) }
                @if several { ", seed " (run.seed) }
                @if let Some(spread) = spread {
                    ": mean " (with_unit(spread.mean)) ", 95 % below " (with_unit(spread.p95 as f64))
                    ", at most " (with_unit(spread.max as f64))
                }
                "."
            }
        }
    })
}

fn how(experiment: &Experiment) -> Markup {
    html! {
        pre { code {
            @for (number, word) in experiment.command.split(" --").enumerate() {
                @if number == 0 { span { (word) } } @else { " " span { "--" (word) } }
            }
        } }
        dl { @for (name, value) in &experiment.conditions { dt { (name) } dd { (value) } } }
        @if experiment.place == Place::Virtual {
            p {
                "The same command makes the same files, byte for byte. Every method meets the same \
                 receivers, crystals and PINGs."
            }
        }
        p {
            @if experiment.is_to_the_ns() {
                "The boards’ times are those of their own logs, in nanoseconds; each is the time \
                 that its PING was answered with."
            } @else {
                "Where a board’s own log was not to be had or was full, its times are those of its \
                 answers, which have whole microseconds: two clocks that agree to a few nanoseconds \
                 are seen to differ by one or by none."
            }
        }
    }
}

fn beside_the_paper(experiment: &Experiment) -> Markup {
    let of_paper: Vec<(Case, f64, f64)> = experiment
        .cases()
        .into_iter()
        .filter_map(|case| {
            Some((
                case,
                case.method.paper_ms()?,
                experiment.estimate(case)?.mean / 1e6,
            ))
        })
        .collect();
    let mut ours = of_paper.clone();
    ours.sort_by(|one, other| other.2.total_cmp(&one.2));
    html! {
        p { "How far our figure for each of the paper’s methods stands from the paper’s own:" }
        ul { @for (case, paper, mean) in &of_paper {
            li { (case.title()) ": " (with_unit(mean * 1e6)) " beside " (format!("{paper:.2} ms")) ", "
                 (format!("{:.2}", mean / paper)) " times as much" }
        } }
        @if ours.len() > 1 {
            p {
                "From the largest to the smallest, ours come in this order: "
                (ours.iter().map(|(case, ..)| case.to_string()).collect::<Vec<_>>().join("; ")) "."
            }
        }
        @if [Method::PaperDefault, Method::PaperStep1].iter().all(|method| experiment.plain(*method).is_some()) {
            p {
                "At equal rates the paper’s default and its step I come out alike, and that is no \
                 mistake: both read a whole message 12 ms after its first byte, the one after three \
                 waits of 4 ms, the other after two of 6."
            }
        }
        @let has_load = of_paper.iter().any(|(case, ..)| case.load > 0);
        p {
            "The paper’s methods are its software’s timing only: the poll, sleep and read loop of \
             PX4 1.9, the constant wait, the tick and the priorities, on a board that does "
            @if has_load {
                "nothing else, or carries a synthetic load that was made after PX4’s own figures and not after the \
                 paper’s. What the authors’ receivers took from epoch to message, and how their oscillators ran"
            } @else {
                "nothing else. What the authors’ receivers took from epoch to message, how their oscillators ran, \
                 and what load their flight stack put on the processor"
            }
            " is not known, and each of them moves these figures. Here the receivers’ latency is that of recordings \
             that others made; with every mark setting the clock, its spread goes straight into the \
             difference, whatever the tick. No parameter was tuned to the paper’s figures."
        }
    }
}

/// A mean, with its confidence interval below it where there is no room beside it.
fn estimate(estimate: Option<Estimate>) -> Markup {
    html! {
        @match estimate {
            None => { (none()) }
            Some(Estimate { mean, half_width, .. }) => {
                span { (with_unit(mean)) }
                @if let Some(half) = half_width { " " span { "± " (with_unit(half)) } }
            }
        }
    }
}

/// A mean with its confidence interval.
pub(crate) fn estimate_text(estimate: Estimate) -> String {
    match estimate.half_width {
        Some(half) => format!("{} ± {}", with_unit(estimate.mean), with_unit(half)),
        None => with_unit(estimate.mean),
    }
}

fn none() -> String {
    "–".to_owned()
}
