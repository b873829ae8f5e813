//! Why a log is not on the card.

/// Why a log is not on the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum NotSaved {
    /// This board has no slot for a card.
    NoSlot,
    /// There is no card in the slot.
    NoCard,
    /// The card has no FAT16 or FAT32 volume in its first partition, or a damaged one.
    NotFat,
    /// The card is write-protected.
    WriteProtected,
    /// The card has no room, or no number, for the file.
    Full,
    /// The card was pulled, or replaced.
    Pulled,
    /// The card fails.
    Failed,
    /// A new test began meanwhile, and the log is that test's.
    Cleared,
}

impl From<card_file::NotSaved> for NotSaved {
    fn from(why: card_file::NotSaved) -> Self {
        use card_file::NotSaved as Why;
        match why {
            Why::NotFat => Self::NotFat,
            Why::WriteProtected => Self::WriteProtected,
            Why::Full => Self::Full,
            Why::Gone => Self::Pulled,
            Why::Failed => Self::Failed,
            Why::Short => Self::Cleared,
        }
    }
}
