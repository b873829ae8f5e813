//! Scenarios, replays of recordings, exhaustive and property tests of the firmware's logic.

pub mod captures;
pub mod checks;
pub mod mavlink_server;
