//! The line that speaks STANAG 4586: requests in, answers, heartbeats and positions out, on TELEM2.
//!
//! *Design.* In the image only if the setting `PIXCLOCK_STANAG` names the line, which speaks this and not MAVLink
//! then. An answer goes into the outgoing ring at once; what is sent each second has bytes of the ring that no answer
//! takes.

use core::task::{Context, Poll};

use stanag_node::{Config, Node, Request, State};
use stanag_wire::NodeId;
use timebase::{CORE_HZ, ClockState, Cycles, Fix};
use utc_clock::{Source, UtcNanos};

use super::mavlink::{News, ThisBoard, statustext};
use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::reports::{GNSS, STANAG, StanagReport};
use crate::settings::GIT_HASH;
use crate::{clock, image_words};

/// Our nodes' ids: the system's in the last byte. The first three are nobody's in particular.
const ID_BASE: u32 = 0x0050_4300;
/// The board's number, as AUTOPILOT_VERSION has it.
const BOARD: u16 = 9;
/// Bytes of the outgoing ring that are no answer's: heartbeat, position and two alerts.
const KEPT: usize = 320;
/// A solution is sent for this time after its arrival, in cycles: 2 s.
const FIX_LASTS: i64 = 2 * CORE_HZ as i64;

/// The line, with its node. MAVLink's task has it beside its own links: another task would cost a kilobyte.
pub struct Link {
    node: Node,
    reader: Reader,
    writer: Writer,
}

impl Link {
    /// Over that line.
    pub fn new((reader, writer): (Reader, Writer)) -> Self {
        let node = Node::new(Config {
            id: NodeId(ID_BASE | u32::from(image_words::system_id())),
            version: [
                number(env!("CARGO_PKG_VERSION_MAJOR")),
                number(env!("CARGO_PKG_VERSION_MINOR")),
                number(env!("CARGO_PKG_VERSION_PATCH")),
            ],
            git_hash: GIT_HASH,
            board: BOARD,
        });
        Self {
            node,
            reader,
            writer,
        }
    }

    /// Ready when bytes are there.
    pub fn poll_wait(&mut self, context: &Context<'_>) -> Poll<()> {
        self.reader.poll_wait(context)
    }

    /// Serves what has come in.
    #[inline(never)]
    pub fn serve(&mut self) {
        let now = time::now();
        let Self {
            node,
            reader,
            writer,
        } = self;
        reader.take(|bytes| {
            for &byte in bytes {
                if let Some(request) = node.push(byte, now) {
                    answer(node, writer, &request);
                }
            }
        });
    }

    /// Heartbeat, position, and an alert for each event and each kind of bad input.
    #[inline(never)]
    pub fn once_a_second(&mut self, news: &News) {
        let Self {
            node,
            reader,
            writer,
        } = self;
        let at = time::now();
        // Once a second is soon enough, and spares a timer at every burst of bytes.
        node.handle_timeout(at);
        let now = reading_at(at);
        if let Some((epoch_ns, fix)) = position(at, now.state) {
            node.handle_position(epoch_ns, &fix);
        }
        let send = &mut |bytes: &[u8]| {
            writer.send(bytes);
        };
        node.handle_second(&now, send);
        for event in news {
            let (severity, text) = statustext(*event);
            node.alert(&now, (severity, &text), send);
        }
        STANAG.set(StanagReport {
            node: node.counters(),
            line: reader.errors(),
        });
    }
}

/// A part of the version.
const fn number(digits: &str) -> u8 {
    let mut rest = digits.as_bytes();
    let mut number = 0;
    while let [digit, behind @ ..] = rest {
        number = number * 10 + (*digit - b'0');
        rest = behind;
    }
    number
}

#[inline(never)]
fn answer(node: &Node, writer: &mut Writer, request: &Request) {
    let at_arrival = reading_at(request.arrival);
    let now = reading_at(time::now());
    node.answer(request, (&at_arrival, &now), &ThisBoard, &mut |bytes| {
        writer.send_leaving(bytes, KEPT);
    });
}

/// The last solution, if it is recent, with UTC of its epoch as the receiver states it, once the clock is
/// set. [ns]
#[inline(never)]
fn position(at: Cycles, state: State) -> Option<(Option<i64>, Fix)> {
    let receiver = GNSS.get()?.receiver;
    let (arrival, fix) = receiver.fix?;
    if at.since(arrival) >= FIX_LASTS {
        return None;
    }
    let epoch_ns = receiver.epoch.and_then(|(epoch, validity)| {
        let is_stated = validity.date && validity.time && validity.fully_resolved;
        let utc = UtcNanos::from_civil(&epoch).ok()?;
        (is_stated && state != State::NotSet).then_some(utc.0)
    });
    Some((epoch_ns, fix))
}

/// The clock at `when`, as this language has it.
#[inline(never)]
fn reading_at(when: Cycles) -> stanag_node::Reading {
    let (time, reading) = clock::node_time_and_reading_at(when);
    let source = GNSS.get().map_or(Source::Nothing, |report| report.source);
    stanag_node::Reading {
        time,
        uncertainty_ns: u32::try_from(reading.uncertainty_ns).unwrap_or(u32::MAX),
        state: match reading.state {
            ClockState::Unset => State::NotSet,
            ClockState::Unproved => State::SecondUnproved,
            ClockState::Holdover => State::Holdover,
            ClockState::Set if source == Source::Pulse => State::Pulse,
            ClockState::Set => State::Messages,
        },
    }
}
