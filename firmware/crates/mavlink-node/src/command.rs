//! The one command that a node obeys: a test begins, a test ends.
//!
//! *Purpose.* MAV_CMD_USER_1 (31010) with 0 as its first parameter begins a test: the
//! log of PINGs is cleared and records. With 1 the test ends: the log is frozen, and
//! written to the card if there is one.
//!
//! *Design.* Read from the raw payload, since the type in `mavlink` can only name
//! commands that it knows, and any other one is to be refused.
//!
//! *Limits.* The same in COMMAND_LONG and COMMAND_INT; the other parameters are not
//! looked at, `confirmation` neither: one that begins a test and comes again clears
//! the log again.

/// MAV_CMD_USER_1.
pub(crate) const USER_1: u16 = 31_010;

/// What a test does now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    /// It begins.
    Begins,
    /// It ends.
    Ends,
}

impl Test {
    /// The command's first parameter.
    pub(crate) const fn param1(self) -> f32 {
        match self {
            Self::Begins => 0.0,
            Self::Ends => 1.0,
        }
    }
}
