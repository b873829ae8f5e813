//! One async task a file: a loop that feeds a state machine.

mod configuration;
pub mod gnss;
pub mod led;
pub mod mavlink;
pub mod paper;
pub mod ready;
mod receiver;
#[cfg(stanag)]
pub mod stanag;
pub mod status;
pub mod usb;
