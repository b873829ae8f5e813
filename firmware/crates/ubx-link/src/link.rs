//! Bytes in, events out: the search for frames.
//!
//! *Purpose.* To find each frame of ours among NMEA, RTCM3, other UBX, damage and
//! noise, whatever the cutting of the bytes: exactly those that a search of every
//! offset from the left would find whose header is one of ours and whose checksum
//! holds, none overlapping another.
//!
//! *Design.* Two steps take turns. *Fill* takes bytes off the line until as many
//! are held as the next decision needs: a whole frame where a header stands at the
//! front, else the shortest frame that there is, since nothing can be complete
//! before. *Examine* decides: it judges the frame at the front, or gives up bytes
//! until another header stands there. Within a frame that fails, the search goes
//! on at its second byte, among the bytes already held. So each byte is taken
//! once and given up once, and no input costs more than that and, at most once in
//! six bytes, a look at a checksum that is already there ([`window`](crate::window)).
//!
//! A frame that was cut short would wait for bytes of the next one. It fails when
//! those come; and if the line falls silent instead for [`IDLE`], the bytes are
//! given up, so that no answer behind it waits for the next solution.
//!
//! *Limits.* An event waits for no byte behind it, but for a longer frame that
//! begins before it and may yet turn out to be whole.

use timebase::{CORE_HZ, Cycles, StampedByte};

use crate::event::{self, Event};
use crate::kind::{Header, Kind, SHORTEST, SYNC_1};
use crate::window::Window;

/// A line that has been silent for this long is between frames, in cycles: 20 ms.
/// A receiver sends a frame without pauses, and a byte lasts 2.1 ms at 4800 baud,
/// the slowest it can be set to; at 5 Hz a burst at 115200 is followed by 190 ms
/// of silence.
pub const IDLE: u32 = CORE_HZ / 50;

/// How far a stamp may be *ahead* of the `now` of the same call, in cycles:
/// 100 ms. Bytes keep arriving while a ring is drained.
const AHEAD: u32 = CORE_HZ / 10;

/// What has come over the line so far. Each wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkCounters {
    /// Good frames: NAV-PVT.
    pub nav_pvts: u32,
    /// Good frames: ACK-ACK.
    pub acks: u32,
    /// Good frames: ACK-NAK.
    pub naks: u32,
    /// Frames that looked like ours and whose checksum did not hold.
    pub bad_checksums: u32,
    /// Frames that looked like ours and broke off before an idle line.
    pub truncated: u32,
    /// Frames whose checksum held and that `ublox` would not read.
    pub refused: u32,
    /// Headers of ours by class and id, but with another length.
    pub false_lengths: u32,
    /// UBX headers of messages that we do not use.
    pub other_messages: u32,
    /// First sync bytes (0xB5) without the second.
    pub lone_syncs: u32,
    /// Dollar signs outside of frames: the beginnings of NMEA sentences.
    pub nmea_starts: u32,
    /// Bytes that belonged to no good frame, all of the above included.
    pub foreign_bytes: u32,
}

