//! Why a log is not on the card.

use defmt::{Format, Formatter};

/// Why a log is not on the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSaved {
    /// This board has no slot for a card.
    NoSlot,
    /// There is no card in the slot.
    NoCard,
    /// Of the card, or of what is on it.
    Card(card_file::NotSaved),
}

impl NotSaved {
    /// What is wrong and what to do, in at most 35 characters.
    pub const fn advice(self) -> &'static str {
        match self {
            Self::NoSlot => "this board has no card slot",
            Self::NoCard => "no card in the slot",
            Self::Card(why) => why.advice(),
        }
    }
}

impl From<card_file::NotSaved> for NotSaved {
    fn from(why: card_file::NotSaved) -> Self {
        Self::Card(why)
    }
}

impl Format for NotSaved {
    fn format(&self, f: Formatter<'_>) {
        match self {
            Self::NoSlot => defmt::write!(f, "NoSlot"),
            Self::NoCard => defmt::write!(f, "NoCard"),
            Self::Card(why) => defmt::write!(f, "{}", why),
        }
    }
}
