//! `integrity`: how often the clock misleads, over random schedules of faults.
//!
//! *Purpose.* The count that has to be 0, the shares that show that it was not bought
//! with silence, and the worst schedules as files for `replay`.
//!
//! *Design.* [`::flight::integrity`] draws, plays and counts; here it is printed.
//!
//! *Limits.* Faults that nothing on the board can detect are reported apart, and decide
//! nothing.

use std::io::IsTerminal;
use std::ops::Range;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use ::flight::Flight;
use ::flight::integrity::{
    Availability, CHECKED, Campaign, TELLABLE_PER_UNTELLABLE, TUNING, campaign,
};
use anyhow::Result;
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::{Value, json};
use world::schedule::Schedule;

use crate::image;

/// What can be asked for.
#[derive(Args)]
pub struct Options {
    /// Which schedules; without, 2 000 that no constant was tuned with. Tune with those
    /// below 9000000
    #[arg(long, value_name = "A..B", value_parser = seeds, default_value = "11000000..11002000")]
    seeds: Range<u64>,
    /// The 200 that are checked each time
    #[arg(long, conflicts_with = "seeds")]
    check: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Write the N worst as files that `replay` plays
    #[arg(long, value_name = "N", default_value_t = 0)]
    worst: usize,
    /// Where to; otherwise into target/integrity/
    #[arg(long, value_name = "DIR", requires = "worst")]
    out: Option<PathBuf>,
}

fn seeds(text: &str) -> Result<Range<u64>, String> {
    let range = text
        .split_once("..")
        .and_then(|(from, until)| Some(from.parse().ok()?..until.parse().ok()?));
    range
        .filter(|range| !range.is_empty())
        .ok_or_else(|| "allowed are two numbers, the first one smaller, as 0..100".to_owned())
}

/// Plays the schedules, and fails if one misleads or the clock is not available.
///
/// # Errors
///
/// When the worst cannot be written.
pub fn run(options: &Options) -> Result<ExitCode> {
    let seeds = if options.check {
        CHECKED
    } else {
        options.seeds.clone()
    };
    let total = seeds.end - seeds.start;
    let apart = seeds.start..seeds.start + total.div_ceil(TELLABLE_PER_UNTELLABLE);
    let progress = bar(total + (apart.end - apart.start));
    let started = Instant::now();
    let done = || progress.inc(1);
    let detectable = campaign(seeds.clone(), Schedule::draw, options.worst, &done);
    let undetectable = campaign(apart, Schedule::draw_undetectable, 0, &done);
    progress.finish_and_clear();
    let took_s = started.elapsed().as_secs_f64();
    if options.json {
        console::print_line!("{}", value(&seeds, &detectable, &undetectable));
    } else {
        console::print_text!("{}", text(&seeds, &detectable, &undetectable));
    }
    console::print_error!(
        "{total} schedules in {took_s:.1} s: {:.0} times as fast as time",
        (detectable.lasted_s + undetectable.lasted_s) / took_s
    );
    write_worst(options, &detectable)?;
    Ok(if detectable.is_good() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn bar(total: u64) -> ProgressBar {
    if std::io::stderr().is_terminal() {
        ProgressBar::new(total)
    } else {
        ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden())
    }
}

/// What the seeds are for.
fn purpose(seeds: &Range<u64>) -> &'static str {
    if *seeds == CHECKED {
        "seeds of each check"
    } else if seeds.end <= TUNING.end {
        "seeds for tuning"
    } else if TUNING.end <= seeds.start {
        "seeds that no constant was tuned with"
    } else {
        "seeds of both kinds"
    }
}

fn text(seeds: &Range<u64>, detectable: &Campaign, undetectable: &Campaign) -> String {
    let mut text = format!(
        "{} schedules of two to five faults, {}..{} ({}): {} misleading\n",
        detectable.schedules,
        seeds.start,
        seeds.end,
        purpose(seeds),
        detectable.misleading.len()
    );
    if !detectable.misleading.is_empty() {
        text += &format!("  seeds {}\n", listed(&detectable.misleading));
        text += &format!("  with {}\n", kinds(detectable));
    }
    text += "while nothing was wrong and had not been for long:\n";
    for (name, availability) in [
        ("with a pulse", &detectable.with_pulse),
        ("without", &detectable.without_pulse),
    ] {
        text += &format!("  {name:<13}");
        for (share_of, share) in availability.shares() {
            let mark = if share.is_enough() { "" } else { " (FEW)" };
            text += &format!(" {share_of} {:.3} %{mark}", share.percent());
        }
        text.push('\n');
    }
    text += &format!(
        "what nothing on the board can detect: {} of {} misleading\n",
        undetectable.misleading.len(),
        undetectable.schedules
    );
    text += &format!("  with {}\n", kinds(undetectable));
    text
}

