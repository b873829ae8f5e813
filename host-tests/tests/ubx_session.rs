//! The configuration session against simulated receivers: found at any rate,
//! configured, found again after a restart; bounded in all that it sends.

mod ubx_board;

use timebase::{CORE_HZ, Cycles};
use ubx_board::{Board, NoReceiver, SECOND, factory};
use ubx_link::{
    Action, BAUD, BAUDS, Event, Generation, PULSE_WIDTH_US, Session, SessionCounters, Setting,
    Unwanted,
};
use world::{
    LeapKnowledge, LeftOn, Port, Receiver, ReceiverSettings, Recording, Talker, WorldNanos, ubx,
};

/// Messages that are switched off before they come.
const IN_ADVANCE: u32 = 19;

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
            // At another rate it is saved, too.
            let accepted = if baud == ours { 6 } else { 7 };
            assert_eq!(
                (counters.rounds, counters.accepted),
                (1, accepted + IN_ADVANCE),
                "from {baud}"
            );
            let saved = Port {
                baud: ours,
                ..Port::FACTORY
            };
            assert_eq!(receiver.saved_port(), saved, "from {baud}");
            assert_eq!(
                (counters.refused, counters.unanswered),
                (0, 0),
                "from {baud}"
            );
            // Six attempts of some 0.7 s at most, then the first epoch.
            assert!(board.marks[0] < WorldNanos(5 * SECOND));
            assert!(board.marks.len() > 5 * 54, "{}", board.marks.len());
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
    // Two polls and the six settings, once: 9 + 8 + 28 + 40 + 14 + 11 + 44 + 11 bytes.
    // And what is switched off in advance: the notices, and the others with 11 bytes each.
    let in_advance = 18 + 11 * (IN_ADVANCE as usize - 1);
    assert_eq!(board.sent_bytes, 165 + in_advance);
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
    // 3 s of silence, three attempts, the first epoch.
    let again = board.marks.iter().find(|at| **at > WorldNanos(10 * SECOND));
    assert!(
        again.is_some_and(|at| *at < WorldNanos(16 * SECOND)),
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
    assert_eq!((counters.rounds, counters.accepted), (1, 10 + IN_ADVANCE));

    // A receiver that restarts is configured again.
    let mut restarted = Receiver::new(factory(9_600));
    board.run(&mut restarted, WorldNanos(60 * SECOND));
    assert_eq!(restarted.port(), with_forecasts);
}

#[test]
fn an_hour_without_a_receiver_is_rounds_with_silence_between() {
    let mut board = Board::new();
    board.run(&mut NoReceiver, WorldNanos(3_600 * SECOND));
    let counters = board.session.counters();
    // A round is six attempts of 0.60 s and their bytes, then 1 s.
    assert!(
        (740..=780).contains(&counters.rounds),
        "{}",
        counters.rounds
    );
    assert!(counters.attempts.abs_diff(counters.rounds * 6) < 6);
    assert_eq!(counters.unanswered, 0);
    // No rate is first in every round.
    let mut firsts: Vec<u32> = Vec::new();
    let mut last = WorldNanos(0);
    for (at, baud) in &board.tuned {
        if at.0 - last.0 >= SECOND * 14 / 10 && *baud != BAUD {
            firsts.push(*baud);
        }
        last = *at;
    }
    firsts.sort_unstable();
    firsts.dedup();
    assert_eq!(firsts, [9_600, 38_400, 57_600, 230_400, 460_800]);
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
        unanswered: 7 * u32::from(Session::TRIES) + IN_ADVANCE,
        ..SessionCounters::default()
    };
    assert_eq!(board.session.counters(), expected);
}

