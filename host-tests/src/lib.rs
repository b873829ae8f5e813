//! Scenarios, replays of recordings, exhaustive and property tests of the firmware's logic.

pub mod captures;
pub mod clock_board;
pub mod clock_scene;
pub mod mavlink_server;
