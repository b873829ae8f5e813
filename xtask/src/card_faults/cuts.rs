//! A power cut after each block that is written.
//!
//! *Design.* After each cut the card has to be one that another library mounts, every file of before
//! has to be as it was, and the new one is there in full or not at all. Clusters may be lost. Then the
//! card is used again, with what a power cut leaves.

use fat_image::{Census, FIRST};

use super::overlay::Overlay;
use super::specimens::{Specimen, block};
use super::tally::Tally;

/// A file of 30 blocks.
const FILE: [u8; 15_000] = [b'7'; 15_000];

/// Cuts at each; returns how many cards were not as they should be after that.
pub fn run(specimens: &[Specimen]) -> u64 {
    let mut failed = 0;
    for specimen in specimens {
        let mut whole = Overlay::new(specimen);
        whole.save(&FILE);
        let (mut files, mut again) = (Tally::default(), Tally::default());
        let mut lost = 0;
        for writes in 0..=whole.written {
            let mut card = Overlay::new(specimen).cut_after(writes);
            let outcome = card.save(&FILE);
            let image = card.image();
            let mut read = |number| block(&image, number);
            let census = Census::of(FIRST as u32, &mut read);
            let new = census.item("TEST0002CSV");
            let file = match new.map(|item| census.contents(item, &mut read) == FILE) {
                None => "no file",
                Some(true) => "whole file",
                Some(false) => "SHORT FILE",
            };
            files.add(file);
            lost = lost.max(census.lost());
            let missing = census.missing(&specimen.census);
            // It fails if it is none.
            let mounted = std::panic::catch_unwind(|| fat_image::files(&image).len());
            let is_wrong = card.foreign.is_some()
                || missing.is_some()
                || mounted.is_err()
                || file == "SHORT FILE"
                || outcome.word() == "saved" && file != "whole file";
            if is_wrong {
                let word = outcome.word();
                console::print_line!(
                    "  WRONG: cut after {writes} blocks: {word}, {file}, {missing:?}"
                );
            }
            failed += u64::from(is_wrong);
            card.powered();
            again.add(card.save(&FILE).word());
        }
        console::print_line!(
            "power cut after each of {} blocks: {}: {}, at most {lost} lost clusters; once more: {}",
            whole.written,
            specimen.name,
            files.line(),
            again.line()
        );
    }
    failed
}