/// Which kinds of fault those had that misled.
fn kinds(campaign: &Campaign) -> String {
    let kinds = campaign.misled_by.iter();
    let kinds = kinds.filter(|(_, misled)| misled.good > 0);
    let kinds = kinds.map(|(kind, misled)| format!("{kind} {} of {}", misled.good, misled.of));
    kinds.collect::<Vec<_>>().join(", ")
}

/// The first of them.
fn listed(seeds: &[u64]) -> String {
    const SHOWN: usize = 20;
    let shown: Vec<_> = seeds.iter().take(SHOWN).map(u64::to_string).collect();
    let more = if seeds.len() > SHOWN { " …" } else { "" };
    format!("{}{more}", shown.join(" "))
}

fn value(seeds: &Range<u64>, detectable: &Campaign, undetectable: &Campaign) -> Value {
    let availability = |availability: &Availability| {
        let shares = availability.shares().map(|(name, share)| {
            let value = json!({ "good": share.good, "of": share.of });
            (name.to_owned(), value)
        });
        Value::Object(shares.into_iter().collect())
    };
    json!({
        "seeds": [seeds.start, seeds.end],
        "schedules": detectable.schedules,
        "misleading": detectable.misleading.len(),
        "misleading_seeds": detectable.misleading,
        "with_pulse": availability(&detectable.with_pulse),
        "without_pulse": availability(&detectable.without_pulse),
        "undetectable": {
            "schedules": undetectable.schedules,
            "misleading": undetectable.misleading.len(),
            "kinds": undetectable
                .misled_by
                .iter()
                .map(|(kind, misled)| {
                    let value = json!({ "schedules": misled.of, "misleading": misled.good });
                    ((*kind).to_owned(), value)
                })
                .collect::<serde_json::Map<_, _>>(),
        },
    })
}

/// Each of the worst as a file.
fn write_worst(options: &Options, detectable: &Campaign) -> Result<()> {
    if detectable.worst.is_empty() {
        return Ok(());
    }
    let folder = match &options.out {
        Some(folder) => folder.clone(),
        None => image::target_dir()?.join("integrity"),
    };
    std::fs::create_dir_all(&folder)?;
    for played in &detectable.worst {
        let file = folder.join(format!("seed-{}.ev", played.schedule.seed));
        let flight = Flight::from(&played.schedule);
        console::write_file(&file, flight.to_string().as_bytes())?;
        let kinds: Vec<_> = played
            .schedule
            .faults
            .iter()
            .map(|fault| fault.kind.name())
            .collect();
        let misled = played.tally.first_misleading().map_or_else(
            || format!("{:.2} of its claim", played.nearest),
            |from| {
                let lasts_s = played.tally.misleading().as_secs();
                format!(
                    "misleading for {lasts_s:.1} s from {:.1} s on",
                    from.as_secs()
                )
            },
        );
        console::print_error!("{}: {misled}; {}", file.display(), kinds.join(", "));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use ::flight::integrity::JUDGING;

    use super::*;

    #[test]
    fn seeds_are_a_range_that_is_not_empty() {
        assert_eq!(seeds("3..5"), Ok(3..5));
        for wrong in ["5..3", "3..3", "3", "a..b", ""] {
            assert!(seeds(wrong).is_err(), "{wrong}");
        }
        assert_eq!(seeds("11000000..11002000"), Ok(JUDGING), "the default");
    }

    #[test]
    fn people_and_programs_are_told_the_same() {
        let drawn = campaign(0..2, Schedule::draw, 1, &|| {});
        let apart = campaign(0..1, Schedule::draw_undetectable, 0, &|| {});
        let detectable = value(&(0..2), &drawn, &apart);
        assert_eq!(detectable["schedules"], 2);
        let misleading = detectable["misleading"].as_u64().unwrap();
        let lines = text(&(0..2), &drawn, &apart);
        assert!(lines.contains(&format!("(seeds for tuning): {misleading} misleading")));
        for name in ["set", "within", "claimed", "close"] {
            assert!(detectable["with_pulse"][name]["of"].is_u64());
            assert!(lines.contains(name));
        }
    }
}
