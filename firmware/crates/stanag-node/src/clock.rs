//! The clock as this language shows it.

use node_values::NodeTime;

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
    /// 4: set, and its second is not proved.
    SecondUnproved,
}

impl State {
    /// Its number in #52001.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Self::NotSet => 0,
            Self::Messages => 1,
            Self::Pulse => 2,
            Self::Holdover => 3,
            Self::SecondUnproved => 4,
        }
    }
}

/// The clock at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Since boot, and UTC once the clock is set.
    pub time: NodeTime,
    /// How far that may be off; `u32::MAX` is 4.29 s or more. \[ns\]
    pub uncertainty_ns: u32,
    /// What it stands on.
    pub state: State,
}