#[test]
fn a_refusal_is_counted_and_the_session_goes_on() {
    let mut session = Session::new();
    let mut now = Cycles::BOOT;
    let mut seen = Vec::new();
    let mut reported = Vec::new();
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
            // What it is it does not say.
            Some((0x0a, _)) => now = session.poll_timeout().expect("an answer is waited for"),
            Some(&(class, id)) => {
                // An answer to another setting is ignored.
                if seen.len() > 1 {
                    session.handle_event(now, &Event::Nak { class, id: 0x3e });
                    assert_eq!(session.poll(now), None);
                }
                session.handle_event(now, &Event::Nak { class, id });
                reported.extend(session.poll_refusal());
            }
            None => panic!("nothing is sent"),
        }
    }
    let refused = [
        Setting::Port,
        Setting::Pulse,
        Setting::Rate,
        Setting::Message,
        Setting::Navigation,
        Setting::Forecasts { on: false },
    ];
    // The port is polled; then each is asked for three times, and it is named.
    let thrice = refused.iter().flat_map(|setting| [*setting; 3]);
    let polls = [Setting::Port].into_iter().chain([Setting::Version; 3]);
    let messages = polls
        .chain(thrice)
        .map(|setting| setting.message(Generation::Messages));
    // What is switched off in advance is asked for once, and is not named: the receiver may not know it.
    let in_advance = [(0x06, 0x02)].into_iter();
    let in_advance = in_advance.chain((1..IN_ADVANCE).map(|_| (0x06, 0x01)));
    assert_eq!(seen, messages.chain(in_advance).collect::<Vec<_>>());
    assert_eq!(reported, refused);
    assert_eq!(session.counters().refused, 18 + IN_ADVANCE);
    assert_eq!(session.pulse_width_us(), None);
    // What was refused is not asked for again, but for another wish.
    assert_eq!(session.poll(now), None);
    session.handle_forecasts_wanted(true);
    assert!(matches!(session.poll(now), Some(Action::Transmit(_))));
}

/// A receiver at our rate with RXM-RAWX in its flash: at our 5 Hz its line is full.
fn with_raw_data() -> ReceiverSettings {
    ReceiverSettings {
        port: Port {
            nmea: true,
            ..Port::CONFIGURED
        },
        left_on: vec![
            LeftOn::RAWX,
            LeftOn {
                message: (0x01, 0x35),
                payload_len: 200,
                every: 1,
            },
            LeftOn {
                message: (0x0a, 0x09),
                payload_len: 60,
                every: 5,
            },
            // TIM-VRFY, which nobody expects.
            LeftOn {
                message: (0x0d, 0x06),
                payload_len: 20,
                every: 5,
            },
        ],
        queue_ns: 2_500_000_000,
        ..factory(BAUD)
    }
}

#[test]
fn what_a_receiver_has_in_its_flash_is_switched_off_as_it_comes() {
    let mut receiver = Receiver::new(with_raw_data());
    // Its line is full before it is asked for anything.
    let mut before = Board::new();
    while before.now < WorldNanos(20 * SECOND) {
        let Some(at) = receiver.next_event() else {
            break;
        };
        before.now = at;
        receiver.poll(at);
    }
    assert_eq!(receiver.left_on().count(), 4);
    let mut board = Board::new();
    board.now = before.now;
    board.run(&mut receiver, WorldNanos(40 * SECOND));
    assert_eq!(receiver.left_on().count(), 0);
    assert_eq!(receiver.port(), Port::CONFIGURED);
    assert_eq!(board.refusals, []);
    // From then on each solution comes at once.
    let busy: Vec<_> = board.waits_us.iter().rev().take(50).collect();
    assert!(busy.iter().all(|wait| **wait == (0, 0)), "{busy:?}");
    let sent = board.sent_bytes;
    board.run(&mut receiver, WorldNanos(600 * SECOND));
    assert_eq!(board.sent_bytes, sent, "nothing more is asked for");
}

