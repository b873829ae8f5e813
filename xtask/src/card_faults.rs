//! `card-faults`: what becomes of damaged cards, and of cards that are pulled.
//!
//! *Purpose.* Each card is given to the board's code, and a judge who knows which blocks are whose
//! looks at every block that is written. Three campaigns: every single bit of the blocks on which all
//! others depend ([`bits`]), cards with several damages ([`damaged`]), and a power cut after each
//! block ([`cuts`]). With `--images`, one more: cards as people have them ([`images`]).
//!
//! *Limits.* The cards of the first three are made here, and are small.

mod bits;
mod cuts;
mod damaged;
mod image_check;
mod images;
mod overlay;
mod specimens;
mod tally;

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Args;

/// What can be asked for.
#[derive(Args)]
pub struct Options {
    /// What is checked each time: every bit of one card, 1000 damaged cards, the power cuts
    #[arg(long)]
    check: bool,
    /// How many cards with several damages
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    damaged: u64,
    /// Cards as people have them, by this script, and nothing else; needs dosfstools, mtools,
    /// fdisk and gdisk
    #[arg(long, value_name = "CARDS.PY", conflicts_with = "check")]
    images: Option<PathBuf>,
    /// Only the cards of these names
    #[arg(long, value_name = "NAME", requires = "images")]
    only: Vec<String>,
}

/// Runs the campaigns.
///
/// # Errors
///
/// When code panicked, somebody else's block was written, or a card was lost.
pub fn run(options: &Options) -> Result<()> {
    if let Some(script) = &options.images {
        return images::run(script, &options.only);
    }
    let (cards, damaged) = if options.check {
        (1, 1_000)
    } else {
        (usize::MAX, options.damaged)
    };
    let specimens = specimens::four();
    let mut failed = 0;
    for specimen in specimens.iter().take(cards) {
        failed += bits::run(specimen);
    }
    failed += damaged::run(&specimens, damaged);
    failed += cuts::run(&specimens::six());
    ensure!(
        failed == 0,
        "{failed} cards were not treated as they should be"
    );
    Ok(())
}
