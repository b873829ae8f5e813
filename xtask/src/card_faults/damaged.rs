//! Cards with several damages at once, drawn for each copy apart.
//!
//! *Limits.* Where both copies of a thing have the same damage, nothing on the card shows it: such
//! cards are counted apart, and must not end in a panic.

use std::collections::BTreeMap;

use fastrand::Rng;
use fat_image::Block;

use super::overlay::{Outcome, Overlay};
use super::specimens::{Specimen, block};
use super::tally::Tally;

/// A file of 30 blocks.
const FILE: [u8; 15_000] = [b'7'; 15_000];

/// Damages that many cards; returns how many were not treated as they should be.
pub fn run(specimens: &[Specimen], cards: u64) -> u64 {
    let mut failed = 0;
    let mut tally = Tally::default();
    let mut alike = Tally::default();
    for seed in 0..cards {
        let mut rng = Rng::with_seed(seed);
        let specimen = &specimens[rng.usize(..specimens.len())];
        let mut card = Overlay::new(specimen);
        let vital = specimen.census.vital();
        for _ in 0..rng.usize(2..=6) {
            let (_, number) = vital[rng.usize(..vital.len())];
            card.damage(number, |block| damage(&mut rng, block));
        }
        let agree = copies_agree(specimen, &card);
        let outcome = card.save(&FILE);
        let is_panic = matches!(outcome, Outcome::Panicked);
        if agree {
            alike.add(if card.foreign.is_some() {
                "foreign"
            } else {
                outcome.word()
            });
            failed += u64::from(is_panic);
            continue;
        }
        tally.add(outcome.word());
        if let Some(foreign) = &card.foreign {
            console::print_line!("  FOREIGN: card {seed}, {}: {foreign}", specimen.name);
        }
        failed += u64::from(is_panic || card.foreign.is_some());
    }
    console::print_line!("{cards} cards with several damages: {}", tally.line());
    console::print_line!(
        "  of which both copies agree on the damage: {}",
        alike.line()
    );
    failed
}

/// A bit, a byte, some bytes, or all of it.
fn damage(rng: &mut Rng, block: &mut Block) {
    let at = rng.usize(..block.len());
    match rng.u32(..8) {
        0..3 => block[at] ^= 1 << rng.u32(..8),
        3..6 => block[at] = rng.u8(..),
        6 => {
            let end = block.len().min(at + 16);
            rng.fill(&mut block[at..end]);
        }
        _ => block.fill(if rng.bool() { 0 } else { 0xFF }),
    }
}

/// Whether a byte is wrong in two copies, and the same in both.
fn copies_agree(specimen: &Specimen, card: &Overlay<'_>) -> bool {
    let mut copies: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for (name, number) in specimen.census.vital() {
        copies.entry(name).or_default().push(number);
    }
    let pairs = [("boot record", "backup"), ("first table", "second table")];
    pairs.into_iter().any(|(one, other)| {
        let numbers = |name| copies.get(name).into_iter().flatten().copied();
        numbers(one).zip(numbers(other)).any(|(one, other)| {
            let was = [one, other].map(|number| block(&specimen.image, number));
            let Some([one, other]) = card.block(one).zip(card.block(other)).map(<[_; 2]>::from)
            else {
                return false;
            };
            (0..one.len())
                .any(|at| one[at] != was[0][at] && other[at] != was[1][at] && one[at] == other[at])
        })
    })
}
