//! Schedules of faults: drawn the same each time, as far as they promise, and with
//! evidence that is true.

use std::collections::BTreeMap;

use world::schedule::{
    Fault, FaultKind, FieldReceiver, LASTS_S, QErrNonsense, RestartLie, Schedule,
};
use world::{Event, EventKind, WorldPicos};

const START_S: i64 = 1_795_309_323;
const GPS_EPOCH_S: i64 = 315_964_800;

/// A good receiver with a pulse, and these faults.
fn schedule(faults: Vec<Fault>) -> Schedule {
    Schedule {
        seed: 1,
        lasts_s: 60.0,
        start_utc_ns: START_S * 1_000_000_000,
        leap_at_s: None,
        receiver: FieldReceiver {
            period_ms: 200,
            floor_ms: 70.0,
            jitter_ms: 1.0,
            late_one_in: 0,
            lost_one_in: 0,
            is_tim_tp_behind: true,
            has_pulse: true,
            pulse_noise_ns: 20.0,
            width_ms: 37.0,
            t_acc_ns: 25,
            valid_from_s: 0.0,
            leap_source: 2,
            is_event_late: false,
        },
        crystal: vec![(0.0, 20.0)],
        faults,
    }
}

fn fault(from_s: f64, until_s: f64, kind: FaultKind) -> Fault {
    Fault {
        from_s,
        until_s,
        kind,
    }
}

/// Arrival, label and how long the line had been busy, in s, of each mark.
fn marks(schedule: &Schedule) -> Vec<(f64, f64, f64)> {
    let of = |event: &Event| match event.kind {
        EventKind::Mark {
            utc_ns, busy_us, ..
        } if schedule.leap_at_s.is_none() => Some((
            event.at.as_secs(),
            (utc_ns - schedule.start_utc_ns) as f64 * 1e-9,
            busy_us.expect("somebody looked") as f64 * 1e-6,
        )),
        _ => None,
    };
    schedule.events().iter().filter_map(of).collect()
}

/// Rises and falls, in s.
fn edges(schedule: &Schedule) -> (Vec<f64>, Vec<f64>) {
    let events = schedule.events();
    let of = |kind: EventKind| {
        let edges = events.iter().filter(|event| event.kind == kind);
        edges.map(|event| event.at.as_secs()).collect()
    };
    (of(EventKind::Rise), of(EventKind::Fall))
}

#[test]
fn the_same_seed_draws_the_same_and_another_does_not() {
    for seed in 0..8 {
        let (one, again) = (Schedule::draw(seed), Schedule::draw(seed));
        assert_eq!(one, again);
        assert_eq!(one.events(), again.events());
        assert_ne!(one.receiver, Schedule::draw(seed + 1).receiver);
    }
}

#[test]
fn there_are_two_to_five_faults_and_two_at_once_in_every_second_schedule() {
    let mut had = BTreeMap::new();
    for seed in 0..400 {
        let schedule = Schedule::draw(seed);
        *had.entry(schedule.faults.len()).or_insert(0) += 1;
        let faults = &schedule.faults;
        let meet = |one: &Fault, next: &Fault| {
            one != next && one.from_s < next.until_s && next.from_s < one.until_s
        };
        let is_at_once = faults
            .iter()
            .any(|one| faults.iter().any(|next| meet(one, next)));
        assert!(is_at_once || seed % 2 == 1, "{seed}");
    }
    assert_eq!(had.keys().copied().collect::<Vec<_>>(), [2, 3, 4, 5]);
    assert!(had.values().all(|times| *times > 60), "{had:?}");
}

