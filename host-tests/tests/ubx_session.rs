//! The configuration session against simulated receivers: found at any rate,
//! configured, found again after a restart; bounded in all that it sends.

use timebase::{CORE_HZ, Cycles};
use ubx_link::{Action, BAUD, BAUDS, Event, Link, Session, SessionCounters, Setting};
use world::{Latency, Port, Receiver, ReceiverSettings, Recording, Talker, WorldNanos, ubx};

const NOON_NS: i64 = 1_795_348_800_000_000_000;
const SECOND: u64 = 1_000_000_000;

fn cycles(at: WorldNanos) -> Cycles {
    Cycles::from_nanos(at.0)
}

/// A board's side of the line, in world time.
struct Board {
    session: Session,
    link: Link,
    baud: u32,
    now: WorldNanos,
    /// What is leaving: until when, at which rate, which bytes.
    leaving: Option<(WorldNanos, u32, Vec<u8>)>,
    /// Each rate that was set, and when.
    tuned: Vec<(WorldNanos, u32)>,
    /// When each NAV-PVT came out.
    marks: Vec<WorldNanos>,
    sent_bytes: usize,
}

impl Board {
    fn new() -> Self {
        Self::at(BAUD)
    }

    fn at(baud: u32) -> Self {
        Self {
            session: Session::at(baud),
            link: Link::new(),
            baud,
            now: WorldNanos(0),
            leaving: None,
            tuned: Vec::new(),
            marks: Vec::new(),
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
    }

    /// Lives together with `talker` until `end`.
    fn run(&mut self, talker: &mut dyn Talker, end: WorldNanos) {
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
                    self.receive(&burst);
                }
            }
        }
    }

    fn receive(&mut self, burst: &world::Transmission) {
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
            let then = chunk.last().map_or(end, |byte| byte.stamp.extend(end));
            while let Some(event) = self.link.poll(then) {
                if let Event::NavPvt { .. } = event {
                    self.marks.push(burst.end());
                }
                self.session.handle_event(cycles(self.now), &event);
            }
        }
    }
}

fn factory(baud: u32) -> ReceiverSettings {
    ReceiverSettings {
        port: Port {
            baud,
            ..Port::FACTORY
        },
        latency: Latency::constant(70_000_000),
        ..ReceiverSettings::new(NOON_NS)
    }
}

#[test]
fn a_receiver_is_found_and_configured_at_any_rate() {
    found_and_configured(BAUD);
}

#[test]
fn a_receiver_is_found_and_configured_for_another_rate() {
    found_and_configured(38_400);
}

/// A receiver at any rate is brought to `ours`.
fn found_and_configured(ours: u32) {
    let configured = Port {
        baud: ours,
        ..Port::CONFIGURED
    };
    for baud in BAUDS {
        for seed in 0..20 {
            let mut receiver = Receiver::new(ReceiverSettings {
                seed,
                ..factory(baud)
            });
            let mut board = Board::at(ours);
            board.run(&mut receiver, WorldNanos(60 * SECOND));
            assert_eq!(receiver.port(), configured, "from {baud}");
            assert!(board.session.is_done());
            let counters = board.session.counters();
            assert_eq!((counters.rounds, counters.accepted), (1, 5), "from {baud}");
            assert_eq!(
                (counters.refused, counters.unanswered),
                (0, 0),
                "from {baud}"
            );
            // Five attempts of some 0.53 s at most, then the first epoch.
            assert!(board.marks[0] < WorldNanos(3 * SECOND + SECOND / 2));
            assert!(board.marks.len() > 5 * 56, "{}", board.marks.len());
            // Once frames arrive, no rate is tried.
            let first_mark = board.marks[0];
            assert!(board.tuned.iter().all(|(at, _)| *at < first_mark));
            assert_eq!(board.baud, ours);
        }
    }
}

#[test]
fn a_receiver_at_our_rate_never_sees_another() {
    let mut receiver = Receiver::new(ReceiverSettings {
        port: Port::CONFIGURED,
        ..factory(BAUD)
    });
    let mut board = Board::new();
    board.run(&mut receiver, WorldNanos(3_600 * SECOND));
    assert_eq!(board.tuned, []);
    assert_eq!(board.session.counters().attempts, 1);
    // CFG-PRT and the five settings, once: 28 + 14 + 11 + 44 + 40 + 11 bytes.
    assert_eq!(board.sent_bytes, 148);
}

#[test]
fn a_restarted_receiver_is_found_again() {
    let mut board = Board::new();
    let mut receiver = Receiver::new(factory(9_600));
    board.run(&mut receiver, WorldNanos(10 * SECOND));
    let before = board.marks.len();
    assert!(before > 0);

    // The same receiver as it comes out of its box, later.
    let mut restarted = Receiver::new(factory(9_600));
    board.run(&mut restarted, WorldNanos(30 * SECOND));
    assert_eq!(restarted.port(), Port::CONFIGURED);
    assert_eq!(board.session.counters().rounds, 2);
    // 3 s of silence, an attempt at our rate and one at 9600, the first epoch.
    let again = board.marks.iter().find(|at| **at > WorldNanos(10 * SECOND));
    assert!(
        again.is_some_and(|at| *at < WorldNanos(15 * SECOND)),
        "{again:?}"
    );
}

