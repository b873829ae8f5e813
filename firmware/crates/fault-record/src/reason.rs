//! Why a run ended.

/// A task that the watchdog is fed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hang {
    /// The GNSS task.
    Gnss,
    /// The MAVLink task.
    Mavlink,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The program found an error in itself.
    Panic,
    /// The core could not go on: a bus error, an undefined instruction, a stack overflow.
    HardFault,
    /// An exception or interrupt came that has no handler: the exception's number, from 2 on;
    /// interrupt n is 16 + n.
    Unexpected(u16),
    /// The crystal failed: it did not start, or the clock security system found that it stopped.
    Crystal,
    /// A task did not come by for a second.
    Task(Hang),
    /// The watchdog was not fed: the tick stopped, or something kept the core from everything below.
    Watchdog,
}

impl Reason {
    /// The number of the reason, from 1 on: how often a stopped board's LED flashes, and the value of
    /// a parameter.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Self::Panic => 1,
            Self::HardFault => 2,
            Self::Unexpected(_) => 3,
            Self::Crystal => 4,
            Self::Task(_) => 5,
            Self::Watchdog => 6,
        }
    }

    /// The word for it in a status line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Panic => "panic",
            Self::HardFault => "hard_fault",
            Self::Unexpected(_) => "no_handler",
            Self::Crystal => "crystal",
            Self::Task(_) => "task",
            Self::Watchdog => "watchdog",
        }
    }

    /// The number, and above it what there is beside it.
    pub(crate) const fn to_word(self) -> u32 {
        let detail = match self {
            Self::Unexpected(exception) => exception,
            Self::Task(Hang::Mavlink) => 1,
            _ => 0,
        };
        (detail as u32) << 16 | self.number() as u32
    }

    pub(crate) const fn from_word(word: u32) -> Option<Self> {
        let detail = (word >> 16) as u16;
        match (word & 0xFF, detail) {
            (1, _) => Some(Self::Panic),
            (2, _) => Some(Self::HardFault),
            (3, exception) => Some(Self::Unexpected(exception)),
            (4, _) => Some(Self::Crystal),
            (5, 0) => Some(Self::Task(Hang::Gnss)),
            (5, 1) => Some(Self::Task(Hang::Mavlink)),
            (6, _) => Some(Self::Watchdog),
            _ => None,
        }
    }
}
