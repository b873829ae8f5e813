//! The clock under any marks, pulses and calls, in any order.
//!
//! *Design.* Random marks (from good ones to fields of any value), spells of a
//! receiver with a pulse, silences, late timers, stamps of any age and forecasts of
//! anything. The invariants of `board-model` demand that readings increase and the
//! slew limit holds; the tests add that the reading of a stamp never changes while
//! readers may still have that stamp.

use board_model::{Board, FRAME_NS, MS, SECOND, START, Scenario, good_mark};
use proptest::prelude::*;
use timebase::{CORE_HZ, CivilTime, Cycles, PulseForecast, PulseMark, TimeMark, Validity};
use utc_clock::{Ppb, Published, Settings, UtcClock, UtcNanos};
use world::Latency;

#[derive(Clone, Debug)]
enum Event {
    /// Time passes.
    Pass { ns: i64 },
    /// A good mark, late and with an epoch that is off.
    Good { late_ns: i64, off_ns: i64 },
    /// Some seconds of a receiver whose time and pulse are off.
    Spell {
        seconds: i64,
        off_ns: i64,
        pulse_off_ns: i64,
    },
    /// A mark with any fields.
    Any(Box<TimeMark>),
    /// A pulse at any time.
    Pulse { edge: u64 },
    /// A forecast of anything.
    Forecast { arrival: u64, late_ps: i32 },
    /// A timer that fires without a reason.
    Timeout,
}

fn any_mark() -> impl Strategy<Value = TimeMark> {
    let civil = (
        prop_oneof![1970..2110_u16, any::<u16>()],
        0..14_u8,
        0..33_u8,
        0..25_u8,
        0..62_u8,
        0..63_u8,
        prop_oneof![-5_000_000..995_000_000_i32, any::<i32>()],
    );
    let arrival = prop_oneof![0..100 * u64::from(CORE_HZ), any::<u64>()];
    let claims = prop::array::uniform5(prop::bool::weighted(0.9));
    (
        arrival,
        civil,
        prop_oneof![0..200_000_u32, any::<u32>()],
        claims,
    )
        .prop_map(
            |(arrival, (year, month, day, hour, minute, second, nano), t_acc_ns, claims)| {
                TimeMark {
                    arrival: Cycles(arrival),
                    epoch: CivilTime {
                        year,
                        month,
                        day,
                        hour,
                        minute,
                        second,
                        nano,
                    },
                    t_acc_ns,
                    validity: Validity {
                        date: claims[0],
                        time: claims[1],
                        fully_resolved: claims[2],
                        confirmed: claims[3],
                        leap_seconds_known: claims[4],
                    },
                }
            },
        )
}

fn any_cycles() -> impl Strategy<Value = u64> {
    prop_oneof![
        0..100 * u64::from(CORE_HZ),
        any::<u64>(),
        Just(0),
        Just(u64::MAX),
    ]
}

fn any_ps() -> impl Strategy<Value = i32> {
    prop_oneof![
        -21_000..21_000_i32,
        any::<i32>(),
        Just(i32::MIN),
        Just(i32::MAX)
    ]
}

fn any_settings() -> impl Strategy<Value = Settings> {
    (
        any::<bool>(),
        any::<u32>(),
        any::<u32>(),
        any::<i32>(),
        any::<i32>(),
    )
        .prop_map(
            |(require_confirmed, latency_ns, latency_uncertainty_ns, frequency, uncertainty)| {
                Settings {
                    require_confirmed,
                    latency_ns,
                    latency_uncertainty_ns,
                    frequency: Ppb(frequency),
                    frequency_uncertainty: Ppb(uncertainty),
                }
            },
        )
}

