//! The simulated world around a board: what it hears, when, and the truth to
//! judge its answers by.
//!
//! *Purpose.* A u-blox receiver ([`Receiver`]), the replay of a real one
//! ([`Recording`]) and the damage that a line does ([`Line`]), for the virtual
//! Pixhawk, for QEMU and for tests.
//!
//! *Design.* Everything that talks over the receiver's line is a [`Talker`]: a
//! state machine without I/O and without a clock, stepped from event to event in
//! [`WorldNanos`]. All chance comes from seeds, so that a run can be repeated to
//! the byte. The frames are encoded here, by hand, and share no code with the
//! crates under test.
//!
//! *Limits.* World time is true time: it runs at the rate of UTC. The error of a
//! board's crystal belongs to the board's emulator.
#![forbid(unsafe_code)]

mod line;
pub mod others;
mod receiver;
mod recording;
mod settings;
mod talker;
pub mod ubx;

pub use line::{Damage, Damages, Line};
pub use receiver::Receiver;
pub use recording::{NoNavPvt, Recording};
pub use settings::{Latency, Port, ReceiverSettings};
pub use talker::{Sent, Talker, Transmission, WorldNanos};
