//! The kinds of field reports, A to G, as flights of the world's pieces, each with the
//! time that is right.
//!
//! Bounds are those of the field reports: 250 ns under a proved pulse; without one the
//! receiver's latency and 20 ms, or 20 ms alone where a pulse has measured it.

use flight::demands::{Demand, Kind};
use flight::player::Setup;
use flight::{Flight, Window, replay};
use world::schedule::{
    Fault, FaultKind, FieldReceiver, PulseWord, QErrNonsense, RestartLie, RestartPulse, Schedule,
};

const PULSE_NS: u64 = 250;
const MS: u64 = 1_000_000;
/// The latency of the receiver, and 20 ms.
const UNTOLD_NS: u64 = 90 * MS;

/// A receiver with these faults for `lasts_s` seconds.
fn schedule(has_pulse: bool, lasts_s: f64, faults: &[(f64, f64, FaultKind)]) -> Schedule {
    let faults = faults.iter().map(|&(from_s, until_s, kind)| Fault {
        from_s,
        until_s,
        kind,
    });
    Schedule {
        seed: 7,
        lasts_s,
        start_utc_ns: 1_795_309_323_000_000_000,
        leap_at_s: None,
        receiver: FieldReceiver {
            period_ms: 200,
            floor_ms: 70.0,
            jitter_ms: 1.0,
            late_one_in: 50,
            lost_one_in: 0,
            is_tim_tp_behind: true,
            has_pulse,
            pulse_noise_ns: 25.0,
            width_ms: 37.0,
            t_acc_ns: 25,
            valid_from_s: 0.0,
            leap_source: 2,
            is_event_late: false,
        },
        crystal: vec![(0.0, 20.0), (60.0, 20.5), (180.0, 19.0)],
        faults: faults.collect(),
    }
}

/// Right in each of these spans within its number of ns, and misleading in none.
fn right(schedule: &Schedule, spans: &[(f64, f64, u64)]) {
    let span = |from_s, until_s| Window {
        from_s,
        until_s,
        name: String::new(),
    };
    let mut demands = vec![Demand {
        file: String::new(),
        span: span(0.0, schedule.lasts_s),
        kind: Kind::NotMisleading,
    }];
    demands.extend(spans.iter().map(|&(from_s, until_s, bound_ns)| Demand {
        file: String::new(),
        span: span(from_s, until_s),
        kind: Kind::Right { bound_ns },
    }));
    let flight = Flight::from(schedule);
    for judged in &replay(&flight, &Setup::default(), &demands, |_| {}).demands {
        if let Err(why) = judged.verdict() {
            panic!("{}: {why}", judged.demand);
        }
    }
}

#[test]
fn a_messages_never_outvote_a_live_pulse() {
    for by_ms in [-45.0, 30.0, 60.0] {
        let moved = [(60.0, 300.0, FaultKind::FloorStep { by_ms })];
        right(&schedule(true, 400.0, &moved), &[(30.0, 400.0, PULSE_NS)]);
    }
    let early = FaultKind::FirstMarks {
        marks: 1,
        by_ms: 45.0,
    };
    let early = [(0.0, 15.0, early)];
    right(&schedule(true, 120.0, &early), &[(30.0, 120.0, PULSE_NS)]);
}

#[test]
fn b_only_a_pulse_that_is_proved_is_believed() {
    let free = FaultKind::PulseFreeRun {
        phase_ms: 850.0,
        ppm: 0.0,
        word: PulseWord::NoUtc,
    };
    let free = schedule(true, 150.0, &[(0.0, 12.0, free)]);
    right(&free, &[(72.0, 150.0, PULSE_NS)]);
    let width_ms = 100.0;
    for kind in [
        FaultKind::PulseRate {
            hz: 10,
            is_told: true,
        },
        FaultKind::PulseRate {
            hz: 2,
            is_told: false,
        },
        FaultKind::PulseInverted,
        FaultKind::PulseWidth { width_ms },
    ] {
        let never = schedule(true, 200.0, &[(0.0, 200.0, kind)]);
        right(&never, &[(30.0, 200.0, UNTOLD_NS)]);
    }
    // A camera's pulse in place of ours: the messages, with the latency that ours measured.
    let camera = FaultKind::PulseSwap {
        phase_ms: 4.0,
        ppm: -3.0,
        width_ms: 50.0,
    };
    let camera = schedule(true, 400.0, &[(150.0, 400.0, camera)]);
    right(&camera, &[(30.0, 150.0, PULSE_NS), (210.0, 400.0, 20 * MS)]);
}

