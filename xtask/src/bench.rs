//! `bench`: what each job costs on the virtual board, in instructions.

use std::process::{Command, ExitCode};

use anyhow::Result;
use clap::Args;

use crate::image::{self, Board, Build};
use crate::{system, tool};

/// What the bench can be asked for.
#[derive(Args)]
pub struct Options {
    /// Print one JSON object instead of the table
    #[arg(long)]
    json: bool,
    /// Cycles that the board's core takes for an instruction
    #[arg(long, value_name = "N", default_value = "1.0")]
    cpi: String,
}

/// Builds the image that can be measured, and measures it.
///
/// # Errors
///
/// When something cannot be built.
pub fn run(options: &Options) -> Result<ExitCode> {
    let build = Build {
        bench: true,
        ..Build::standard(Board::Pixhawk1)
    };
    let image = image::build(build)?;
    let stanag = image::build(Build {
        stanag: true,
        ..build
    })?;
    let mut bench = Command::new(tool::build("bench")?);
    bench.arg("--image").arg(image);
    bench.arg("--stanag-image").arg(stanag);
    bench.args(["--cpi", &options.cpi]);
    if options.json {
        bench.arg("--json");
    }
    system::become_it(&mut bench)
}
