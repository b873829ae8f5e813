//! What STANAG 4586 puts on the wire, as Edition 3 has it.
//!
//! *Purpose.* Frames and fields for all who speak it: the wrapper with its sum, data that begin with a
//! presence vector, time stamps. What a message means stands with those who use it.
//!
//! *Design.* A message's data are a [`Layout`], the table of its fields' sizes: the presence vector says
//! which of them are there, so it also says how long the data are. [`Frame::read`] believes nothing that
//! it can check; [`Values`] and [`Builder`] read and write single fields. [`Framer`] finds frames on a serial
//! line, and believes more slowly: the sum is weak. Numbers are big-endian.
//!
//! ```
//! use stanag_wire::{Builder, Frame, Header, Layout, NodeId, Sum};
//!
//! /// #16002, a heartbeat: its time stamp and nothing else.
//! const HEARTBEAT: Layout = Layout { vector: 1, sizes: &[5] };
//! let mut data = Builder::new(&HEARTBEAT);
//! data.unsigned(0, 849_163_200_123);
//! let header = Header {
//!     source: NodeId(0x0050_4301),
//!     destination: NodeId::BROADCAST,
//!     message: 16_002,
//!     wants_acknowledgement: false,
//!     idd: Header::EDITION_3,
//!     sum: Sum::Bytes2,
//! };
//! let mut bytes = [0; 64];
//! let length = header.write(data.data(), &mut bytes).unwrap();
//! let (frame, rest) = Frame::read(&bytes[..length]).unwrap();
//! assert_eq!((frame.header, rest.len()), (header, 0));
//! let values = HEARTBEAT.values(frame.data).unwrap();
//! assert_eq!(values.unsigned(0), Some(849_163_200_123));
//! ```
//!
//! *Limits.* Edition 3's IDD 30 and its sums; of Edition 4 frames without a checksum or with the CRC-32 that its
//! implementations send.
//! The sum is weak: two bytes that change places always pass. *Sources.* The sections that the package
//! `synapse-cdm` 3.9.1 quotes, and its decoder, which accepts the frames of the tests.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

#[cfg(test)]
extern crate std;

mod fields;
mod frame;
mod framer;
mod node_id;
mod refusal;
mod time_stamp;

pub use fields::{Builder, Layout, Values};
pub use frame::{Frame, Header, MAX_DATA, MAX_FRAME, Sum};
pub use framer::{Framer, FramerCounters, Wanted};
pub use node_id::NodeId;
pub use refusal::Refusal;
pub use time_stamp::TimeStamp;
