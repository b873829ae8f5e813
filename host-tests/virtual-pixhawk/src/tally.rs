//! How often something ran, and what it cost.

/// How many times something ran, and the instructions that it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Completed activations or calls.
    pub times: u64,
    /// Instructions of all of them together.
    pub instructions: u64,
    /// The fewest of one; 0 if there was none.
    pub least: u64,
    /// The most of one.
    pub most: u64,
}

impl Tally {
    pub(crate) fn add(&mut self, instructions: u64) {
        self.least = match self.times {
            0 => instructions,
            _ => self.least.min(instructions),
        };
        self.most = self.most.max(instructions);
        self.times += 1;
        self.instructions += instructions;
    }
}
