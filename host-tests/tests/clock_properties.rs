//! The clock under any marks, pulses and calls, in any order.
//!
//! *Design.* Random marks (from good ones to fields of any value, from lines that are
//! idle or busy), spells of a receiver with a pulse, silences, late timers, stamps of any age, both
//! edges of pulses of any width, and TIM-TP and NAV-TIMELS that say anything. The invariants of
//! `board-model` demand that readings increase and the slew limit holds; the tests add that the
//! reading of a stamp never changes while readers may still have that stamp.

use board_model::{Board, FRAME_NS, MS, PULSE_WIDTH_NS, SECOND, START, Scenario, good_mark};
use proptest::prelude::*;
use timebase::{
    CORE_HZ, CivilTime, Cycles, LeapEvent, LeapSeconds, Polarity, PulseEdge, PulseForecast,
    TimeMark, Validity,
};
use utc_clock::{Ppb, Published, Settings, UtcClock, UtcNanos};
use world::Latency;

#[derive(Clone, Debug)]
enum Event {
    /// Time passes.
    Pass { ns: i64 },
    /// A good mark, late, with an epoch that is off, from a line that is busy.
    Good {
        late_ns: i64,
        off_ns: i64,
        busy_us: u32,
    },
    /// Some seconds of a receiver whose time and pulse are off.
    Spell {
        seconds: i64,
        off_ns: i64,
        pulse_off_ns: i64,
    },
    /// A mark with any fields.
    Any(Box<TimeMark>),
    /// An edge at any time.
    Edge(PulseEdge),
    /// A pulse of any width, which a TIM-TP has announced.
    Pulse { width_ns: i64 },
    /// A forecast of anything.
    Forecast(PulseForecast),
    /// A NAV-TIMELS that says anything.
    LeapSeconds(LeapSeconds),
    /// The receiver acknowledges a pulse of that width, or has acknowledged none.
    Width(Option<u32>),
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
        any_busy_us(),
        civil,
        prop_oneof![0..200_000_u32, any::<u32>()],
        claims,
    )
        .prop_map(
            |(
                arrival,
                busy_us,
                (year, month, day, hour, minute, second, nano),
                t_acc_ns,
                claims,
            )| {
                TimeMark {
                    arrival: Cycles(arrival),
                    busy_us,
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

fn any_busy_us() -> impl Strategy<Value = u32> {
    prop_oneof![4 => Just(0), 2 => 0..400_000_u32, 1 => any::<u32>()]
}

fn any_edge() -> impl Strategy<Value = PulseEdge> {
    let polarity = prop_oneof![Just(Polarity::Rise), Just(Polarity::Fall)];
    (any_cycles(), polarity).prop_map(|(at, polarity)| PulseEdge {
        at: Cycles(at),
        polarity,
    })
}

fn any_forecast() -> impl Strategy<Value = PulseForecast> {
    let tow_ms = prop_oneof![(0..604_800_u32).prop_map(|s| s * 1_000), any::<u32>()];
    let flags = (prop::bool::weighted(0.9), prop::bool::weighted(0.9));
    (
        any_cycles(),
        any_busy_us(),
        prop::option::of(any_ps()),
        tow_ms,
        any::<u16>(),
        flags,
    )
        .prop_map(
            |(arrival, busy_us, late_ps, tow_ms, week, (is_utc_base, is_utc_available))| {
                PulseForecast {
                    arrival: Cycles(arrival),
                    busy_us,
                    late_ps,
                    tow_ms,
                    week,
                    is_utc_base,
                    is_utc_available,
                }
            },
        )
}

fn any_leap_seconds() -> impl Strategy<Value = LeapSeconds> {
    let count = prop_oneof![4 => Just(18), 1 => any::<i8>()];
    let change = prop_oneof![4 => -1..=1_i8, 1 => any::<i8>()];
    // 2026-11-23T00:00:00Z is 82 677 s after the start.
    let in_s = prop_oneof![0..40_000_i32, 82_600..82_700_i32, any::<i32>()];
    let event = (change, in_s).prop_map(|(change, in_s)| LeapEvent { change, in_s });
    (
        any_cycles(),
        any_busy_us(),
        any::<u8>(),
        prop::option::of(count),
        prop::option::of(event),
    )
        .prop_map(|(arrival, busy_us, source, count, event)| LeapSeconds {
            arrival: Cycles(arrival),
            busy_us,
            source: if source < 128 { source % 9 } else { source },
            count,
            event,
        })
}

fn any_settings() -> impl Strategy<Value = Settings> {
    (
        any::<bool>(),
        any::<[u32; 4]>(),
        prop::option::of(any::<i8>()),
        prop_oneof![Just(Settings::DATE_FLOOR.0), any::<i64>()],
        any::<[i32; 2]>(),
    )
        .prop_map(
            |(
                require_confirmed,
                [
                    latency_ns,
                    latency_uncertainty_ns,
                    pulse_uncertainty_ns,
                    hidden_turn_ns,
                ],
                leap_seconds,
                date_floor,
                [frequency, uncertainty],
            )| {
                Settings {
                    require_confirmed,
                    latency_ns,
                    latency_uncertainty_ns,
                    pulse_uncertainty_ns,
                    hidden_turn_ns,
                    leap_seconds,
                    date_floor: UtcNanos(date_floor),
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
        8 => (0..200 * MS, off(), any_busy_us()).prop_map(|(late_ns, off_ns, busy_us)| {
            Event::Good { late_ns, off_ns, busy_us }
        }),
        2 => (1..12_i64, off(), pulse_off).prop_map(|(seconds, off_ns, pulse_off_ns)| {
            Event::Spell { seconds, off_ns, pulse_off_ns }
        }),
        1 => any_mark().prop_map(|mark| Event::Any(Box::new(mark))),
        1 => any_edge().prop_map(Event::Edge),
        1 => prop_oneof![Just(PULSE_WIDTH_NS), 0..SECOND]
            .prop_map(|width_ns| Event::Pulse { width_ns }),
        1 => any_forecast().prop_map(Event::Forecast),
        1 => any_leap_seconds().prop_map(Event::LeapSeconds),
        1 => prop::option::of(prop_oneof![3 => Just(100_000_u32), 1 => any::<u32>()])
            .prop_map(Event::Width),
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
        Event::Good {
            late_ns,
            off_ns,
            busy_us,
        } => {
            let epoch = UtcNanos(board.truth().0 + off_ns);
            let arrival = board.cycles(board.now_ns + late_ns);
            board.pass_until(board.now_ns + late_ns + FRAME_NS);
            let mark = TimeMark {
                busy_us,
                ..good_mark(arrival, epoch).expect("an epoch of this century")
            };
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
                board.handle_pulse(second * SECOND + pulse_off_ns);
                for fifth in 0..5 {
                    let now_ns = second * SECOND + fifth * 200 * MS;
                    board.handle_arrival(UtcNanos(START.0 + now_ns + off_ns), now_ns + 40 * MS);
                }
            }
        }
        Event::Any(mark) => keeps_readings(board, |board| {
            board.handle_mark(&mark);
        }),
        Event::Edge(edge) => keeps_readings(board, |board| {
            board.handle_edge(&edge);
        }),
        Event::Pulse { width_ns } => {
            board.handle_pulse_of(board.now_ns + SECOND, width_ns);
        }
        Event::Forecast(forecast) => board.clock.handle_forecast(&forecast),
        Event::LeapSeconds(received) => keeps_readings(board, |board| {
            let now = board.cycles(board.now_ns);
            board.clock.handle_leap_seconds(&received, now);
            board.clock.poll_leap_seconds(now);
        }),
        Event::Width(width_us) => board.clock.handle_pulse_width(width_us),
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
                Event::Good { late_ns, off_ns, busy_us } => {
                    let arrival = Cycles(now.saturating_sub(late_ns.unsigned_abs()));
                    let epoch = UtcNanos(START.0 + off_ns);
                    let mark = good_mark(arrival, epoch).expect("an epoch of this century");
                    clock.handle_mark(&TimeMark { busy_us, ..mark }, Cycles(now));
                }
                Event::Edge(edge) => {
                    clock.handle_edge(&edge, Cycles(now));
                }
                Event::Forecast(forecast) => {
                    clock.handle_forecast(&forecast);
                    let polarity = Polarity::Rise;
                    clock.handle_edge(&PulseEdge { at: Cycles(now), polarity }, Cycles(now));
                }
                Event::Pulse { width_ns } => {
                    let at = Cycles(now).plus(Cycles::from_nanos(width_ns.unsigned_abs()).0);
                    clock.handle_edge(&PulseEdge { at, polarity: Polarity::Fall }, at);
                }
                Event::LeapSeconds(received) => {
                    clock.handle_leap_seconds(&received, Cycles(now));
                    clock.poll_leap_seconds(Cycles(now));
                }
                Event::Width(width_us) => clock.handle_pulse_width(width_us),
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