/// The largest of what is to be reached, by name.
fn sizes(fault: &Fault) -> Vec<(&'static str, f64)> {
    let lasts_s = fault.until_s - fault.from_s;
    match fault.kind {
        FaultKind::FloorStep { by_ms } => vec![
            ("a floor step up", by_ms),
            ("a floor step down", -by_ms),
            ("a floor step's time", lasts_s),
        ],
        FaultKind::FloorRamp { by_ms, .. } => vec![
            ("a floor ramp up", by_ms),
            ("a floor ramp down", -by_ms),
            ("a floor ramp's time", lasts_s),
        ],
        FaultKind::FloorBreathe { by_ms, .. } => vec![("a breath", by_ms.abs())],
        FaultKind::Lag { peak_s, rise_s, .. } => vec![
            ("a lag", peak_s),
            ("a lag's time", lasts_s),
            ("a short lag", -lasts_s),
            ("a lag from boot", if rise_s == 0.0 { 1.0 } else { 0.0 }),
        ],
        FaultKind::Labels { by_ns, .. } if by_ns.abs() > 2_000_000_000 => vec![
            ("labels an hour off", by_ns.abs() as f64 / 3.6e12),
            ("an hour's time", lasts_s),
        ],
        FaultKind::Labels { by_ns, .. } => vec![
            ("labels ahead, ms", by_ns as f64 * 1e-6),
            ("labels behind, ms", by_ns as f64 * -1e-6),
            ("labels little off", -by_ns.abs() as f64 * 1e-6),
            ("labels' time", lasts_s),
        ],
        FaultKind::LeapUnresolved { count, .. } => vec![
            ("a count's time", fault.until_s),
            ("seconds fast", f64::from(18 - count)),
        ],
        FaultKind::Restart { lie, .. } => match lie {
            RestartLie::Date { by_days } => vec![
                ("a date to the end", fault.until_s),
                ("a date back", f64::from(-by_days)),
                ("a date ahead", f64::from(by_days)),
            ],
            RestartLie::Count { .. } => vec![("another count's time", lasts_s)],
            RestartLie::Nothing => vec![("a restart that knows", 1.0)],
        },
        FaultKind::PulseFreeRun { .. } => vec![("a free run", lasts_s)],
        FaultKind::PulseShifted { .. } => vec![("a shift with proof", lasts_s)],
        FaultKind::PulseRate { hz, .. } => vec![("a rate", f64::from(hz))],
        FaultKind::QErr(QErrNonsense::Constant(ps)) => vec![("a qErr", f64::from(ps).abs())],
        kind => vec![(kind.name(), 1.0)],
    }
}

#[test]
fn the_pieces_reach_what_is_promised() {
    let mut most: BTreeMap<&str, f64> = BTreeMap::new();
    for seed in 0..2_000 {
        for fault in Schedule::draw(seed).faults {
            for (name, size) in sizes(&fault) {
                let most = most.entry(name).or_insert(size);
                *most = most.max(size);
            }
        }
    }
    let promised = [
        ("a floor step up", 60.0),
        ("a floor step down", 60.0),
        ("a floor step's time", 400.0),
        ("a floor ramp up", 60.0),
        ("a floor ramp down", 60.0),
        ("a floor ramp's time", 400.0),
        ("a breath", 60.0),
        ("messages before marks", 1.0),
        ("a lag", 6.0),
        ("a lag's time", 240.0),
        ("a short lag", -10.0),
        ("a lag from boot", 1.0),
        ("first marks", 1.0),
        ("one label", 1.0),
        ("labels ahead, ms", 1_000.0),
        ("labels behind, ms", 1_000.0),
        ("labels little off", -1.0),
        ("labels' time", 60.0),
        ("labels an hour off", 1.0),
        ("an hour's time", 200.0),
        ("leap early", 1.0),
        ("a count's time", 750.0),
        ("seconds fast", 14.0),
        ("a date to the end", LASTS_S),
        ("a date back", 16_000.0 - 100.0),
        ("a date ahead", 7_168.0),
        ("another count's time", 60.0),
        ("a restart that knows", 1.0),
        ("silence", 1.0),
        ("other receiver", 1.0),
        ("a free run", LASTS_S),
        ("a shift with proof", 20.0),
        ("pulse doubled", 1.0),
        ("a rate", 1_000.0),
        ("pulse inverted", 1.0),
        ("pulse width", 1.0),
        ("pulse swapped", 1.0),
        ("pulse cut", 1.0),
        ("pulses missing", 1.0),
        ("pulses odd", 1.0),
        ("qErr", 1.0),
        ("a qErr", 2_147_483_647.0),
        ("TIM-TP lies", 1.0),
    ];
    for (name, size) in promised {
        // A ms of rounding.
        assert!(most[name] >= size - 0.001, "{name}: {}", most[name]);
    }
    // And nothing lasts longer than can be detected.
    assert!(most["a shift with proof"] <= 20.0);
    assert!(most["an hour's time"] <= 200.001);
    assert!(most["labels' time"] <= 60.001);
}

