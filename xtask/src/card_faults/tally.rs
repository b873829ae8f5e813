//! How often each outcome was seen.

use std::collections::BTreeMap;

/// Outcomes, counted.
#[derive(Default)]
pub struct Tally(BTreeMap<&'static str, u64>);

impl Tally {
    pub fn add(&mut self, outcome: &'static str) {
        *self.0.entry(outcome).or_default() += 1;
    }

    pub fn line(&self) -> String {
        let all = self.0.iter().map(|(what, count)| format!("{what} {count}"));
        all.collect::<Vec<_>>().join(", ")
    }
}
