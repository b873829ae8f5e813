//! The clock as this language shows it.

/// What the clock stands on: the numbers of #52001.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// 0: there is no UTC yet.
    NotSet,
    /// 1: the receiver's messages.
    Messages,
    /// 2: its time pulse.
    Pulse,
    /// 3: what was learnt before both were lost.
    Holdover,
}

impl State {
    pub(crate) const fn number(self) -> u64 {
        match self {
            Self::NotSet => 0,
            Self::Messages => 1,
            Self::Pulse => 2,
            Self::Holdover => 3,
        }
    }
}

/// The clock at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// UTC since 1970, once the clock is set. \[ns\]
    pub utc_ns: Option<i64>,
    /// How far that may be off; `u32::MAX` is 4.29 s or more. \[ns\]
    pub uncertainty_ns: u32,
    /// What it stands on.
    pub state: State,
    /// Since boot. \[ns\]
    pub boot_ns: u64,
}
