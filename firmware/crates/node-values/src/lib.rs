//! What a node shows, whatever language it speaks.
//!
//! *Purpose.* The board speaks MAVLink on one line and may speak STANAG 4586 on another. What both need
//! stands here, so that neither knows the other: the node's time ([`NodeTime`]), its read-only
//! [`Parameter`]s, and texts for people with their [`Severity`]. A request's arrival is a
//! [`Cycles`](timebase::Cycles).
//!
//! *Design.* Values and a trait; nothing here has a message's layout.
//!
//! *Limits.* No parameter can be set.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod difference;
mod node_time;
mod parameter;
mod severity;
mod text;

pub use difference::difference;
pub use node_time::NodeTime;
pub use parameter::{Parameter, Parameters};
pub use severity::Severity;
pub use text::{Name, Text};
