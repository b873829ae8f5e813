//! Every single bit of the blocks on which all others depend.

use super::overlay::{Outcome, Overlay};
use super::specimens::Specimen;
use super::tally::Tally;

/// A file of 30 blocks.
const FILE: [u8; 15_000] = [b'7'; 15_000];

/// Flips each; returns how many flips were not treated as they should be.
pub fn run(specimen: &Specimen) -> u64 {
    let mut failed = 0;
    console::print_line!("every bit of: {}", specimen.name);
    let vital = specimen.census.vital();
    let mut names: Vec<&str> = vital.iter().map(|(name, _)| *name).collect();
    names.dedup();
    for name in names {
        let mut tally = Tally::default();
        let blocks = vital.iter().filter(|(one, _)| *one == name);
        for (_, number) in blocks {
            for bit in 0..4_096 {
                let mut card = Overlay::new(specimen);
                card.damage(*number, |block| block[bit / 8] ^= 1 << (bit % 8));
                let outcome = card.save(&FILE);
                tally.add(outcome.word());
                let is_panic = matches!(outcome, Outcome::Panicked);
                if let Some(foreign) = &card.foreign {
                    console::print_line!("  FOREIGN: bit {bit} of block {number}: {foreign}");
                }
                failed += u64::from(is_panic || card.foreign.is_some());
            }
        }
        console::print_line!("  {name:12} {}", tally.line());
    }
    failed
}
