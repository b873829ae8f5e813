//! What the tests of the receiver's configuration share: a board's side of the line, in world time.
#![allow(dead_code, reason = "each test file uses its own part of it")]

use timebase::Cycles;
use ubx_link::{Action, BAUD, Event, Finding, Link, Session, Setting};
use world::{Latency, Port, ReceiverSettings, Talker, WorldNanos};

/// Noon, UTC since 1970.
pub const NOON_NS: i64 = 1_795_348_800_000_000_000;
pub const SECOND: u64 = 1_000_000_000;

pub fn cycles(at: WorldNanos) -> Cycles {
    Cycles::from_nanos(at.0)
}

/// A board's side of the line, in world time.
pub struct Board {
    pub session: Session,
    pub link: Link,
    pub baud: u32,
    pub now: WorldNanos,
    /// What is leaving: until when, at which rate, which bytes.
    pub leaving: Option<(WorldNanos, u32, Vec<u8>)>,
    /// Each rate that was set, and when.
    pub tuned: Vec<(WorldNanos, u32)>,
    /// When each NAV-PVT came out.
    pub marks: Vec<WorldNanos>,
    /// How long each may have waited, in µs, as far as is proved, and how long it has.
    pub waits_us: Vec<(u32, u64)>,
    /// When each NAV-TIMELS came out, and its count.
    pub leap_seconds: Vec<(WorldNanos, Option<i8>)>,
    pub refusals: Vec<Setting>,
    /// What was new about the receiver, and when.
    pub findings: Vec<(WorldNanos, Finding)>,
    pub sent_bytes: usize,
}

impl Board {
    pub fn new() -> Self {
        Self::at(BAUD)
    }

    pub fn at(baud: u32) -> Self {
        Self {
            session: Session::at(baud),
            link: Link::at(baud),
            baud,
            now: WorldNanos(0),
            leaving: None,
            tuned: Vec::new(),
            marks: Vec::new(),
            waits_us: Vec::new(),
            leap_seconds: Vec::new(),
            refusals: Vec::new(),
            findings: Vec::new(),
            sent_bytes: 0,
        }
    }

    /// Does what the session asks for.
    fn act(&mut self) {
        while let Some(action) = self.session.poll(cycles(self.now)) {
            match action {
                Action::SetBaud(baud) => {
                    assert!(self.leaving.is_none(), "a rate is set while bytes leave");
                    self.baud = baud;
                    self.link.handle_baud(baud);
                    self.tuned.push((self.now, baud));
                }
                Action::Transmit(bytes) => {
                    assert!(self.leaving.is_none(), "bytes are sent while others leave");
                    let line_ns = bytes.len() as u64 * 10 * SECOND / u64::from(self.baud);
                    self.sent_bytes += bytes.len();
                    let end = self.now.plus(line_ns);
                    self.leaving = Some((end, self.baud, bytes.to_vec()));
                }
            }
        }
        self.refusals
            .extend(core::iter::from_fn(|| self.session.poll_refusal()));
        let finding = self.session.poll_finding();
        self.findings
            .extend(finding.map(|finding| (self.now, finding)));
    }

    /// Lives together with `talker` until `end`.
    pub fn run(&mut self, talker: &mut dyn Talker, end: WorldNanos) {
        loop {
            self.act();
            let leaves = self.leaving.as_ref().map(|(at, ..)| *at);
            let wakes = self.session.poll_timeout().map(|at| {
                // The first ns that is not before that cycle.
                WorldNanos(at.as_nanos() + 1)
            });
            let speaks = talker.next_event();
            let next = [leaves, wakes, speaks].into_iter().flatten().min();
            let Some(next) = next.filter(|next| *next < end) else {
                self.now = self.now.max(end);
                return;
            };
            self.now = self.now.max(next);
            if leaves.is_some_and(|at| at <= self.now)
                && let Some((at, baud, bytes)) = self.leaving.take()
            {
                talker.handle_bytes(at, baud, &bytes);
                self.session.handle_sent(cycles(self.now));
            }
            while let Some(burst) = talker.poll(self.now) {
                if burst.baud == self.baud {
                    self.receive(&burst, talker);
                }
            }
        }
    }

    fn receive(&mut self, burst: &world::Transmission, talker: &dyn Talker) {
        // The burst is over before anything else happens: nothing here depends on
        // the order within it.
        let end = cycles(burst.end());
        let stamped: Vec<_> = (0..)
            .zip(&burst.bytes)
            .map(|(index, &byte)| timebase::StampedByte {
                stamp: cycles(burst.byte_end(index)).stamp(),
                byte,
            })
            .collect();
        for chunk in stamped.chunks(Link::ROOM) {
            self.link.push(chunk);
            self.session.handle_bytes(cycles(self.now), chunk);
            let then = chunk.last().map_or(end, |byte| byte.stamp.extend(end));
            while let Some(mut event) = self.link.poll(then) {
                self.session.handle_event(cycles(self.now), &event);
                self.session.limit_wait(&mut event);
                match event {
                    Event::NavPvt { mark, .. } => {
                        self.marks.push(burst.end());
                        if let Some(sent) = talker.truth().last() {
                            let late_ns = NOON_NS + sent.first_byte.0.cast_signed();
                            let waited_ns = (late_ns - sent.epoch_utc_ns).unsigned_abs();
                            let waited_us = waited_ns.saturating_sub(LATENCY_NS) / 1_000;
                            self.waits_us.push((mark.busy_us, waited_us));
                        }
                    }
                    Event::LeapSeconds(received) => {
                        self.leap_seconds.push((burst.end(), received.count));
                    }
                    _ => {}
                }
            }
            if let Some(what) = self.link.poll_unwanted() {
                self.session.handle_unwanted(cycles(self.now), what);
            }
        }
    }
}

/// Of every receiver here.
pub const LATENCY_NS: u64 = 70_000_000;

pub fn factory(baud: u32) -> ReceiverSettings {
    ReceiverSettings {
        port: Port {
            baud,
            ..Port::FACTORY
        },
        latency: Latency::constant(LATENCY_NS),
        crystal_ppb: 0,
        ..ReceiverSettings::new(NOON_NS)
    }
}

/// A line without a receiver.
pub struct NoReceiver;

impl Talker for NoReceiver {
    fn next_event(&self) -> Option<WorldNanos> {
        None
    }

    fn poll(&mut self, _: WorldNanos) -> Option<world::Transmission> {
        None
    }

    fn handle_bytes(&mut self, _: WorldNanos, _: u32, _: &[u8]) {}

    fn truth(&self) -> &[world::Sent] {
        &[]
    }
}
