//! A u-blox receiver on a serial line: its messages with their arrivals, and its configuration.
//!
//! *Purpose.* Bytes of the line become [`Event`]s: a NAV-PVT a [`TimeMark`](timebase::TimeMark) and
//! a [`Fix`], a TIM-TP a [`PulseForecast`](timebase::PulseForecast). And a receiver is configured,
//! whatever its settings were: 115200 baud, NAV-PVT alone at 5 Hz, and TIM-TP while it is wanted.
//! NAV-TIMELS is polled, and what the receiver is ([`Identity`]). With each of them comes for how long the line had been busy before it.
//! The types that matter:
//!
//! - [`Link`], which takes bytes and finds the frames in them;
//! - [`Event`], what a frame says;
//! - [`Session`], the configuration: which bytes are sent when, at which rate, and what to do
//!   without an answer.
//!
//! *Design.* Both are state machines without I/O, and time is an argument. The search for frames is
//! ours, at a cost that no stream can raise. Each whole frame goes once through the crate `ublox`,
//! which is not in the interface.
//!
//! *Limits.* u-blox M8 (protocol 15 to 23), M9, M10, F9, F10 and X20 (27 to 50), over a UART. Only
//! NAV-PVT of 92 bytes, TIM-TP, NAV-TIMELS, ACK-ACK and ACK-NAK are understood, and MON-VER and CFG-PRT
//! when they are asked for; everything else on the line is skipped and counted.
//!
//! ```
//! use timebase::{Cycles, StampedByte};
//! use ubx_link::{Action, Event, Link, Session};
//!
//! // A NAV-PVT for 2026-11-22 04:00:00 UTC, behind two bytes of noise.
//! let mut frame = vec![0xb5, 0x62, 0x01, 0x07, 92, 0];
//! frame.extend([0, 0, 0, 0, 0xea, 0x07, 11, 22, 4, 0, 0]);
//! frame.resize(6 + 92, 0);
//! let (mut a, mut b) = (0_u8, 0_u8);
//! for byte in &frame[2..] {
//!     a = a.wrapping_add(*byte);
//!     b = b.wrapping_add(a);
//! }
//! let line = [&[0xb5, 0x00], &frame[..], &[a, b]].concat();
//! // A byte each 87 µs, as on a line at 115200 baud.
//! let arrival = |nth: usize| Cycles(1_000_000 + 14_583 * nth as u64);
//! let stamped = |(nth, &byte)| StampedByte { stamp: arrival(nth).stamp(), byte };
//! let bytes: Vec<StampedByte> = line.iter().enumerate().map(stamped).collect();
//!
//! let mut link = Link::new();
//! let now = arrival(line.len());
//! assert_eq!(link.push(&bytes), bytes.len());
//! let event = link.poll(now).expect("an event");
//! let Event::NavPvt { mark, .. } = event else { panic!("another event") };
//! assert_eq!((mark.epoch.year, mark.epoch.hour), (2026, 4));
//! assert_eq!(mark.arrival, arrival(2));
//!
//! // The receiver is there, so it is asked what it is: MON-VER.
//! let mut session = Session::new();
//! session.handle_event(now, &event);
//! let Some(Action::Transmit(poll)) = session.poll(now) else { panic!("nothing to do") };
//! assert_eq!(poll[2..4], [0x0a, 0x04]);
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

mod answers;
mod config;
mod event;
mod fletcher;
mod frame_buffer;
mod identity;
mod keys;
mod kind;
pub mod link;
pub mod session;
mod unwanted;
mod window;

pub use config::{BAUD, BAUDS, PULSE_WIDTH_US, Setting};
pub use event::Event;
pub use identity::{Generation, Identity, Unusable};
pub use link::{Link, LinkCounters};
pub use session::{Action, Finding, Session, SessionCounters};
pub use timebase::Fix;
pub use unwanted::Unwanted;
