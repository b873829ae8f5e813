//! What a replay can be asked for.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use crate::image;

/// What a replay can be asked for.
#[derive(Args)]
pub struct Options {
    /// The recording: UBX, with whatever else was on the line, a CSV of arrivals
    /// with the header `local_us,gps_utc_us`, or the events of a flight (.ev)
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Of a CSV or a flight: where the picture goes; otherwise into target/replay/
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Of a flight: write each reading as `us,utc_ns,uncertainty_ns,state`
    #[arg(long, value_name = "FILE")]
    pub readings: Option<PathBuf>,
    /// Of a flight: judge it by the rows of this table that name it; exits with 1 if
    /// one is not met, with 2 if none names it
    #[arg(long, value_name = "FILE")]
    pub demands: Option<PathBuf>,
    /// The earliest date that the clock believes, for a recording that is older
    #[arg(long, value_name = "DATE")]
    pub floor: Option<jiff::civil::Date>,
    /// Print one JSON object instead of lines for people
    #[arg(long)]
    pub json: bool,
}

impl Options {
    /// The floor as the clock takes it, in ns of UTC since 1970.
    ///
    /// # Errors
    ///
    /// When it is beyond what these can count.
    pub fn floor_utc_ns(&self) -> Result<Option<i64>> {
        let Some(date) = self.floor else {
            return Ok(None);
        };
        let begins = date.to_zoned(jiff::tz::TimeZone::UTC)?.timestamp();
        let ns = i64::try_from(begins.as_nanosecond()).context("the floor's year is too far")?;
        Ok(Some(ns))
    }
    /// Where the picture goes: without `--svg` under `target`, because the recording's
    /// own folder may be somebody else's.
    ///
    /// # Errors
    ///
    /// When there can be no such folder.
    pub fn svg(&self) -> Result<PathBuf> {
        if let Some(file) = &self.svg {
            return Ok(file.clone());
        }
        let folder = image::target_dir()?.join("replay");
        std::fs::create_dir_all(&folder)?;
        let name = self.file.with_extension("svg");
        Ok(folder.join(name.file_name().unwrap_or_default()))
    }
}
