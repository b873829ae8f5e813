//! `sim`: virtual Pixhawks with simulated or replayed receivers, in real time.

use std::ffi::OsString;
use std::process::{Command, ExitCode};

use anyhow::Result;
use console::SimOptions;
use variant::Image;

use crate::image::{self, Board, Build};
use crate::{system, tool};

/// Builds the image and the emulator, if they are not up to date, and runs them.
///
/// # Errors
///
/// When one of them cannot be built.
pub fn run(options: &SimOptions, arguments: &[OsString]) -> Result<ExitCode> {
    let mut command = Command::new(tool::build("sim")?);
    command.args(arguments);
    if options.shared.image.is_none() {
        let image = image::build(Build {
            image: Image::of(options.shared.variant()),
            stanag: options.stanag.is_some(),
            ..Build::standard(Board::Pixhawk1)
        })?;
        command.arg("--image").arg(image);
    }
    system::become_it(&mut command)
}