#[test]
fn what_a_receiver_may_have_in_its_flash_is_switched_off_before_it_comes() {
    // Each comes after 50 s for the first time.
    let seldom = |message| LeftOn {
        message,
        payload_len: 40,
        every: 250,
    };
    let settings = ReceiverSettings {
        port: Port::CONFIGURED,
        left_on: [
            (0x02, 0x15),
            (0x01, 0x35),
            (0x01, 0x26),
            (0x0a, 0x09),
            (0x0d, 0x03),
        ]
        .map(seldom)
        .to_vec(),
        refuses: vec![(0x02, 0x13)],
        ..factory(BAUD)
    };
    let mut receiver = Receiver::new(settings);
    let mut board = Board::new();
    // Marks come from the first epoch on, and all is said a second later.
    board.run(&mut receiver, WorldNanos(SECOND + SECOND / 2));
    assert!(board.marks[0] < WorldNanos(SECOND / 2), "{:?}", board.marks);
    assert!(board.session.is_done());
    assert_eq!(receiver.left_on().count(), 0);
    // A message that never comes may be one that the receiver does not know: its refusal is nobody's worry.
    board.run(&mut receiver, WorldNanos(30 * SECOND));
    assert_eq!(board.refusals, []);
    assert_eq!(board.session.counters().refused, 1);
}

#[test]
fn what_was_refused_in_advance_is_asked_for_three_times_in_all() {
    let rawx = Unwanted::Ubx {
        class: 0x02,
        id: 0x15,
    };
    let mut session = Session::new();
    let (mut asked, mut named) = (0, Vec::new());
    for second in 0..120 {
        let now = Cycles::from_micros(second * 1_000_000);
        session.handle_event(now, &Event::Ack { class: 0, id: 0 });
        if second >= 20 {
            session.handle_unwanted(now, rawx);
        }
        while let Some(action) = session.poll(now) {
            let Action::Transmit(bytes) = action else {
                panic!("no rate is tried: {action:?}")
            };
            let (class, id) = (bytes[2], bytes[3]);
            let is_rawx = bytes.get(6..9) == Some(&[0x02, 0x15, 0]);
            asked += u32::from(is_rawx);
            session.handle_sent(now);
            session.handle_event(
                now,
                &if is_rawx {
                    Event::Nak { class, id }
                } else {
                    Event::Ack { class, id }
                },
            );
            named.extend(session.poll_refusal().map(Setting::subject));
        }
        assert_eq!(asked, if second < 21 { 1 } else { 3 }, "at {second} s");
    }
    assert_eq!(named, [(0x02, 0x15)]);
}

#[test]
fn what_is_not_switched_off_is_named_and_left_alone() {
    let rawx = Setting::Off {
        class: 0x02,
        id: 0x15,
    };
    let refusing = ReceiverSettings {
        refuses: vec![(0x02, 0x15), (0x06, 0x31)],
        ..with_raw_data()
    };
    let mut board = Board::new();
    let mut receiver = Receiver::new(refusing);
    board.run(&mut receiver, WorldNanos(60 * SECOND));
    assert_eq!(receiver.left_on().count(), 1);
    board.refusals.sort_by_key(|setting| setting.subject());
    assert_eq!(board.refusals, [rawx, Setting::Pulse]);
    assert_eq!(
        (rawx.name(), Setting::Pulse.name()),
        ("RXM-RAWX off", "CFG-TP5")
    );
    assert_eq!(board.session.pulse_width_us(), None);
    let sent = board.sent_bytes;
    board.run(&mut receiver, WorldNanos(600 * SECOND));
    assert_eq!(board.sent_bytes, sent, "it is not asked again");
}

/// A receiver that acknowledges everything and goes on with what it likes.
#[test]
fn what_goes_on_although_it_was_switched_off_is_named_once() {
    let mut session = Session::new();
    let what = Unwanted::Ubx {
        class: 0x0a,
        id: 0x09,
    };
    let off = Setting::Off {
        class: 0x0a,
        id: 0x09,
    };
    let mut asked = Vec::new();
    let mut named = Vec::new();
    for tenth in 0..1_200_u64 {
        let now = Cycles::from_micros(tenth * 100_000);
        session.handle_unwanted(now, what);
        session.handle_event(now, &Event::Ack { class: 0, id: 0 });
        while let Some(action) = session.poll(now) {
            let Action::Transmit(bytes) = action else {
                panic!("no rate is tried: {action:?}")
            };
            let (class, id) = (bytes[2], bytes[3]);
            if bytes.get(6..9) == Some(&[0x0a, 0x09, 0]) {
                asked.push(tenth / 10);
            }
            session.handle_sent(now);
            session.handle_event(now, &Event::Ack { class, id });
        }
        named.extend(session.poll_refusal());
    }
    assert_eq!(asked.len(), 3, "{asked:?}");
    assert!(asked.windows(2).all(|pair| pair[1] - pair[0] >= 10));
    assert_eq!(named, [off]);
}