#[test]
fn crystals_move_by_1_ppm_a_minute_within_97_ppm() {
    let (mut steepest, mut most) = (0.0_f64, 0.0_f64);
    for seed in 0..200 {
        let crystal = Schedule::draw(seed).crystal;
        for pair in crystal.windows(2) {
            let minutes = (pair[1].0 - pair[0].0) / 60.0;
            steepest = steepest.max((pair[1].1 - pair[0].1).abs() / minutes);
        }
        most = crystal.iter().map(|knot| knot.1.abs()).fold(most, f64::max);
    }
    assert!((0.999..=1.000_001).contains(&steepest), "{steepest}");
    assert!((90.0..=97.0).contains(&most), "{most}");
}

/// Whatever goes wrong, what the board sees of the line is a proof: a message waited
/// no longer than the line had been busy.
#[test]
fn no_message_waited_longer_than_the_line_had_been_busy() {
    for seed in 0..300 {
        let schedule = Schedule::draw(seed);
        let moves_labels = |kind: &FaultKind| {
            matches!(
                kind,
                FaultKind::Labels { .. }
                    | FaultKind::LabelOnce { .. }
                    | FaultKind::FirstMarks { .. }
                    | FaultKind::LeapEarly
                    | FaultKind::LeapUnresolved { .. }
                    | FaultKind::Restart { .. }
            )
        };
        let marks = marks(&schedule);
        assert!(marks.is_sorted_by(|one, next| one.0 <= next.0), "{seed}");
        // No message comes 10 s late.
        let truly = |arrival_s: f64| {
            !schedule.faults.iter().any(|fault| {
                moves_labels(&fault.kind)
                    && fault.from_s <= arrival_s
                    && arrival_s - 10.0 < fault.until_s
            })
        };
        for (arrival_s, epoch_s, busy_s) in marks {
            if !truly(arrival_s) {
                continue;
            }
            // The jitter reaches 100 ms and more.
            let floor_s = schedule.floor_ms(epoch_s) * 1e-3;
            let waited_s = arrival_s - epoch_s - floor_s;
            assert!(waited_s > -1e-6, "{seed}: {arrival_s} {epoch_s}");
            assert!(
                waited_s <= busy_s + 0.13,
                "{seed}: {arrival_s} {epoch_s} {busy_s}"
            );
        }
    }
}

#[test]
fn a_lag_grows_and_ebbs_on_a_line_that_is_busy_all_the_time() {
    let kind = FaultKind::Lag {
        peak_s: 4.0,
        rise_s: 15.0,
        fall_s: 10.0,
    };
    let schedule = schedule(vec![fault(10.0, 40.0, kind)]);
    let marks = marks(&schedule);
    let most = marks.iter().map(|mark| mark.0 - mark.1).fold(0.0, f64::max);
    assert!((4.06..4.08).contains(&most), "{most}");
    for (arrival_s, epoch_s, busy_s) in marks {
        if (10.2..39.8).contains(&epoch_s) {
            assert!(
                (arrival_s - busy_s - 10.0).abs() < 1e-5,
                "{arrival_s} {busy_s}"
            );
        } else if !(9.8..40.2).contains(&epoch_s) {
            assert!(busy_s == 0.0, "{epoch_s}");
        }
    }
}

