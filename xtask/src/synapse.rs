//! `synapse`: `synapse-cdm`, whose decoder of STANAG 4586 nobody here wrote, against ours.
//!
//! *Design.* A [`venv`] with the pinned release. Its own [fixtures] go through both decoders, and then it
//! decodes what a board of `sim --stanag` [sends](sent).
//!
//! *Limits.* What cannot be had here is SKIPPED, in CI too: it is a program of other people. It knows the
//! fields of #4000, and of no other message that is sent here.

mod decoder;
mod fixtures;
mod sent;

use anyhow::{Context, Result};

use crate::venv;
use decoder::Decoder;

const PACKAGE: &str = "synapse-cdm==3.9.1";

/// Lets it judge.
///
/// # Errors
///
/// When both decoders do not agree, or it has something to say against what a board sends.
pub fn run() -> Result<()> {
    let python = match venv::with("synapse-venv", "synapse_cdm", &[&[PACKAGE]]) {
        Ok(python) => python,
        Err(error) => {
            console::print_line!("SKIPPED: {PACKAGE} could not be installed: {error:#}");
            return Ok(());
        }
    };
    let mut decoder = Decoder::start(&python)?;
    let folder = decoder::fixtures(&python)?;
    fixtures::compare(&mut decoder, &folder).context("its own fixtures")?;
    sent::judge(&mut decoder).context("what a board sends")
}
