//! One async task a file: a loop that feeds a state machine; and what two of them share.

mod configuration;
pub mod gnss;
pub mod led;
pub mod mavlink;
pub mod paper;
pub mod status;
