//! A serial line whose far end is a group of datagrams.
//!
//! *Purpose.* The far end of the board's line that speaks STANAG 4586: what the board sends are datagrams
//! of one frame each, and datagrams of others go on the line.
//!
//! *Design.* As [`TcpLine`](crate::TcpLine): the sockets are looked at once a ms of true time and never
//! waited for, and no more is taken than the line carries.
//!
//! *Limits.* Datagrams that do not divide into whole frames stay out.

use stanag_net::relay::{self, FromLine};
use stanag_net::{Group, Place};
use world::{Sent, Talker, Transmission, WorldNanos};

const LOOK_EVERY_NS: u64 = 1_000_000;
/// Nothing is taken while the line is busy for longer than this.
const AHEAD_NS: u64 = 5_000_000;
/// The speed of the line until the board has sent something.
const FIRST_BAUD: u32 = 115_200;

/// A member of the group as the far end of a line.
#[derive(Debug)]
pub struct StanagLine {
    group: Group,
    from_board: FromLine,
    baud: u32,
    next_look: WorldNanos,
    line_free: WorldNanos,
}

impl StanagLine {
    /// Joins the group.
    ///
    /// # Errors
    ///
    /// The port cannot be had.
    pub fn join(place: Place) -> anyhow::Result<Self> {
        let group = Group::node(place)?;
        group.set_patience(None)?;
        Ok(Self {
            group,
            from_board: FromLine::default(),
            baud: FIRST_BAUD,
            next_look: WorldNanos(0),
            line_free: WorldNanos(0),
        })
    }
}

impl Talker for StanagLine {
    fn next_event(&self) -> Option<WorldNanos> {
        Some(self.next_look)
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        if now < self.next_look {
            return None;
        }
        self.next_look = now.plus(LOOK_EVERY_NS);
        if self.line_free > now.plus(AHEAD_NS) {
            return None;
        }
        let mut buffer = [0; 2_048];
        // A socket that fails is as silent as an empty one.
        let datagram = self.group.receive(&mut buffer).ok().flatten()?;
        let bytes = relay::for_line(datagram).ok().filter(|it| !it.is_empty())?;
        let transmission = Transmission {
            start: now.max(self.line_free),
            bytes,
            baud: self.baud,
        };
        self.line_free = transmission.end();
        Some(transmission)
    }

    fn handle_bytes(&mut self, _: WorldNanos, baud: u32, bytes: &[u8]) {
        self.baud = baud;
        for frame in self.from_board.push(bytes) {
            self.group.send(&frame);
        }
    }

    fn truth(&self) -> &[Sent] {
        &[]
    }
}
