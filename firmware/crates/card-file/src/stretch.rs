//! Blocks that belong together.

/// Blocks that follow each other on a card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stretch {
    pub(crate) first: u32,
    pub(crate) blocks: u32,
}

impl Stretch {
    /// Whether there is a block in both.
    pub(crate) fn overlaps(self, other: Self) -> bool {
        let end = |stretch: Self| stretch.first.saturating_add(stretch.blocks);
        self.first < end(other) && other.first < end(self)
    }
}
