//! Bytes in, events out: the search for frames.
//!
//! *Purpose.* Each frame of ours is found among NMEA, RTCM3, other UBX, damage and noise, however
//! the bytes are cut into pieces: exactly the frames that a search of every offset from the left
//! would find, whose header is one of ours and whose checksum holds, and which do not overlap.
//!
//! *Design.* Two steps take turns. *Fill* takes what the line has. *Examine* waits until enough
//! bytes are held for the next decision: a whole frame if a header is at the front, else the
//! shortest frame that there is, since nothing can be complete before. Then it checks the frame at
//! the front, or removes bytes until another header is there. After a frame that fails, the search
//! goes on at its second byte, among the bytes already held. So each byte is taken once, removed
//! once and summed at most twice. The extra cost of a header arises at most once in six bytes.
//!
//! Measured on a Cortex-M4, from the ring and in pieces of 57 bytes (5 ms at 115200): 29
//! instructions a byte for good frames, 33 for NMEA, 59 for headers without end; a poll without a
//! byte is 54.
//!
//! A frame that was cut short would wait for bytes of the next one. It fails when those come. If
//! the line is silent for [`Link::IDLE`] instead, its bytes are removed, so that an answer behind
//! it does not wait for the next solution.
//!
//! *Limits.* An event does not wait for bytes behind it, except for those of a longer frame that
//! begins before it and may still prove to be whole.

use timebase::{CORE_HZ, Cycles, Stamp, StampedByte};

use crate::config::BAUD;
use crate::event::{self, Event};
use crate::fletcher::Fletcher;
use crate::kind::{CHECKSUM_LEN, Header, Kind, LONGEST, SHORTEST, SYNC_1, SYNC_LEN};
use crate::unwanted::Unwanted;
use crate::window::{CAPACITY, Window};

/// How much later than the `now` of the same call a byte may be stamped, in cycles: 100 ms. Bytes
/// arrive while a ring is drained.
const AHEAD: u32 = CORE_HZ / 10;

/// What has come over the line so far. All wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkCounters {
    /// Good frames: NAV-PVT.
    pub nav_pvts: u32,
    /// Good frames: TIM-TP.
    pub tim_tps: u32,
    /// Good frames: NAV-TIMELS.
    pub nav_timels: u32,
    /// Good frames: ACK-ACK.
    pub acks: u32,
    /// Good frames: ACK-NAK.
    pub naks: u32,
    /// Frames with a header of ours whose checksum did not hold.
    pub bad_checksums: u32,
    /// Frames with a header of ours that broke off before an idle line.
    pub truncated: u32,
    /// Frames whose checksum held, but which `ublox` refused, or whose own flags say that they have
    /// no value (TIM-TP).
    pub refused: u32,
    /// Headers of ours by class and id, but with another length.
    pub false_lengths: u32,
    /// UBX headers of messages that we do not use.
    pub other_messages: u32,
    /// First sync bytes (0xB5) without the second.
    pub lone_syncs: u32,
    /// Dollar signs outside of frames: the beginnings of NMEA sentences.
    pub nmea_starts: u32,
    /// Bytes that belonged to no good frame, those of the above included.
    pub foreign_bytes: u32,
}

/// The receiving side of the line to the receiver; see the [module](self).
#[derive(Clone, Debug)]
pub struct Link {
    window: Window,
    sums: Sums,
    /// The frame whose header is at the front of the window.
    candidate: Option<Kind>,
    /// The number of bytes that have to be held before the next decision.
    wanted: usize,
    seen: Seen,
}

/// What was met on the way.
#[derive(Clone, Debug)]
struct Seen {
    counters: LinkCounters,
    /// Class and id of the last message that we do not use, until it is asked for; 0 is none.
    other_message: u16,
    /// A sentence of NMEA was met, until it is asked for.
    has_nmea: bool,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// A line that has been silent for this long, in cycles, is between frames: 20 ms.
    ///
    /// A receiver sends a frame without pauses, and a byte lasts 2.1 ms at 4800 baud, the slowest
    /// rate that it can have. At 5 Hz and 115200 baud a burst is followed by 190 ms of silence.
    pub const IDLE: u32 = CORE_HZ / 50;

    /// The number of bytes for which there is room behind a frame that was cut short.
    pub const ROOM: usize = CAPACITY - LONGEST;

    /// A line at [`BAUD`] on which nothing has been received.
    #[must_use]
    pub const fn new() -> Self {
        Self::at(BAUD)
    }

