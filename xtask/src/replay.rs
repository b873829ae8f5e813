//! `replay`: a recording of a receiver through the very crates of the firmware.
//!
//! *Purpose.* What the clock would have made of it, without a board. Of a recording's
//! bytes (UBX): each NAV-PVT and what became of it, then everything that was
//! counted ([`recording`]). Of arrivals that a board logged (CSV): see [`trace`]. Of a
//! flight, what a board saw beside the truth (`.ev`): see [`flight`]. The file's content
//! says which it is.

mod flight;
mod flight_plot;
mod options;
mod plot;
mod recording;
mod trace;

use std::process::ExitCode;

use ::flight::Flight;
use anyhow::{Context, Result, bail};
use comparison::trace::Trace;

pub use options::Options;

use crate::csv_text;

/// Replays the file.
///
/// # Errors
///
/// When it cannot be read, or is none of the three.
pub fn run(options: &Options) -> Result<ExitCode> {
    let path = options.file.display();
    let read = std::fs::read(&options.file).with_context(|| format!("cannot read {path}"))?;
    let bytes = csv_text::plain(&read).with_context(|| format!("cannot read {path}"))?;
    if Flight::is_one(&bytes) {
        return flight::run(options, &bytes);
    }
    if options.readings.is_some() || options.demands.is_some() {
        bail!("{path} is no flight: readings and demands need the truth");
    }
    if Trace::is_one(&bytes) {
        return trace::run(options, &bytes);
    }
    recording::run(options, &bytes)
}
