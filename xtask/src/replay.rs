//! `replay`: a recording of a receiver through the very crates of the firmware.
//!
//! *Purpose.* What the clock would have made of it, without a board. Of a recording's
//! bytes (UBX): each NAV-PVT and what became of it, then everything that was
//! counted. Of arrivals that a board logged (CSV): see [`trace`]. Of a flight, what a
//! board saw beside the truth (`.ev`): see [`flight`].
//!
//! *Design.* The file's content says which it is. A recording plays as in
//! `sim --ubx`: what stands up to each NAV-PVT leaves together at 115200 baud, spaced
//! by its time of week. Bytes are stamped by a perfect crystal as their last bit
//! comes in.
//!
//! *Limits.* A recording of bytes has no arrival times of its own: how late they
//! were is not in it.

mod flight;
mod flight_plot;
mod plot;
mod trace;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use ::flight::Flight;
use anyhow::{Context, Result, bail};
use clap::Args;
use comparison::trace::{HEADER, Trace};
use serde_json::json;
use timebase::{Cycles, StampedByte};
use ubx_link::{Event, Link};
use utc_clock::{Outcome, Published, Settings, UtcClock};
use world::{Recording, Talker};

use crate::image;

/// What a replay can be asked for.
#[derive(Args)]
pub struct Options {
    /// The recording: UBX, with whatever else was on the line, a CSV of arrivals
    /// with the header `local_us,gps_utc_us`, or the events of a flight (.ev)
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Of a CSV or a flight: where the picture goes; otherwise into target/replay/
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Of a flight: write each reading as `us,utc_ns,uncertainty_ns,state`
    #[arg(long, value_name = "FILE")]
    readings: Option<PathBuf>,
    /// Of a flight: judge it by the rows of this table that name it; exits with 1 if
    /// one is not met, with 2 if none names it
    #[arg(long, value_name = "FILE")]
    demands: Option<PathBuf>,
    /// The earliest date that the clock believes, for a recording that is older
    #[arg(long, value_name = "DATE")]
    floor: Option<jiff::civil::Date>,
    /// Print one JSON object instead of lines for people
    #[arg(long)]
    json: bool,
}

impl Options {
    /// The floor as the clock takes it, in ns of UTC since 1970.
    fn floor_utc_ns(&self) -> Result<Option<i64>> {
        let Some(date) = self.floor else {
            return Ok(None);
        };
        let begins = date.to_zoned(jiff::tz::TimeZone::UTC)?.timestamp();
        let ns = i64::try_from(begins.as_nanosecond()).context("the floor's year is too far")?;
        Ok(Some(ns))
    }
}

/// Where a picture goes that nobody has named a file for: under `target`, because the
/// recording's own folder may be somebody else's.
fn default_svg(file: &Path) -> Result<PathBuf> {
    let folder = image::target_dir()?.join("replay");
    std::fs::create_dir_all(&folder)?;
    let name = file.with_extension("svg");
    Ok(folder.join(name.file_name().unwrap_or_default()))
}

/// Replays the file.
///
/// # Errors
///
/// When it cannot be read, or is neither of the two.
pub fn run(options: &Options) -> Result<ExitCode> {
    let path = options.file.display();
    let bytes = std::fs::read(&options.file).with_context(|| format!("cannot read {path}"))?;
    if Flight::is_one(&bytes) {
        return flight::run(options, &bytes);
    }
    if options.readings.is_some() || options.demands.is_some() {
        bail!("{path} is no flight: readings and demands need the truth");
    }
    if Trace::is_one(&bytes) {
        return trace::run(options, &bytes);
    }
    if options.svg.is_some() {
        bail!("{path}: a picture is made of a CSV of arrivals or a flight only");
    }
    let mut recording = match Recording::new(&bytes) {
        Ok(recording) => recording,
        Err(none) => bail!(
            "{path}: {none}; a recording of a u-blox receiver is wanted, or a CSV of \
             arrivals with the header `{HEADER}`"
        ),
    };
    let line = Published::new();
    let mut clock = UtcClock::new(Settings::DEFAULT, &line);
    let mut link = Link::new();
    let mut marks = 0_u32;
    while let Some(at) = recording.next_event() {
        let Some(burst) = recording.poll(at) else {
            break;
        };
        let stamped: Vec<_> = (0..)
            .zip(&burst.bytes)
            .map(|(index, &byte)| StampedByte {
                stamp: Cycles::from_nanos(burst.byte_end(index).0).stamp(),
                byte,
            })
            .collect();
        let now = Cycles::from_nanos(burst.end().0);
        while clock.poll_timeout() < now {
            clock.handle_timeout(clock.poll_timeout());
        }
        for chunk in stamped.chunks(Link::ROOM) {
            link.push(chunk);
            let then = chunk.last().map_or(now, |byte| byte.stamp.extend(now));
            while let Some(event) = link.poll(then) {
                let Event::NavPvt { mark, .. } = event else {
                    continue;
                };
                marks += 1;
                let outcome = clock.handle_mark(&mark, now);
                if !options.json {
                    let at_s = now.as_nanos() as f64 / 1e9;
                    println!("{at_s:>12.6} s  {}", told(&outcome));
                }
            }
        }
    }
    let (counted, heard) = (clock.counters(), link.counters());
    if options.json {
        let summary = json!({
            "nav_pvts": marks,
            "accepted": counted.accepted,
            "refused": counted.refused(),
            "sets": counted.sets,
            "bad_checksums": heard.bad_checksums,
            "foreign_bytes": heard.foreign_bytes,
        });
        println!("{summary}");
    } else {
        println!(
            "{marks} NAV-PVT: {} accepted, {} refused",
            counted.accepted,
            counted.refused()
        );
        println!("{counted:#?}\n{heard:#?}");
    }
    Ok(ExitCode::SUCCESS)
}

/// What a mark did, for people.
fn told(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Set => "sets the clock".to_owned(),
        Outcome::Slewed { error_ns } => format!("slews: the clock is {error_ns} ns behind"),
        Outcome::Stepped { by_ns } => format!("steps by {by_ns} ns"),
        Outcome::Confirmed => "agrees with the pulse".to_owned(),
        Outcome::Refused(refusal) => format!("refused: {refusal:?}"),
    }
}
