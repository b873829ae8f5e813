//! What is observed of the clock, and what is to be done about it.

use timebase::Cycles;

use crate::holdover::Uncertainty;
use crate::utc::{Ppb, UtcNanos};

/// One mark or pulse beside the clock that it corrects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// When it arrived.
    pub at: Cycles,
    /// UTC at its arrival as the clock had it.
    pub published: UtcNanos,
    /// How far off the clock may have been then, its second's number apart; none while
    /// it is unset. \[ns\]
    pub uncertainty_ns: Option<f32>,
}

/// How the clock has to go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// UTC less the clock at the observation, in ns: positive when the clock is behind.
    pub error_ns: i64,
    /// How much faster than the crystal the clock has to run.
    pub frequency: Ppb,
    /// How far off it may be then, the receiver's latency apart.
    pub uncertainty: Uncertainty,
    /// How far the receiver's latency may be from the one that is corrected, or its pulse
    /// from UTC, in ns.
    pub latency_uncertainty_ns: u32,
    /// How far the frequency may be off beside that if nothing follows. \[ppb\]
    pub turned_ppb: f32,
    /// In how many ms the error is to be absorbed, if that is not too fast.
    pub absorb_ms: u32,
    /// For so long at most. \[cycles\]
    pub longest_slew: u64,
}

/// What is to be done about an observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Correction {
    /// Go on so.
    Follow(Course),
    /// The same, and the error may be stepped over: the first mark of all.
    First(Course),
    /// Step by the error; the clock is wrong beyond uncertainty.
    Step(Course),
    /// The second has another number: step by so much, and go on as before. \[ns\]
    Renumber(i64),
    /// Go on as before: the mark confirms a better source.
    Nothing,
}

/// A pulse that is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowedPulse {
    /// Its rise, and the clock then.
    pub observed: Observation,
    /// The error may be stepped over: the first one of a train.
    pub is_new: bool,
    /// Go on so.
    pub course: Course,
}