    /// The same at another rate, in baud.
    #[must_use]
    pub const fn at(baud: u32) -> Self {
        Self {
            window: Window::at(baud),
            sums: Sums::START,
            candidate: None,
            wanted: SHORTEST,
            seen: Seen {
                other_message: 0,
                has_nmea: false,
                counters: LinkCounters {
                    nav_pvts: 0,
                    tim_tps: 0,
                    nav_timels: 0,
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
            },
        }
    }

    /// What has come over the line so far.
    #[must_use]
    pub const fn counters(&self) -> LinkCounters {
        self.seen.counters
    }

    /// The UART has another rate from now on, in baud: an idle line is measured in
    /// bytes.
    pub const fn handle_baud(&mut self, baud: u32) {
        self.window.handle_baud(baud);
    }

    /// The last message that we do not use, once; see
    /// [`Session::handle_unwanted`](crate::Session::handle_unwanted). After [`Self::poll`] has
    /// returned `None`.
    #[inline]
    pub const fn poll_unwanted(&mut self) -> Option<Unwanted> {
        let seen = &mut self.seen;
        if seen.has_nmea {
            seen.has_nmea = false;
            return Some(Unwanted::Nmea);
        }
        match core::mem::replace(&mut seen.other_message, 0).to_le_bytes() {
            [0, 0] => None,
            [class, id] => Some(Unwanted::Ubx { class, id }),
        }
    }

    /// Takes bytes of the line, as many as there is room for, and returns how many. There is room
    /// for [`Self::ROOM`] after [`Self::poll`] has returned `None`.
    #[inline]
    pub fn push(&mut self, bytes: &[StampedByte]) -> usize {
        self.window.fill(bytes)
    }

    /// The next event. Call until there is none, after each [`Self::push`] and at
    /// [`Self::poll_timeout`].
    ///
    /// A byte may be stamped up to 100 ms later than `now`, because bytes arrive meanwhile. If a
    /// backlog is pushed in several pieces, `now` is the time of each piece: with a later one, the
    /// line would seem to be idle behind it.
    pub fn poll(&mut self, now: Cycles) -> Option<Event> {
        loop {
            let idle = self.window.len() < self.wanted;
            if idle && !self.is_idle(now) {
                return None;
            }
            let kind = self.examine(idle)?;
            let event = self.take(kind, now);
            if event.is_some() {
                return event;
            }
        }
    }

    /// When to call [`Self::poll`] if no byte comes before, so that a frame that was cut short is
    /// given up; `None` if no bytes are held. `now` as for `poll`.
    #[must_use]
    pub fn poll_timeout(&self, now: Cycles) -> Option<Cycles> {
        let newest = self.newest()?.extend(now.plus(AHEAD.into()));
        Some(newest.plus(Self::IDLE.into()))
    }

    /// When the newest of the held bytes arrived.
    #[inline]
    fn newest(&self) -> Option<Stamp> {
        self.window.stamp(self.window.len().checked_sub(1)?)
    }

    /// Whether bytes are held and none have come for [`Self::IDLE`].
    #[inline]
    fn is_idle(&self, now: Cycles) -> bool {
        self.newest().is_some_and(|newest| {
            let since = now.plus(AHEAD.into()).stamp().0.wrapping_sub(newest.0);
            since >= Self::IDLE + AHEAD
        })
    }

    /// Examines what is held, up to the first good frame, which is then at the front of the window:
    /// its kind. If the line is idle, what is incomplete has failed.
    #[inline(never)]
    fn examine(&mut self, idle: bool) -> Option<Kind> {
        let held = self.window.held();
        let seen = &mut self.seen;
        let mut sums = self.sums;
        let mut candidate = self.candidate;
        let mut rest = held;
        let good = loop {
            if let Some(kind) = candidate {
                let failed = match rest.get(..kind.frame_len()) {
                    Some(frame) if sums.hold(kind, frame) => break candidate,
                    Some(_) => &mut seen.counters.bad_checksums,
                    None if idle => &mut seen.counters.truncated,
                    None => break None,
                };
                count(failed, 1);
                rest = sums.pass(rest);
            }
            (rest, candidate) = search(rest, &mut sums, seen);
            if candidate.is_none() {
                if idle {
                    rest = &[];
                }
                break None;
            }
        };
        let foreign = held.len().wrapping_sub(rest.len());
        count(&mut seen.counters.foreign_bytes, foreign);
        self.sums = sums;
        self.window.give_up(foreign);
        self.expect(candidate);
        good
    }

    /// Takes the good frame of `kind` from the front of the window.
    #[inline]
    fn take(&mut self, kind: Kind, now: Cycles) -> Option<Event> {
        let stamp = self.window.stamp(0).unwrap_or_default();
        let event = event::parse(
            kind,
            self.window.held(),
            stamp.extend(now.plus(AHEAD.into())),
            micros(self.window.busy()),
        );
        let counters = &mut self.seen.counters;
        let counter = match kind {
            _ if event.is_none() => &mut counters.refused,
            Kind::NavPvt => &mut counters.nav_pvts,
            Kind::TimTp => &mut counters.tim_tps,
            Kind::NavTimeLs => &mut counters.nav_timels,
            Kind::Ack => &mut counters.acks,
            Kind::Nak => &mut counters.naks,
        };
        count(counter, 1);
        self.sums = Sums::START;
        self.window.give_up(kind.frame_len());
        self.expect(None);
        event
    }

    /// Notes what is at the front, and how many bytes have to be held to check it.
    #[inline]
    fn expect(&mut self, candidate: Option<Kind>) {
        self.candidate = candidate;
        self.wanted = candidate.map_or(SHORTEST, Kind::frame_len);
    }
}

/// Two readings of the running checksum, behind and ahead of the candidate.
///
/// Both only move forward. So the checksums of all candidates together cost a few instructions a
/// byte, whatever the number of headers in the noise.
#[derive(Clone, Copy, Debug)]
struct Sums {
    /// Before the oldest byte that is held.
    behind: Fletcher,
    /// After `length` more.
    ahead: Fletcher,
    length: usize,
}

impl Sums {
    const START: Self = Self {
        behind: Fletcher::START,
        ahead: Fletcher::START,
        length: 0,
    };