/// The receiving side of the line to the receiver; see the [module](self).
#[derive(Clone, Debug)]
pub struct Link {
    window: Window,
    /// The frame whose header stands at the front of the window.
    candidate: Option<Kind>,
    /// How many bytes have to be held before the next decision.
    wanted: usize,
    counters: LinkCounters,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// A line on which nothing has been heard.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            window: Window::new(),
            candidate: None,
            wanted: SHORTEST,
            counters: LinkCounters {
                nav_pvts: 0,
                acks: 0,
                naks: 0,
                bad_checksums: 0,
                truncated: 0,
                refused: 0,
                false_lengths: 0,
                other_messages: 0,
                lone_syncs: 0,
                nmea_starts: 0,
                foreign_bytes: 0,
            },
        }
    }

    /// What has come over the line so far.
    #[must_use]
    pub const fn counters(&self) -> LinkCounters {
        self.counters
    }

    /// Takes bytes from `next` until one of them completes a frame, or until
    /// `next` runs dry (`None`): call until then, each time there may be bytes,
    /// and at least every 25 s even without any. A byte may be stamped up to
    /// 100 ms later than `now`, because bytes keep arriving while a ring is drained.
    #[inline]
    pub fn poll(
        &mut self,
        now: Cycles,
        mut next: impl FnMut() -> Option<StampedByte>,
    ) -> Option<Event> {
        loop {
            let dry = self.window.fill(&mut next);
            let idle = self.window.len() < self.wanted;
            if idle && !self.is_idle(now) {
                return None;
            }
            let event = self.examine(now, idle);
            if dry || event.is_some() {
                return event;
            }
        }
    }

    /// Whether bytes are held and none have come for [`IDLE`].
    fn is_idle(&self, now: Cycles) -> bool {
        self.window.last_stamp().is_some_and(|last| {
            let since = now.plus(AHEAD.into()).stamp().0.wrapping_sub(last.0);
            since >= IDLE + AHEAD
        })
    }

    /// Decides about what is held, up to the first event. Where the line is idle,
    /// what is incomplete has failed.
    #[inline(never)]
    fn examine(&mut self, now: Cycles, idle: bool) -> Option<Event> {
        loop {
            if let Some(kind) = self.candidate {
                let failed = if self.window.len() < kind.frame_len() {
                    if !idle {
                        return None;
                    }
                    &mut self.counters.truncated
                } else if !self.holds(kind) {
                    &mut self.counters.bad_checksums
                } else if let Some(event) = self.accept(kind, now) {
                    return Some(event);
                } else {
                    &mut self.counters.refused
                };
                *failed = failed.wrapping_add(1);
                self.give_up(1);
            }
            self.search();
            if self.candidate.is_none() {
                if idle {
                    self.give_up(self.window.len());
                }
                return None;
            }
        }
    }

    /// Whether the checksum of the frame at the front holds.
    #[inline]
    fn holds(&mut self, kind: Kind) -> bool {
        match kind {
            Kind::NavPvt => self.window.longest_frame_holds(),
            Kind::Ack | Kind::Nak => self.window.short_frame_holds::<SHORTEST>(),
        }
    }

    /// Hands the frame at the front on, and out of the window.
    fn accept(&mut self, kind: Kind, now: Cycles) -> Option<Event> {
        let arrival = self.window.first_stamp().extend(now.plus(AHEAD.into()));
        let event = event::parse(kind, self.window.held(), arrival)?;
        let counters = &mut self.counters;
        let good = match kind {
            Kind::NavPvt => &mut counters.nav_pvts,
            Kind::Ack => &mut counters.acks,
            Kind::Nak => &mut counters.naks,
        };
        *good = good.wrapping_add(1);
        self.window.give_up(kind.frame_len());
        self.expect(None);
        Some(event)
    }

    /// Gives up bytes until a header of ours stands at the front, or what may
    /// become one.
    #[inline]
    fn search(&mut self) {
        let counters = &mut self.counters;
        let held = self.window.held();
        let mut found = None;
        let mut rest = held;
        while let Some((first, behind)) = rest.split_first() {
            let counter = match *first {
                SYNC_1 => match Header::at(rest) {
                    Header::Unfinished => break,
                    Header::Ours(kind) => {
                        found = Some(kind);
                        break;
                    }
                    Header::LoneSync => &mut counters.lone_syncs,
                    Header::OtherMessage => &mut counters.other_messages,
                    Header::FalseLength => &mut counters.false_lengths,
                },
                b'$' => &mut counters.nmea_starts,
                _ => {
                    rest = behind;
                    continue;
                }
            };
            *counter = counter.wrapping_add(1);
            rest = behind;
        }
        self.give_up(held.len().wrapping_sub(rest.len()));
        self.expect(found);
    }

    /// Gives up the `length` oldest bytes as foreign.
    #[inline]
    fn give_up(&mut self, length: usize) {
        self.counters.foreign_bytes = self.counters.foreign_bytes.wrapping_add(length as u32);
        self.window.give_up(length);
    }

    /// Notes what stands at the front, and how much has to be held to judge it.
    fn expect(&mut self, candidate: Option<Kind>) {
        self.candidate = candidate;
        self.wanted = candidate.map_or(SHORTEST, Kind::frame_len);
    }
}