#[test]
fn noise_makes_no_more_requests_than_its_names() {
    // Each kind comes twice, and refused.
    let mut session = Session::new();
    let mut requests = 0;
    for ms in 0..60_000_u64 {
        let now = Cycles::from_micros(ms * 1_000);
        let kind = (ms / 2).to_le_bytes();
        let what = Unwanted::Ubx {
            class: 0x0a | kind[1] << 4,
            id: kind[0],
        };
        session.handle_unwanted(now, what);
        session.handle_event(now, &Event::Ack { class: 0, id: 0 });
        while let Some(Action::Transmit(bytes)) = session.poll(now) {
            let is_request = bytes[2..4] == [6, 1] && ![0x01, 0x0d].contains(&bytes[6]);
            requests += u32::from(is_request);
            let (class, id) = (bytes[2], bytes[3]);
            session.handle_sent(now);
            session.handle_event(now, &Event::Nak { class, id });
        }
    }
    // Eight kinds, thrice each; and five of those classes in advance.
    assert!((6..=8 * 3 + 5).contains(&requests), "{requests}");
}

#[test]
fn no_width_is_the_receivers_before_it_has_said_so() {
    let settings = factory(9_600);
    let mut receiver = Receiver::new(settings.clone());
    let widths = |receiver: &Receiver, from_s: usize| -> Vec<u64> {
        let pulses = receiver.pulses().skip(from_s).take(5);
        pulses.map(|pulse| pulse.end.0 - pulse.edge.0).collect()
    };
    assert_eq!(widths(&receiver, 0), [100_000_000; 5]);
    let mut board = Board::new();
    assert_eq!(board.session.pulse_width_us(), None);
    board.run(&mut receiver, WorldNanos(10 * SECOND));
    assert_eq!(board.session.pulse_width_us(), Some(PULSE_WIDTH_US));
    assert_eq!(
        widths(&receiver, 10),
        [u64::from(PULSE_WIDTH_US) * 1_000; 5]
    );
    // A receiver that falls silent may be another one when it comes back.
    let mut restarted = Receiver::new(settings);
    while board.session.counters().rounds < 2 {
        let end = board.now.plus(SECOND / 10);
        board.run(&mut NoReceiver, end);
    }
    assert_eq!(board.session.pulse_width_us(), None);
    board.run(&mut restarted, WorldNanos(30 * SECOND));
    assert_eq!(board.session.pulse_width_us(), Some(PULSE_WIDTH_US));
}

#[test]
fn a_late_acknowledgement_of_the_pulse_is_one() {
    let mut session = Session::new();
    let mut now = Cycles::BOOT;
    session.handle_event(now, &Event::Ack { class: 0, id: 0 });
    for _ in 0..200 {
        while session.poll(now).is_some() {
            session.handle_sent(now);
        }
        session.handle_event(now, &Event::Ack { class: 0, id: 0 });
        now = now.plus(u64::from(CORE_HZ) / 10);
    }
    assert!(session.is_done());
    assert_eq!(session.pulse_width_us(), None);
    let (class, id) = Setting::Pulse.message(Generation::Messages);
    session.handle_event(now, &Event::Ack { class, id });
    assert_eq!(session.pulse_width_us(), Some(PULSE_WIDTH_US));
}

