//! What a mark or a pulse did to the clock, and which of them steers it.

use crate::refusal::{PulseRefusal, Refusal};

/// What a mark did to the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// It set the clock, which was unset.
    Set,
    /// The clock slews.
    Slewed {
        /// UTC less the clock by the marks. \[ns\]
        error_ns: i64,
    },
    /// The clock steps: what was dated by it may have to be dated anew.
    Stepped {
        /// What was added to it. \[ns\]
        by_ns: i64,
    },
    /// Nothing: it agrees with the pulse, which steers.
    Confirmed,
    /// It was refused: nothing.
    Refused(Refusal),
}

/// What a pulse did to the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PulseOutcome {
    /// Nothing yet: the pulses after it have to confirm it.
    Candidate,
    /// The clock slews.
    Slewed {
        /// UTC less the clock by the pulses. \[ns\]
        error_ns: i64,
    },
    /// The clock steps forward: the first pulse that is followed.
    Stepped {
        /// What was added to it. \[ns\]
        by_ns: i64,
    },
    /// It was refused: nothing.
    Refused(PulseRefusal),
}

/// What is known about which second it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SecondProof {
    /// It has not been proved since the clock was set.
    #[default]
    Open,
    /// Date and second are proved.
    Proved,
    /// They were proved or open, and marks name another one.
    Contradicted,
}

impl SecondProof {
    /// The word for it in a status line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Proved => "proved",
            Self::Contradicted => "contradicted",
        }
    }
}

/// The same word.
#[cfg(feature = "defmt")]
impl defmt::Format for SecondProof {
    fn format(&self, f: defmt::Formatter<'_>) {
        match self {
            Self::Open => defmt::write!(f, "open"),
            Self::Proved => defmt::write!(f, "proved"),
            Self::Contradicted => defmt::write!(f, "contradicted"),
        }
    }
}

/// What the clock is steered by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// Nothing: it is unset, or in holdover.
    #[default]
    Nothing,
    /// The receiver's messages.
    Message,
    /// The receiver's pulse; the messages number it.
    Pulse,
}

impl Source {
    /// The word for it in a status line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Nothing => "-",
            Self::Message => "message",
            Self::Pulse => "pulse",
        }
    }
}

/// The same word.
#[cfg(feature = "defmt")]
impl defmt::Format for Source {
    fn format(&self, f: defmt::Formatter<'_>) {
        match self {
            Self::Nothing => defmt::write!(f, "-"),
            Self::Message => defmt::write!(f, "message"),
            Self::Pulse => defmt::write!(f, "pulse"),
        }
    }
}