#[test]
fn c_lag_is_not_time() {
    let lag = |peak_s, rise_s, fall_s| FaultKind::Lag {
        peak_s,
        rise_s,
        fall_s,
    };
    let grows = [(120.0, 300.0, lag(2.5, 60.0, 20.0))];
    right(&schedule(true, 400.0, &grows), &[(30.0, 400.0, PULSE_NS)]);
    right(
        &schedule(false, 600.0, &grows),
        &[(30.0, 120.0, UNTOLD_NS), (500.0, 600.0, UNTOLD_NS)],
    );
    let from_boot = [(0.0, 60.0, lag(1.05, 0.0, 2.0))];
    right(
        &schedule(true, 180.0, &from_boot),
        &[(75.0, 180.0, PULSE_NS)],
    );
}

#[test]
fn d_a_floor_that_moves_is_no_frequency() {
    let once = [(5.0, 7.0, FaultKind::LabelOnce { by_ms: 90.0 })];
    right(&schedule(false, 300.0, &once), &[(30.0, 300.0, UNTOLD_NS)]);
    let later = FaultKind::Queue {
        by_ms: 100.0,
        edge_s: 20.0,
    };
    let later = schedule(false, 460.0, &[(60.0, 220.0, later)]);
    right(
        &later,
        &[
            (30.0, 60.0, UNTOLD_NS),
            (60.0, 400.0, 190 * MS),
            (400.0, 460.0, UNTOLD_NS),
        ],
    );
}

#[test]
fn e_the_number_of_the_second_waits_for_the_sky() {
    for (count, is_told) in [(15, true), (17, false), (17, true)] {
        let kind = FaultKind::LeapUnresolved {
            count,
            source: 0,
            is_told,
        };
        let unresolved = schedule(true, 240.0, &[(0.0, 120.0, kind)]);
        right(&unresolved, &[(150.0, 240.0, PULSE_NS)]);
    }
}

#[test]
fn f_a_set_clock_does_not_follow_another_date_or_another_hour() {
    let restart = FaultKind::Restart {
        silent_s: 20.0,
        lie: RestartLie::Date { by_days: -2_282 },
        pulse: RestartPulse::Silent,
    };
    let restart = schedule(false, 400.0, &[(120.0, 160.0, restart)]);
    right(
        &restart,
        &[(30.0, 120.0, UNTOLD_NS), (340.0, 400.0, UNTOLD_NS)],
    );
    for is_in_tim_tp in [false, true] {
        let hour = FaultKind::Labels {
            by_ns: 3_600_000_000_000,
            is_in_tim_tp,
        };
        let hour = schedule(true, 450.0, &[(200.0, 300.0, hour)]);
        right(&hour, &[(30.0, 200.0, PULSE_NS), (375.0, 450.0, PULSE_NS)]);
    }
    let early = schedule(true, 300.0, &[(120.0, 180.0, FaultKind::LeapEarly)]);
    right(&early, &[(30.0, 120.0, PULSE_NS), (255.0, 300.0, PULSE_NS)]);
}

#[test]
fn g_a_tick_is_no_longer_than_50_ns_and_one_loss_is_no_alarm() {
    let nonsense = FaultKind::QErr(QErrNonsense::Constant(300_000));
    let nonsense = schedule(true, 300.0, &[(100.0, 300.0, nonsense)]);
    right(&nonsense, &[(30.0, 300.0, PULSE_NS)]);
    let mut slow = schedule(false, 600.0, &[]);
    slow.receiver.period_ms = 1_000;
    slow.receiver.lost_one_in = 20;
    right(&slow, &[(30.0, 600.0, UNTOLD_NS)]);
}