#[test]
fn forecasts_come_as_long_as_they_are_wanted() {
    let mut receiver = Receiver::new(factory(9_600));
    let mut board = Board::new();
    board.run(&mut receiver, WorldNanos(10 * SECOND));
    assert_eq!(receiver.port(), Port::CONFIGURED);
    let with_forecasts = Port {
        tim_tp_every: 1,
        ..Port::CONFIGURED
    };
    for (end_s, wanted, port) in [
        (20, true, with_forecasts),
        (30, false, Port::CONFIGURED),
        (40, true, with_forecasts),
    ] {
        board.session.handle_forecasts_wanted(wanted);
        board.run(&mut receiver, WorldNanos(end_s * SECOND));
        assert_eq!(receiver.port(), port);
    }
    assert!(board.session.is_done());
    let counters = board.session.counters();
    assert_eq!((counters.rounds, counters.accepted), (1, 8));

    // A receiver that restarts is configured again.
    let mut restarted = Receiver::new(factory(9_600));
    board.run(&mut restarted, WorldNanos(60 * SECOND));
    assert_eq!(restarted.port(), with_forecasts);
}

/// A line without a receiver.
struct NoReceiver;

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

#[test]
fn an_hour_without_a_receiver_is_rounds_with_silence_between() {
    let mut board = Board::new();
    board.run(&mut NoReceiver, WorldNanos(3_600 * SECOND));
    let counters = board.session.counters();
    // A round is five attempts of 0.50 s and their bytes, then 3 s.
    assert!(
        (630..=660).contains(&counters.rounds),
        "{}",
        counters.rounds
    );
    assert!(counters.attempts.abs_diff(counters.rounds * 5) < 5);
    assert_eq!(counters.unanswered, 0);
    // No rate is first in every round.
    let mut firsts: Vec<u32> = Vec::new();
    let mut last = WorldNanos(0);
    for (at, baud) in &board.tuned {
        if at.0 - last.0 >= 3 * SECOND && *baud != BAUD {
            firsts.push(*baud);
        }
        last = *at;
    }
    firsts.sort_unstable();
    firsts.dedup();
    assert_eq!(firsts, [9_600, 38_400, 57_600, 230_400]);
}

#[test]
fn a_receiver_that_sends_and_does_not_receive_is_left_at_its_rate() {
    let mut file = Vec::new();
    let mut sender = Receiver::new(ReceiverSettings {
        port: Port::CONFIGURED,
        ..factory(BAUD)
    });
    while let Some(at) = sender.next_event()
        && at < WorldNanos(60 * SECOND)
    {
        for burst in core::iter::from_fn(|| sender.poll(at)) {
            file.extend(burst.bytes);
        }
    }
    let mut deaf = Recording::new(&file).expect("NAV-PVT stands in it");
    let mut board = Board::new();
    board.run(&mut deaf, WorldNanos(50 * SECOND));
    assert_eq!(board.tuned, []);
    assert!(board.session.is_done());
    let expected = SessionCounters {
        rounds: 1,
        attempts: 1,
        unanswered: 5 * u32::from(Session::TRIES),
        ..SessionCounters::default()
    };
    assert_eq!(board.session.counters(), expected);
}

#[test]
fn a_refusal_is_counted_and_the_session_goes_on() {
    let mut session = Session::new();
    let mut now = Cycles::BOOT;
    let mut seen = Vec::new();
    while !session.is_done() {
        while let Some(action) = session.poll(now) {
            let Action::Transmit(bytes) = action else {
                panic!("no rate is tried: {action:?}")
            };
            seen.push((bytes[2], bytes[3]));
        }
        session.handle_sent(now);
        assert_eq!(session.poll(now), None);
        match seen.last() {
            Some(&(class, id)) if id != 0 => {
                // An answer to another setting is ignored.
                session.handle_event(now, &Event::Nak { class, id: 0x3e });
                assert_eq!(session.poll(now), None);
                session.handle_event(now, &Event::Nak { class, id });
            }
            _ => now = session.poll_timeout().expect("the receiver settles"),
        }
    }
    let order = [
        Setting::Port,
        Setting::Rate,
        Setting::Message,
        Setting::Navigation,
        Setting::Pulse,
        Setting::Forecasts { on: false },
    ];
    assert_eq!(seen, order.map(Setting::message));
    assert_eq!(session.counters().refused, 5);
    // What was refused is not asked for again, but for another wish.
    assert_eq!(session.poll(now), None);
    session.handle_forecasts_wanted(true);
    assert!(matches!(session.poll(now), Some(Action::Transmit(_))));
}

#[test]
fn nothing_is_asked_for_while_bytes_leave() {
    let mut session = Session::new();
    assert!(matches!(
        session.poll(Cycles::BOOT),
        Some(Action::Transmit(_))
    ));
    let much_later = Cycles(u64::from(CORE_HZ) * 3_600);
    assert_eq!(session.poll_timeout(), None);
    assert_eq!(session.poll(much_later), None);
    session.handle_sent(much_later);
    assert_eq!(session.poll(much_later), None);
    assert!(session.poll_timeout().is_some_and(|at| at > much_later));
}

#[test]
fn the_simulated_receiver_reads_the_same_frames() {
    // The frames that the session sends are frames to an independent reader.
    let mut session = Session::new();
    let Some(Action::Transmit(bytes)) = session.poll(Cycles::BOOT) else {
        panic!("CFG-PRT comes first")
    };
    let frames = ubx::find_frames(bytes, |_, _, _| true);
    assert_eq!(frames.len(), 1);
    assert_eq!((frames[0].class, frames[0].id), Setting::Port.message());
}
