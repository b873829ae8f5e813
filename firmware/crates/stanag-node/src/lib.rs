//! What a clock answers to stations that speak STANAG 4586.
//!
//! *Purpose.* [`Node::push`] turns the bytes of a serial line into [`Request`]s, [`Node::handle`] those of a
//! datagram; [`Node::answer`] makes the frames to send of a request, the clock at its arrival and the clock
//! now. [`message`] has the numbers and fields, for both ends.
//!
//! *Design.* In two steps, because between them the caller reads the clock at the arrival. A datagram
//! that does not divide into whole frames is refused whole. Nothing that arrives here changes anything
//! but [`Counters`].
//!
//! - #1, Authorisation Request, to us or to all is answered with #2 and #3: LOI 2 (monitor) is granted and
//!   never more, for nothing here can be flown.
//! - #17002 is answered with the message that it asks for.
//! - #52000, ours, asks for the time to the nanosecond and is answered with #52001; #52004 for a parameter,
//!   answered with #52005.
//! - What asks for a change (#17001, #52003, #52005) is answered with what holds.
//! - Any message to us alone with bit 15 is answered with #17000 too.
//! - What is refused is counted by kind, and said in words to who sent it: #16000, at most one of a kind
//!   a second ([`Node::handle_second`]).
//!
//! Answers, reports and heartbeats are never answered, so two nodes make no loop. A frame from our own
//! id is somebody else with it.
//!
//! *Limits.* A clock that is not set leaves its Time Stamp out. The sources are in [`message`].
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod answer;
mod clock;
mod complaint;
mod config;
pub mod message;
mod node;
mod position;
mod request;

pub use clock::{Reading, State};
pub use complaint::Complaint;
pub use config::Config;
pub use node::{Counters, Node};
pub use request::Request;
