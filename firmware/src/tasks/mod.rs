//! One async task a file: a loop that feeds a state machine.

pub mod gnss;
pub mod led;
pub mod mavlink;
pub mod status;