#[test]
fn leap_seconds_come_when_they_are_wanted_and_say_when_they_are_known() {
    let mut receiver = Receiver::new(ReceiverSettings {
        leap: LeapKnowledge {
            built_with: 16,
            resolved_ns: 25 * SECOND,
            ..LeapKnowledge::RESOLVED
        },
        ..factory(9_600)
    });
    let mut board = Board::new();
    board.run(&mut receiver, WorldNanos(5 * SECOND));
    assert_eq!(board.leap_seconds, []);
    for second in 0..6_u64 {
        board.session.handle_leap_seconds_wanted();
        board.run(&mut receiver, WorldNanos((15 + 10 * second) * SECOND));
    }
    let counts: Vec<_> = board.leap_seconds.iter().map(|(_, count)| *count).collect();
    let known = Some(18);
    assert_eq!(counts, [None, None, known, known, known, known]);
}

#[test]
fn an_answer_bounds_what_waits_behind_it_on_a_line_that_is_full() {
    // Raw data that is not switched off, and a queue that is full most of the time.
    for (queue_ns, most_us) in [(300_000_000, 500_000), (2_500_000_000, 2_900_000)] {
        let mut receiver = Receiver::new(ReceiverSettings {
            refuses: vec![(0x02, 0x15)],
            queue_ns,
            ..with_raw_data()
        });
        let mut board = Board::new();
        let mut bounds_us = Vec::new();
        for tens in 1..20_u64 {
            board.session.handle_leap_seconds_wanted();
            let before = board.waits_us.len();
            board.run(&mut receiver, WorldNanos((tens * 10 + 10) * SECOND));
            let waits = &board.waits_us[before..];
            // It never waited longer than is proved.
            for (bound_us, waited_us) in waits {
                assert!(u64::from(*bound_us) >= *waited_us, "{bound_us} {waited_us}");
            }
            bounds_us.push(waits.iter().map(|(bound_us, _)| *bound_us).min().unwrap());
        }
        println!("{bounds_us:?}");
        // Once it has been full for a while, and no NAV-TIMELS has come by itself.
        assert!(
            bounds_us[3..].iter().all(|us| *us < most_us),
            "{bounds_us:?}"
        );
    }
}

#[test]
fn a_receiver_that_sends_leap_seconds_by_itself_proves_nothing_until_it_is_quiet() {
    let mut session = Session::new();
    let received = |now: Cycles| {
        Event::LeapSeconds(timebase::LeapSeconds {
            arrival: now,
            busy_us: u32::MAX,
            source: 2,
            count: Some(18),
            event: None,
        })
    };
    let mut bounds = Vec::new();
    let mut is_off = false;
    for tenth in 0..600_u64 {
        let now = Cycles::from_micros(tenth * 100_000);
        session.handle_event(now, &Event::Ack { class: 0, id: 0 });
        let mut polled = false;
        if tenth % 50 == 0 {
            session.handle_leap_seconds_wanted();
        }
        while let Some(Action::Transmit(bytes)) = session.poll(now) {
            let (class, id) = (bytes[2], bytes[3]);
            polled |= (class, id) == (0x01, 0x26);
            is_off |= bytes.get(6..9) == Some(&[0x01, 0x26, 0]);
            session.handle_sent(now);
            if class == 0x06 {
                session.handle_event(now, &Event::Ack { class, id });
            }
        }
        if polled || (!is_off && tenth % 10 == 0) {
            let mut event = received(now);
            session.handle_event(now, &event);
            session.limit_wait(&mut event);
            let Event::LeapSeconds(received) = event else {
                unreachable!()
            };
            bounds.push((tenth, received.busy_us));
        }
    }
    assert!(is_off);
    let proved = bounds.iter().filter(|(_, busy_us)| *busy_us < u32::MAX);
    let first = proved.clone().map(|(tenth, _)| *tenth).next();
    assert!(first.is_some_and(|tenth| tenth >= 100), "{bounds:?}");
    assert!(proved.count() >= 3, "{bounds:?}");
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
        panic!("CFG-PRT is polled first")
    };
    let frames = ubx::find_frames(bytes, |_, _, _| true);
    assert_eq!(frames.len(), 1);
    let port = Setting::Port.message(Generation::Messages);
    assert_eq!((frames[0].class, frames[0].id), port);
}
