//! The simulated world around a board: what it receives, when, and the truth to
//! judge its clock by.
//!
//! *Purpose.* A u-blox receiver ([`Receiver`]), the replay of a real one
//! ([`Recording`]) and the damage that a line does ([`Line`]), for the virtual
//! Pixhawk, for QEMU and for tests. For simulations of hours, the same receiver's
//! time marks without their bytes ([`Arrivals`]), its time pulse ([`Pulses`]) and a
//! board's oscillator ([`Crystal`]).
//!
//! *Design.* Everything that sends on the receiver's line is a [`Talker`]: a
//! state machine without I/O and without a clock, stepped from event to event in
//! [`WorldNanos`]. All chance comes from seeds, so that a run can be repeated to
//! the byte. The frames are encoded here, by hand, and share no code with the
//! crates under test.
//!
//! *Limits.* World time is true time: it runs at the rate of UTC. The virtual
//! Pixhawk has a crystal of its own, with a constant error.
#![forbid(unsafe_code)]

mod arrivals;
mod chance;
mod configuration;
mod crystal;
mod event;
mod excess;
mod faults;
mod latency;
mod line;
mod model;
mod pulse;
mod pulse_maker;
mod receiver;
mod recording;
pub mod schedule;
mod settings;
mod swap;
mod talker;
pub mod ubx;
mod wander;

pub use arrivals::{Arrival, Arrivals};
pub use crystal::{Crystal, CrystalSettings, NOMINAL_HZ, Ramp};
pub use event::{Event, EventKind, PulseName, WorldPicos};
pub use excess::Excess;
pub use faults::{PulseFault, PulseFaultKind, Stall, TimeFault};
pub use latency::Latency;
pub use line::{Damage, Damages, Line};
pub use model::Model;
pub use pulse::{Pulse, Pulses};
pub use receiver::Receiver;
pub use recording::{NoNavPvt, Recording};
pub use settings::{LeapKnowledge, LeftOn, Port, PulseSettings, ReceiverSettings};
pub use swap::Swap;
pub use talker::{Sent, Talker, Transmission, WorldNanos};
pub use wander::Wander;
