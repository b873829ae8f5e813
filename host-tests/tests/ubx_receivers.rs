//! Receivers of each generation, as they come out of their boxes, against the configuration session:
//! found, configured, saved, found again, or refused in words.

mod ubx_board;

use timebase::Cycles;
use ubx_board::{Board, NoReceiver, SECOND, factory};
use ubx_link::{
    Action, BAUD, BAUDS, Event, Finding, Generation, PULSE_WIDTH_US, Session, Setting, Unusable,
};
use world::{
    Damage, LeftOn, Line, Model, Port, Receiver, ReceiverSettings, Swap, Talker, WorldNanos, ubx,
};

const USED: [Model; 6] = [
    Model::M8,
    Model::M9,
    Model::M10,
    Model::F9,
    Model::F10,
    Model::X20,
];

fn out_of_its_box(model: Model, port: Port) -> ReceiverSettings {
    ReceiverSettings {
        model,
        port,
        ..factory(port.baud)
    }
}

/// The ports that receivers have in their boxes, and on the modules of flight controllers.
fn ports() -> impl Iterator<Item = Port> {
    BAUDS.into_iter().flat_map(|baud| {
        let factory = Port {
            baud,
            ..Port::FACTORY
        };
        let preset = Port {
            nav_pvt_every: 1,
            nmea: false,
            protocols_in: 0x01,
            ..factory
        };
        let mute = Port {
            ubx: false,
            ..factory
        };
        [factory, preset, mute]
    })
}