#[test]
fn a_good_flight_has_all_the_evidence() {
    let schedule = schedule(Vec::new());
    assert_eq!(marks(&schedule).len(), 300);
    let (rises, falls) = edges(&schedule);
    assert_eq!((rises.len(), falls.len()), (59, 59));
    for (number, (rise, fall)) in (1..).zip(rises.iter().zip(&falls)) {
        assert!((rise - f64::from(number)).abs() < 200e-9);
        assert!((fall - rise - 0.037).abs() < 300e-9);
    }
    let mut forecasts = 0;
    let mut answers = 0;
    for event in schedule.events() {
        match event.kind {
            EventKind::TimTp {
                names: Some(name),
                late_ps,
                busy_us,
            } => {
                // It names the next pulse, right behind its NAV-PVT.
                let utc_s = GPS_EPOCH_S + i64::from(name.week) * 604_800;
                let pulse_s = utc_s + i64::from(name.tow_ms) / 1_000 - START_S;
                assert_eq!(pulse_s, event.at.as_secs() as i64 + 1);
                assert_eq!((name.tow_ms % 1_000, name.flags), (0, 0x0b));
                assert!(late_ps.abs() <= 10_400);
                assert_eq!(busy_us, Some(8_680));
                forecasts += 1;
            }
            EventKind::TimeLs { source, count, .. } => {
                assert_eq!((source, count), (2, 18));
                answers += 1;
            }
            _ => {}
        }
    }
    assert_eq!((forecasts, answers), (60, 1));
}

#[test]
fn pulses_are_shaped_as_named() {
    let shaped = |kind| edges(&schedule(vec![fault(9.5, 12.5, kind)]));
    // The three seconds of the fault: rises in them, and the first high's length.
    let seen = |kind| {
        let (rises, falls) = shaped(kind);
        let rises: Vec<f64> = rises
            .into_iter()
            .filter(|rise| (9.9..12.95).contains(rise))
            .collect();
        let high_s = rises.first().map(|rise| {
            let fall = falls.iter().find(|fall| *fall > rise);
            fall.expect("it falls") - rise
        });
        let millis = |s: f64| (s * 1e3).round() as i64;
        let first = rises.first().copied().map(millis);
        (rises.len(), first, high_s.map(millis))
    };
    let shifted = FaultKind::PulseShifted { phase_ms: 250.0 };
    assert_eq!(seen(shifted), (3, Some(10_250), Some(37)));
    let width = FaultKind::PulseWidth { width_ms: 100.0 };
    assert_eq!(seen(width), (3, Some(10_000), Some(100)));
    assert_eq!(seen(FaultKind::PulseInverted), (3, Some(10_037), Some(963)));
    assert_eq!(seen(FaultKind::PulseCut), (0, None, None));
    let rate = FaultKind::PulseRate {
        hz: 10,
        is_told: true,
    };
    assert_eq!(seen(rate), (30, Some(10_000), Some(37)));
    let doubled = FaultKind::PulseDoubled {
        after_ms: 500.0,
        width_ms: 10.0,
    };
    assert_eq!(seen(doubled), (6, Some(10_000), Some(37)));
    let swapped = FaultKind::PulseSwap {
        phase_ms: 300.0,
        ppm: 3.0,
        width_ms: 50.0,
    };
    assert_eq!(seen(swapped), (3, Some(10_300), Some(50)));
}

#[test]
fn a_count_that_is_not_resolved_is_asked_for_each_10_s() {
    let kind = FaultKind::LeapUnresolved {
        count: 16,
        source: 0,
        is_told: true,
    };
    let schedule = schedule(vec![fault(0.0, 25.0, kind)]);
    let answers: Vec<_> = schedule
        .events()
        .iter()
        .filter_map(|event| match event.kind {
            EventKind::TimeLs { source, count, .. } => {
                Some((event.at.as_secs() as i64, source, count))
            }
            _ => None,
        })
        .collect();
    assert_eq!(answers, [(1, 0, 16), (11, 0, 16), (21, 0, 16), (31, 2, 18)]);
    for (_, epoch_s, _) in marks(&schedule).iter().take(10) {
        assert!(*epoch_s >= 2.0, "two seconds fast");
    }
    let has = |at_s| schedule.calm().has(at_s);
    assert!(!has(25.0 + 11.0 + 74.0) && has(25.0 + 11.0 + 75.0));
}