fn off() -> impl Strategy<Value = i64> {
    prop_oneof![
        6 => Just(0),
        2 => -400 * MS..400 * MS,
        1 => -2 * SECOND..2 * SECOND,
        1 => Just(SECOND),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    let pulse_off = prop_oneof![4 => Just(0), 1 => -1_000_000..1_000_000_i64, 1 => off()];
    prop_oneof![
        3 => (0..300 * MS).prop_map(|ns| Event::Pass { ns }),
        1 => (0..40 * SECOND).prop_map(|ns| Event::Pass { ns }),
        8 => (0..200 * MS, off()).prop_map(|(late_ns, off_ns)| Event::Good { late_ns, off_ns }),
        2 => (1..12_i64, off(), pulse_off).prop_map(|(seconds, off_ns, pulse_off_ns)| {
            Event::Spell { seconds, off_ns, pulse_off_ns }
        }),
        1 => any_mark().prop_map(|mark| Event::Any(Box::new(mark))),
        1 => any_cycles().prop_map(|edge| Event::Pulse { edge }),
        1 => (any_cycles(), any_ps())
            .prop_map(|(arrival, late_ps)| Event::Forecast { arrival, late_ps }),
        1 => Just(Event::Timeout),
    ]
}

/// Lets the board handle something, and checks that stamps of before have the same readings
/// after it, even if it sets the clock or steps it.
fn keeps_readings(board: &mut Board, handle: impl FnOnce(&mut Board)) {
    let now = board.cycles(board.now_ns);
    let stamps = [0, 1, 100_000, 800_000].map(|age| Cycles(now.0.saturating_sub(age)));
    let before = stamps.map(|when| board.timeline.reading_at(when));
    handle(board);
    let after = stamps.map(|when| board.timeline.reading_at(when));
    assert_eq!(before, after);
}

fn handle(board: &mut Board, event: Event) {
    match event {
        Event::Pass { ns } => board.pass_until(board.now_ns + ns),
        Event::Good { late_ns, off_ns } => {
            let epoch = UtcNanos(board.truth().0 + off_ns);
            let arrival = board.cycles(board.now_ns + late_ns);
            board.pass_until(board.now_ns + late_ns + FRAME_NS);
            let mark = good_mark(arrival, epoch).expect("an epoch of this century");
            keeps_readings(board, |board| {
                board.handle_mark(&mark);
            });
        }
        Event::Spell {
            seconds,
            off_ns,
            pulse_off_ns,
        } => {
            let first = board.now_ns / SECOND + 2;
            for second in first..first + seconds {
                board.handle_edge(second * SECOND + pulse_off_ns);
                for fifth in 0..5 {
                    let now_ns = second * SECOND + fifth * 200 * MS;
                    board.handle_arrival(UtcNanos(START.0 + now_ns + off_ns), now_ns + 40 * MS);
                }
            }
        }
        Event::Any(mark) => keeps_readings(board, |board| {
            board.handle_mark(&mark);
        }),
        Event::Pulse { edge } => keeps_readings(board, |board| {
            let edge = Cycles(edge);
            board.handle_pulse(&PulseMark { edge });
        }),
        Event::Forecast { arrival, late_ps } => board.clock.handle_forecast(&PulseForecast {
            arrival: Cycles(arrival),
            late_ps,
        }),
        Event::Timeout => {
            let now = board.cycles(board.now_ns);
            board.clock.handle_timeout(now);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn readings_increase_whatever_is_received(
        events in prop::collection::vec(event(), 1..120),
        crystal_ppb in -2_000_000.0..2_000_000.0,
    ) {
        let mut board = Board::new(Settings::DEFAULT, crystal_ppb);
        board.read_every_ns = Some(7 * MS);
        // From marks without sense no frequency can be learnt.
        board.invariants.margin_ppb = f64::INFINITY;
        for event in events {
            handle(&mut board, event);
        }
    }

    #[test]
    fn nothing_at_all_makes_it_panic(
        settings in any_settings(),
        events in prop::collection::vec((event(), any_cycles()), 1..200),
    ) {
        // Not even with a counter that jumps.
        let timeline = Published::new();
        let mut clock = UtcClock::new(settings, timeline.take_writer().unwrap());
        for (event, now) in events {
            match event {
                Event::Any(mark) => {
                    clock.handle_mark(&mark, Cycles(now));
                }
                Event::Good { late_ns, off_ns } => {
                    let arrival = Cycles(now.saturating_sub(late_ns.unsigned_abs()));
                    let epoch = UtcNanos(START.0 + off_ns);
                    let mark = good_mark(arrival, epoch).expect("an epoch of this century");
                    clock.handle_mark(&mark, Cycles(now));
                }
                Event::Pulse { edge } => {
                    clock.handle_pulse(&PulseMark { edge: Cycles(edge) }, Cycles(now));
                }
                Event::Forecast { arrival, late_ps } => {
                    clock.handle_forecast(&PulseForecast { arrival: Cycles(arrival), late_ps });
                    clock.handle_pulse(&PulseMark { edge: Cycles(now) }, Cycles(now));
                }
                _ => clock.handle_timeout(Cycles(now)),
            }
            for when in [now, now.wrapping_add(1 << 40), 0, u64::MAX] {
                let reading = timeline.reading_at(Cycles(when));
                prop_assert!(!reading.utc.to_string().is_empty());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 50,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn late_marks_are_ignored(
        seed in any::<u64>(),
        late_ms in proptest::collection::vec(prop_oneof![Just(0), 0..450_i64], 1..400),
    ) {
        let mut run = Scenario::new(Latency::m8(), seed).start();
        run.until(130 * SECOND);
        let settled = run.board.clock.counters();
        for late in late_ms {
            run.next_late_by(late * MS);
            // The largest difference of two M8s without late marks.
            let error_ns = run.floor_error_ns();
            prop_assert!(error_ns.abs() <= MS, "{error_ns} ns");
        }
        let counters = run.board.clock.counters();
        prop_assert_eq!(
            (settled.steps_forward, settled.steps_back),
            (counters.steps_forward, counters.steps_back)
        );
    }
}