fn names(finding: Finding) -> (String, u16) {
    match finding {
        Finding::Used(identity) | Finding::Unused(identity, _) => {
            let name = format!("{} {}", identity.model(), identity.firmware());
            (name, identity.protocol())
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn each_is_found_configured_and_saved_at_any_rate() {
    for model in USED {
        let mut slowest = WorldNanos(0);
        for port in ports() {
            let mut receiver = Receiver::new(out_of_its_box(model, port));
            let mut board = Board::new();
            board.run(&mut receiver, WorldNanos(30 * SECOND));
            assert_eq!(board.refusals, [], "{model:?} {port:?}");
            assert!(board.session.is_done());
            let now = receiver.port();
            let expected = Port {
                protocols_in: now.protocols_in,
                ..Port::CONFIGURED
            };
            assert_eq!(now, expected, "{model:?} {port:?}");
            assert_eq!(board.session.pulse_width_us(), Some(PULSE_WIDTH_US));
            let width_ns = u64::from(PULSE_WIDTH_US) * 1_000;
            let pulse = receiver.pulses().nth(20).unwrap();
            assert_eq!(pulse.end.0 - pulse.edge.0, width_ns, "{model:?}");
            // The next start is at our rate, with the protocols that the port had. An M8 whose port
            // does not say what it has is not saved.
            let is_unknown = model == Model::M8 && !port.ubx;
            let saved = Port {
                baud: if is_unknown { port.baud } else { BAUD },
                ..port
            };
            assert_eq!(receiver.saved_port(), saved, "{model:?} {port:?}");
            slowest = slowest.max(board.marks[0]);
        }
        println!(
            "{model:?}: the first mark after {} ms at most",
            slowest.0 / 1_000_000
        );
        assert!(slowest < WorldNanos(7 * SECOND), "{slowest:?}");
    }
}

#[test]
fn each_says_what_it_is() {
    for (model, name, protocol) in [
        (Model::M8, "u-blox 8 SPG 3.01", 18_00),
        (Model::M9, "NEO-M9N SPG 4.04", 32_01),
        (Model::M10, "u-blox 10 SPG 5.10", 34_10),
        (Model::F9, "ZED-F9P HPG 1.32", 27_31),
        (Model::F10, "NEO-F10N SPG 6.00", 40_00),
        (Model::X20, "ZED-X20P HPG 2.00", 50_00),
    ] {
        let mut receiver = Receiver::new(ReceiverSettings {
            model,
            ..factory(38_400)
        });
        let mut board = Board::new();
        board.run(&mut receiver, WorldNanos(20 * SECOND));
        assert_eq!(board.findings.len(), 1, "{model:?}");
        let (at, finding) = board.findings[0];
        assert!(matches!(finding, Finding::Used(_)));
        assert_eq!(names(finding), (name.to_owned(), protocol));
        assert!(at < WorldNanos(3 * SECOND), "{at:?}");
    }
}

#[test]
fn what_cannot_be_used_is_refused_in_words_and_left_as_it_is() {
    for (model, name, why, words) in [
        (
            Model::Ublox6,
            "u-blox 6 7.03 (45969)",
            Unusable::NoNavPvt,
            "it has no NAV-PVT",
        ),
        (
            Model::Ublox7,
            "u-blox 7 1.00 (59842)",
            Unusable::ShortNavPvt,
            "NAV-PVT of 84 bytes",
        ),
    ] {
        let mut receiver = Receiver::new(ReceiverSettings {
            model,
            ..factory(9_600)
        });
        let mut board = Board::new();
        board.run(&mut receiver, WorldNanos(60 * SECOND));
        // Once, although it is looked at again and again.
        assert_eq!(board.findings.len(), 1, "{:?}", board.findings);
        let finding = board.findings[0].1;
        assert!(matches!(finding, Finding::Unused(_, reason) if reason == why));
        assert_eq!(names(finding).0, name);
        assert_eq!(why.reason(), words);
        assert!(board.marks.is_empty());
        assert_eq!(receiver.saved_port(), Port::FACTORY);
        assert_eq!(board.session.pulse_width_us(), None);
        assert!(!board.session.is_done());
        // And its successor is used.
        let end = board.now.plus(20 * SECOND);
        board.run(
            &mut Receiver::new(ReceiverSettings {
                power_on: board.now,
                ..out_of_its_box(Model::M10, Port::FACTORY)
            }),
            end,
        );
        assert!(board.session.is_done());
        assert_eq!(board.findings.len(), 2);
    }
}

/// From the moment at which a receiver may speak to the first mark after it.
fn found_after_ms(board: &Board, from: WorldNanos) -> u64 {
    let mark = board.marks.iter().find(|at| **at > from);
    (mark.expect("it is found").0 - from.0) / 1_000_000
}

#[test]
fn one_that_restarts_speaks_at_once_for_its_rate_is_saved() {
    for model in USED {
        for seed in 0..10 {
            let restart = WorldNanos(20 * SECOND + seed * 77_000_000);
            let mut receiver = Receiver::new(ReceiverSettings {
                seed,
                restarts: vec![restart],
                ..out_of_its_box(
                    model,
                    Port {
                        baud: 38_400,
                        ..Port::FACTORY
                    },
                )
            });
            let mut board = Board::new();
            board.run(&mut receiver, WorldNanos(60 * SECOND));
            // It is silent for a second, so that 3 s of silence end 2 s later at our own rate.
            let speaks = restart.plus(SECOND);
            let ms = found_after_ms(&board, speaks);
            assert!(ms < 3_600, "{model:?} {ms}");
            assert!(board.session.is_done());
            assert_eq!(board.session.pulse_width_us(), Some(PULSE_WIDTH_US));
            assert_eq!(board.findings.len(), 1, "{:?}", board.findings);
        }
    }
}

#[test]
fn one_that_falls_back_or_is_swapped_is_found_within_ten_seconds() {
    let mut slowest = 0;
    for (nth, second) in USED.into_iter().enumerate() {
        for (seed, port) in (0..).zip(ports()) {
            let first = USED[(nth + seed as usize) % USED.len()];
            // The gap between them ends at any phase of a round.
            let unplugged = WorldNanos(20 * SECOND);
            let plugged = unplugged.plus(SECOND * 2 / 10 + seed * 777_000_000);
            let mut line = Swap::new(
                Receiver::new(out_of_its_box(first, Port::FACTORY)),
                unplugged,
                Receiver::new(ReceiverSettings {
                    seed,
                    power_on: plugged,
                    ..out_of_its_box(second, port)
                }),
            );
            let mut board = Board::new();
            board.run(&mut line, WorldNanos(80 * SECOND));
            let ms = found_after_ms(&board, plugged);
            slowest = slowest.max(ms);
            assert!(ms < 10_000, "{first:?} to {second:?} {port:?}: {ms} ms");
            assert!(board.session.is_done());
            assert_eq!(board.session.pulse_width_us(), Some(PULSE_WIDTH_US));
            let (_, finding) = *board.findings.last().unwrap();
            assert!(matches!(finding, Finding::Used(_)));
        }
    }
    println!("found again after {slowest} ms at most");
}

#[test]
fn the_rate_is_saved_once() {
    // One whose memory does not keep it: it is found at its old rate each time.
    let mut board = Board::new();
    let mut saves = 0;
    for start in 0..3 {
        let port = Port {
            baud: 38_400,
            ..Port::FACTORY
        };
        let mut receiver = Receiver::new(ReceiverSettings {
            power_on: WorldNanos(start * 30 * SECOND),
            ..out_of_its_box(Model::F9, port)
        });
        board.run(&mut receiver, WorldNanos((start + 1) * 30 * SECOND));
        assert!(board.session.is_done());
        saves += u32::from(receiver.saved_port().baud == BAUD);
    }
    assert_eq!(saves, 1);
}

#[test]
fn refused_keys_are_named_and_not_asked_again() {
    const LENGTH_LOCKED: u32 = 0x4005_0005;
    const DYNAMIC_MODEL: u32 = 0x2011_0021;
    let mut receiver = Receiver::new(ReceiverSettings {
        refuses_keys: vec![LENGTH_LOCKED, DYNAMIC_MODEL],
        ..out_of_its_box(Model::M10, Port::FACTORY)
    });
    let mut board = Board::new();
    board.run(&mut receiver, WorldNanos(30 * SECOND));
    assert_eq!(board.refusals, [Setting::Pulse, Setting::Navigation]);
    // Without the acknowledgement no width is ours.
    assert_eq!(board.session.pulse_width_us(), None);
    assert!(board.session.is_done() && board.marks.len() > 100);
    let sent = board.sent_bytes;
    board.run(&mut receiver, WorldNanos(300 * SECOND));
    assert_eq!(board.sent_bytes, sent);
}

#[test]
fn one_that_refuses_everything_is_named_and_its_marks_are_used() {
    let port = Port {
        nav_pvt_every: 1,
        baud: BAUD,
        ..Port::FACTORY
    };
    let mut receiver = Receiver::new(ReceiverSettings {
        refuses: vec![(0x06, 0x8a)],
        ..out_of_its_box(Model::F10, port)
    });
    let mut board = Board::new();
    board.run(&mut receiver, WorldNanos(60 * SECOND));
    assert_eq!(board.session.pulse_width_us(), None);
    assert!(board.refusals.contains(&Setting::Pulse));
    assert!(board.refusals.contains(&Setting::Message));
    assert!(board.marks.len() > 50);
}

#[test]
fn raw_data_of_a_receiver_with_keys_is_switched_off() {
    let port = Port {
        baud: BAUD,
        nav_pvt_every: 1,
        ..Port::FACTORY
    };
    let mut receiver = Receiver::new(ReceiverSettings {
        left_on: vec![LeftOn::RAWX],
        queue_ns: 2_500_000_000,
        ..out_of_its_box(Model::F9, port)
    });
    let mut board = Board::new();
    board.run(&mut receiver, WorldNanos(60 * SECOND));
    assert_eq!(receiver.left_on().count(), 0);
    assert_eq!(board.refusals, []);
    assert_eq!(board.session.pulse_width_us(), Some(PULSE_WIDTH_US));
}

#[test]
fn a_message_without_a_key_is_named() {
    let message = (0x0f, 0x01);
    let mut receiver = Receiver::new(ReceiverSettings {
        left_on: vec![LeftOn {
            message,
            payload_len: 40,
            every: 1,
        }],
        ..out_of_its_box(Model::X20, Port::FACTORY)
    });
    let mut board = Board::new();
    board.run(&mut receiver, WorldNanos(60 * SECOND));
    let (class, id) = message;
    assert_eq!(board.refusals, [Setting::Off { class, id }]);
}

#[test]
fn nobody_there_is_reported_and_so_is_one_that_does_not_receive() {
    let mut board = Board::new();
    board.run(&mut NoReceiver, WorldNanos(60 * SECOND));
    let found: Vec<_> = board.findings.iter().map(|(_, finding)| *finding).collect();
    assert_eq!(found, [Finding::Silent]);
    assert!(board.findings[0].0 < WorldNanos(5 * SECOND));
    // Without its pin for what it receives, NMEA comes, and nothing is answered.
    let mut board = Board::new();
    let mut deaf = Receiver::new(ReceiverSettings {
        is_deaf: true,
        ..factory(9_600)
    });
    board.run(&mut deaf, WorldNanos(60 * SECOND));
    assert_eq!(board.session.finding(), Finding::Silent);
    // With NAV-PVT at our rate it is used, and has no name.
    let mut board = Board::new();
    let mut deaf = Receiver::new(ReceiverSettings {
        is_deaf: true,
        port: Port::CONFIGURED,
        ..factory(BAUD)
    });
    board.run(&mut deaf, WorldNanos(60 * SECOND));
    assert_eq!(board.session.finding(), Finding::Unnamed);
    assert!(board.marks.len() > 280);
    assert_eq!(board.session.pulse_width_us(), None);
}

#[test]
fn garbage_delays_and_stops_nothing() {
    for model in USED {
        for seed in 0..5 {
            let damage = Damage {
                seed,
                drop: 0.002,
                flip: 0.002,
                insert: 0.002,
                silence: None,
            };
            let receiver = Receiver::new(out_of_its_box(model, Port::FACTORY));
            let mut line = Line::new(receiver, damage);
            let mut board = Board::new();
            board.run(&mut line, WorldNanos(60 * SECOND));
            let expected = Port {
                protocols_in: line.talker().port().protocols_in,
                ..Port::CONFIGURED
            };
            assert_eq!(line.talker().port(), expected, "{model:?} {seed}");
            assert!(board.marks[0] < WorldNanos(10 * SECOND), "{model:?} {seed}");
            assert_eq!(board.session.pulse_width_us(), Some(PULSE_WIDTH_US));
        }
    }
}

/// A session for a receiver with keys, up to the pulse's setting.
fn before_the_pulse() -> Session {
    let mut session = Session::new();
    let version = {
        let mut receiver = Receiver::new(out_of_its_box(Model::M10, Port::CONFIGURED));
        let poll = ubx::frame(0x0a, 0x04, &[]);
        receiver.handle_bytes(WorldNanos(0), BAUD, &poll);
        let at = receiver.next_event().expect("it answers");
        receiver.poll(at).expect("it answers").bytes
    };
    session.handle_event(Cycles::BOOT, &Event::Ack { class: 0, id: 0 });
    let is_poll = |action| matches!(action, Some(Action::Transmit(bytes)) if bytes[2] == 0x0a);
    assert!(is_poll(session.poll(Cycles::BOOT)));
    session.handle_sent(Cycles::BOOT);
    let bytes: Vec<_> = version
        .iter()
        .map(|&byte| timebase::StampedByte {
            stamp: Cycles::BOOT.stamp(),
            byte,
        })
        .collect();
    assert!(session.wants_bytes());
    session.handle_bytes(Cycles::BOOT, &bytes);
    assert!(!session.wants_bytes());
    session
}

#[test]
fn a_late_acknowledgement_by_keys_is_nobodys() {
    const ACK: Event = Event::Ack {
        class: 0x06,
        id: 0x8a,
    };
    let (class, id) = Setting::Pulse.message(Generation::Keys);
    assert_eq!(ACK, Event::Ack { class, id });
    // In its time it is the pulse's.
    let mut session = before_the_pulse();
    assert!(session.poll(Cycles::BOOT).is_some());
    session.handle_sent(Cycles::BOOT);
    session.handle_event(Cycles::BOOT, &ACK);
    assert_eq!(session.pulse_width_us(), Some(PULSE_WIDTH_US));
    // Behind it, it may be any other's; and all is asked again.
    let mut session = before_the_pulse();
    let mut now = Cycles::BOOT;
    let mut polls = 0;
    for _ in 0..400 {
        while let Some(action) = session.poll(now) {
            let Action::Transmit(bytes) = action else {
                panic!("no rate is tried: {action:?}")
            };
            let is_pulse = bytes.len() > 80;
            polls += u32::from(bytes[2] == 0x0a);
            session.handle_sent(now);
            if !is_pulse && bytes_are_keys(polls) {
                session.handle_event(now, &ACK);
            }
        }
        session.handle_event(now, &Event::Ack { class: 0, id: 0 });
        now = now.plus(Cycles::from_micros(100_000).0);
    }
    assert_eq!(session.pulse_width_us(), None);
    assert!(polls > 3, "{polls}");
}

/// Whether what is sent is by keys: as long as MON-VER is not polled.
const fn bytes_are_keys(polls: u32) -> bool {
    polls == 0
}