#[test]
fn a_leap_second_is_announced_told_and_counted() {
    let mut schedule = schedule(Vec::new());
    // 20 s before midnight.
    schedule.start_utc_ns = (START_S / 86_400 * 86_400 - 20) * 1_000_000_000;
    schedule.leap_at_s = Some(20.0);
    let midnight_ns = schedule.start_utc_ns + 20_000_000_000;
    let mut answers = Vec::new();
    let mut in_second_60 = Vec::new();
    for event in schedule.events() {
        match event.kind {
            EventKind::TimeLs {
                count,
                change,
                to_event_s,
                ..
            } => answers.push((event.at.as_secs() as i64, count, change, to_event_s)),
            EventKind::Mark60 { nano, .. } => in_second_60.push(nano / 1_000_000),
            EventKind::Mark { utc_ns, .. } => {
                // Arrivals are less than 0.2 s after their epoch.
                let since_ns = event.at.as_nanos() - 20_000_000_000;
                let leapt_ns = if since_ns > 0 { 1_000_000_000 } else { 0 };
                let late_ns = since_ns - leapt_ns - (utc_ns - midnight_ns);
                assert!((0..200_000_000).contains(&late_ns), "{utc_ns}");
            }
            EventKind::TimTp { names, .. } => {
                let name = names.expect("it names one");
                let named_s = i64::from(name.tow_ms / 1_000) - midnight_ns / 1_000_000_000
                    + GPS_EPOCH_S
                    + i64::from(name.week) * 604_800;
                let pulse_s = event.at.as_secs() as i64 + 1 - 20;
                assert_eq!(named_s, pulse_s - i64::from(pulse_s > 0));
            }
            EventKind::Rise | EventKind::Fall => {}
        }
    }
    assert_eq!(in_second_60, [0, 200, 400, 600, 800]);
    assert_eq!(
        answers,
        [
            (1, 18, 1, 19),
            (11, 18, 1, 9),
            (21, 19, 0, -1),
            (31, 19, 0, -11),
            (41, 19, 0, -21),
            (51, 19, 0, -31)
        ]
    );
    assert!(!schedule.calm().has(21.9) && !schedule.calm().has(70.0));
    assert!(
        schedule.calm().has(75.0),
        "a leap second excuses itself alone"
    );
}

#[test]
fn a_floor_that_moves_is_an_excuse_without_a_pulse_alone() {
    let step = fault(300.0, 700.0, FaultKind::FloorStep { by_ms: 60.0 });
    let mut schedule = schedule(vec![step]);
    let calm = schedule.calm();
    assert!(!calm.has(74.0) && calm.has(75.0) && calm.has(301.0) && calm.has(701.0));
    schedule.receiver.has_pulse = false;
    let calm = schedule.calm();
    let observed = [
        199.0, 200.0, 299.0, 300.0, 599.0, 600.0, 700.0, 999.0, 1_000.0,
    ];
    let expected = [false, true, true, false, false, true, false, false, true];
    assert_eq!(observed.map(|at_s| calm.has(at_s)), expected);
    assert_eq!(
        [299.0, 300.0, 700.0].map(|at_s| schedule.floor_ms(at_s)),
        [70.0, 130.0, 70.0]
    );
}

#[test]
fn what_cannot_be_told_is_never_drawn_among_the_others() {
    for seed in 0..1_000 {
        let schedule = Schedule::draw(seed);
        assert!(schedule.is_detectable(), "{seed}");
        let is_undetectable = |fault: &Fault| {
            matches!(
                fault.kind,
                FaultKind::ForgedSky { .. } | FaultKind::PulseDragged { .. }
            )
        };
        assert!(!schedule.faults.iter().any(is_undetectable), "{seed}");
    }
    // Wrong labels before the clock can know better are an example.
    let kind = FaultKind::Labels {
        by_ns: 3_600_000_000_000,
        is_in_tim_tp: true,
    };
    let with = |from_s: f64| schedule(vec![fault(from_s, from_s + 5.0, kind)]);
    assert!(!with(20.0).is_detectable() && with(41.0).is_detectable());
}

#[test]
fn events_stand_in_the_order_of_their_time_and_end_with_the_flight() {
    for seed in 0..100 {
        let events = Schedule::draw(seed).events();
        assert!(events.is_sorted_by_key(|event| event.at));
        let last = events.last().expect("it says something").at;
        assert!(last < WorldPicos::from_secs(LASTS_S));
        assert!(last > WorldPicos::from_secs(LASTS_S - 600.0));
        let mut is_high = false;
        for event in events {
            match event.kind {
                EventKind::Rise => assert!(!core::mem::replace(&mut is_high, true)),
                EventKind::Fall => assert!(core::mem::replace(&mut is_high, false)),
                _ => {}
            }
        }
    }
}
