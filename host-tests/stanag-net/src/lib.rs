//! STANAG 4586 on a host: the group of datagrams, a serial line beside it, and the station's side.
//!
//! *Purpose.* For `sim --stanag`, `ping stanag:` and `gateway`: [`Group`] sends and receives datagrams,
//! [`relay`] makes them fit for a line and takes a line's frames apart, [`station`] asks and reads answers.
//!
//! *Design.* Multicast stays on the loopback interface, with a time to live of 0. A unicast place is for
//! noise and load: there a node answers whoever spoke last.
//!
//! *Limits.* IPv4. On a line, frames of Edition 4 and those without a sum become frames of Edition 3 with
//! one; their answers are of Edition 3 then.

mod group;
pub mod relay;
pub mod station;

pub use group::{Group, Place};
