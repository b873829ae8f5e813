//! Whether the board's clock may be believed, in one word.
//!
//! *Purpose.* The clock sets it, a reading and a sample carry it, the status line and the
//! log's file print it: one type, here, because these do not depend on each other.

use core::fmt;

/// Whether the board's clock shows UTC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockState {
    /// Never set: readings are the time since boot.
    #[default]
    Unset = 0,
    /// Set, and steered by a receiver.
    Set = 1,
    /// Set, but no receiver steers it any more: it runs on by itself.
    Holdover = 2,
    /// Set, but which second it is has not been proved, or is contradicted.
    Unproved = 3,
}

impl ClockState {
    /// The state as two bits, for a word that it shares with something else.
    #[must_use]
    #[inline]
    pub const fn bits(self) -> u32 {
        self as u32
    }

    /// The state that [`Self::bits`] were made of; `None` for any other number.
    #[must_use]
    #[inline]
    pub const fn from_bits(bits: u32) -> Option<Self> {
        match bits {
            0 => Some(Self::Unset),
            1 => Some(Self::Set),
            2 => Some(Self::Holdover),
            3 => Some(Self::Unproved),
            _ => None,
        }
    }

    /// Whether UTC is known to the second: it is set, and date and second are proved.
    #[must_use]
    #[inline]
    pub const fn is_proved(self) -> bool {
        matches!(self, Self::Set | Self::Holdover)
    }

    /// The word for it in status lines and files: `unset`, `set`, `holdover` or
    /// `unproved`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Unset => "unset",
            Self::Set => "set",
            Self::Holdover => "holdover",
            Self::Unproved => "unproved",
        }
    }
}

impl fmt::Display for ClockState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// The same words as `Display`.
#[cfg(feature = "defmt")]
impl defmt::Format for ClockState {
    fn format(&self, f: defmt::Formatter<'_>) {
        match self {
            Self::Unset => defmt::write!(f, "unset"),
            Self::Set => defmt::write!(f, "set"),
            Self::Holdover => defmt::write!(f, "holdover"),
            Self::Unproved => defmt::write!(f, "unproved"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_two_and_come_back() {
        for state in [
            ClockState::Unset,
            ClockState::Set,
            ClockState::Holdover,
            ClockState::Unproved,
        ] {
            assert!(state.bits() < 4);
            assert_eq!(ClockState::from_bits(state.bits()), Some(state));
        }
        assert_eq!(ClockState::from_bits(4), None);
    }
}