    /// Whether the checksum of `frame` holds, which begins at the front of the window.
    #[inline]
    fn hold(&mut self, kind: Kind, frame: &[u8]) -> bool {
        let Some((stretch, checksum)) = frame.split_last_chunk::<CHECKSUM_LEN>() else {
            return false;
        };
        let Some((sync, summed)) = stretch.split_first_chunk::<SYNC_LEN>() else {
            return false;
        };
        let sums = match kind {
            Kind::NavPvt => {
                let more = stretch.get(self.length..).unwrap_or_default();
                self.ahead = self.ahead.then_all(more);
                self.length = stretch.len();
                self.ahead.since(self.behind.then_all(sync), summed.len())
            }
            // The reading ahead may already be beyond their ends. They are short, so they are
            // summed again.
            Kind::TimTp | Kind::NavTimeLs | Kind::Ack | Kind::Nak => {
                let start = Fletcher::START;
                start.then_all(summed).since(start, summed.len())
            }
        };
        sums == *checksum
    }

    /// Goes past the first of `bytes`, and returns the rest.
    #[inline]
    fn pass<'a>(&mut self, bytes: &'a [u8]) -> &'a [u8] {
        let Some((first, rest)) = bytes.split_first() else {
            return bytes;
        };
        self.behind = self.behind.then((*first).into());
        self.length = self.length.saturating_sub(1);
        rest
    }
}

/// Whole µs, as far as 32 bits reach.
fn micros(cycles: u64) -> u32 {
    u32::try_from(Cycles(cycles).as_micros()).unwrap_or(u32::MAX)
}

/// Whether `bytes` begin with a dollar sign and five letters that are a talker and a sentence: the
/// sign alone is in any binary data.
#[cold]
#[inline(never)]
fn is_nmea(bytes: &[u8]) -> bool {
    matches!(bytes.first_chunk::<7>(), Some([b'$', b'G', letters @ .., b','])
        if letters.iter().all(u8::is_ascii_uppercase))
}

/// Adds to a counter.
#[inline]
fn count(counter: &mut u32, more: usize) {
    *counter = counter.wrapping_add(more as u32);
}

/// The rest of `bytes` from the first header of ours on, and its kind; or from the first bytes on
/// that may become one. The sums move along.
#[inline(never)]
fn search<'a>(bytes: &'a [u8], sums: &mut Sums, seen: &mut Seen) -> (&'a [u8], Option<Kind>) {
    let mut rest = bytes;
    let mut behind = sums.behind;
    let mut found = None;
    while let Some((first, after)) = rest.split_first() {
        match *first {
            SYNC_1 => match Header::at(rest) {
                Header::Unfinished => break,
                Header::Ours(kind) => {
                    found = Some(kind);
                    break;
                }
                Header::LoneSync => count(&mut seen.counters.lone_syncs, 1),
                Header::OtherMessage(message) => {
                    count(&mut seen.counters.other_messages, 1);
                    seen.other_message = message;
                }
                Header::FalseLength => count(&mut seen.counters.false_lengths, 1),
            },
            b'$' => {
                count(&mut seen.counters.nmea_starts, 1);
                seen.has_nmea |= is_nmea(rest);
            }
            _ => {}
        }
        behind = behind.then((*first).into());
        rest = after;
    }
    sums.behind = behind;
    let gone = bytes.len().wrapping_sub(rest.len());
    match sums.length.checked_sub(gone) {
        Some(length) => sums.length = length,
        None => (sums.ahead, sums.length) = (behind, 0),
    }
    (rest, found)
}
