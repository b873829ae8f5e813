//! What a clock answers to stations that speak STANAG 4586.
//!
//! *Purpose.* [`Node::handle`] turns the bytes of a datagram into [`Request`]s; [`Node::answers`] turns
//! a request, the clock at its arrival and the clock now into the frames to send.
//!
//! *Design.* In two steps, because between them the caller reads the clock at the arrival. A datagram
//! that does not divide into whole frames is refused whole. Nothing that arrives here changes anything
//! but [`Counters`].
//!
//! - #1, Authorisation Request, to us or to all is answered with #2 and #3: LOI 2 (monitor) is granted and
//!   never more, for nothing here can be flown.
//! - #17002 is answered with the message that it asks for.
//! - #52000, ours, asks for the time to the nanosecond and is answered with #52001.
//! - Any message to us alone with bit 15 is answered with #17000 too.
//!
//! Answers, reports and heartbeats are never answered, so two nodes make no loop. A frame from our own
//! id is somebody else with it, and counted.
//!
//! *Limits.* Datagrams: on a serial line a framer would stand before this, and there is none yet. A clock
//! that is not set leaves its Time Stamp out. *Sources.* The layouts of #1, #2, #3, #17000 and #17002 are
//! those of implementations; #4000's is Edition 3's.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod clock;
mod node;
mod number;
mod position;

pub use clock::{Reading, State};
pub use node::{Answer, Config, Counters, Node, Request};
pub use position::Position;
