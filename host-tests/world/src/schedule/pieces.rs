//! The pieces of a schedule: one function a kind of fault, which draws its sizes and
//! its span.

use fastrand::Rng;

use super::sizes::{between, either_sign, reach, whole};

use super::{
    Fault, FaultKind, FieldReceiver, PulseWord, QErrNonsense, RestartLie, RestartPulse, TimTpLie,
};
use crate::chance::even;

/// How long a flight lasts, in s: 20 minutes.
pub const LASTS_S: f64 = 1_200.0;
/// Faults begin before this, in s.
pub(super) const LAST_BEGIN_S: f64 = 1_000.0;

/// A family of faults that is drawn with the same chance as any other.
pub(super) type Draw = fn(&mut Rng, &FieldReceiver) -> Fault;

/// What can befall any receiver.
pub(super) const OF_MESSAGES: [Draw; 13] = [
    floor_step,
    floor_ramp,
    floor_breathe,
    queue,
    lag,
    lag,
    first_marks,
    label_once,
    labels,
    labels_hour,
    leap_unresolved,
    restart,
    leap_early_or_silence,
];

/// And one whose pulse is wired.
pub(super) const OF_PULSES: [Draw; 13] = [
    free_run,
    free_run,
    shifted,
    doubled,
    rate,
    inverted,
    width,
    swap,
    cut,
    missing_or_odd,
    q_err,
    tim_tp_lie,
    other_receiver,
];

/// What nothing on the board can detect.
pub(super) const UNTELLABLE: [Draw; 3] = [forged_sky, shifted_for_ever, dragged];

/// A fault that begins anywhere.
fn anywhere(rng: &mut Rng, lasts_s: f64, kind: FaultKind) -> Fault {
    let from_s = whole(between(rng, 5.0, LAST_BEGIN_S));
    Fault {
        from_s,
        until_s: whole(from_s + lasts_s),
        kind,
    }
}

/// A fault that begins anywhere and may last until the end.
fn as_long_as_you_like(rng: &mut Rng, kind: FaultKind) -> Fault {
    let mut fault = anywhere(rng, 0.0, kind);
    if rng.u32(..4) == 0 {
        fault.from_s = 0.0;
    }
    fault.until_s = if rng.u32(..4) == 0 {
        LASTS_S
    } else {
        whole(fault.from_s + reach(rng, 5.0, 600.0))
    };
    fault
}

fn floor_step(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ms = reach(rng, 1.0, 60.0);
    let by_ms = either_sign(rng, by_ms);
    let lasts_s = reach(rng, 5.0, 400.0);
    anywhere(rng, lasts_s, FaultKind::FloorStep { by_ms })
}

fn floor_ramp(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ms = reach(rng, 1.0, 60.0);
    let by_ms = either_sign(rng, by_ms);
    let lasts_s = reach(rng, 5.0, 400.0);
    let edge_s = between(rng, 0.1, 0.5) * lasts_s;
    anywhere(rng, lasts_s, FaultKind::FloorRamp { by_ms, edge_s })
}

fn floor_breathe(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ms = reach(rng, 1.0, 60.0);
    let by_ms = either_sign(rng, by_ms);
    let period_s = reach(rng, 10.0, 400.0);
    let lasts_s = reach(rng, period_s.min(399.0), 400.0);
    anywhere(rng, lasts_s, FaultKind::FloorBreathe { by_ms, period_s })
}

fn queue(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ms = reach(rng, 2.0, 100.0);
    let lasts_s = reach(rng, 10.0, 240.0);
    let edge_s = [0.0, 0.5][rng.usize(..2)] * even(rng) * lasts_s;
    anywhere(rng, lasts_s, FaultKind::Queue { by_ms, edge_s })
}

fn lag(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let lasts_s = reach(rng, 10.0, 240.0);
    // It cannot grow as fast as time passes.
    let most_s = (0.4 * lasts_s).min(6.0);
    let peak_s = reach(rng, 0.05, most_s);
    let least_s = peak_s / 0.9;
    let fall_s = between(rng, least_s, lasts_s - least_s);
    if rng.u32(..5) == 0 {
        let kind = FaultKind::Lag {
            peak_s,
            rise_s: 0.0,
            fall_s,
        };
        return Fault {
            from_s: 0.0,
            until_s: whole(lasts_s),
            kind,
        };
    }
    let rise_s = between(rng, least_s, lasts_s - fall_s.min(lasts_s - least_s));
    let kind = FaultKind::Lag {
        peak_s,
        rise_s,
        fall_s,
    };
    anywhere(rng, lasts_s, kind)
}

fn first_marks(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ms = reach(rng, 5.0, 110.0);
    let by_ms = either_sign(rng, by_ms);
    let marks = rng.u8(1..=3);
    Fault {
        from_s: 0.0,
        until_s: 15.0,
        kind: FaultKind::FirstMarks { marks, by_ms },
    }
}

fn label_once(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ms = reach(rng, 1.0, 1_000.0);
    let by_ms = either_sign(rng, by_ms);
    anywhere(rng, 2.0, FaultKind::LabelOnce { by_ms })
}

fn labels(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ns = (reach(rng, 1.0, 1_000.0) * 1e6) as i64;
    let kind = FaultKind::Labels {
        by_ns: if rng.bool() { by_ns } else { -by_ns },
        is_in_tim_tp: rng.bool(),
    };
    let lasts_s = reach(rng, 0.5, 60.0);
    anywhere(rng, lasts_s, kind)
}

fn labels_hour(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ns = 3_600_000_000_000;
    let kind = FaultKind::Labels {
        by_ns: if rng.bool() { by_ns } else { -by_ns },
        is_in_tim_tp: rng.bool(),
    };
    let lasts_s = reach(rng, 1.0, 200.0);
    anywhere(rng, lasts_s, kind)
}

fn leap_unresolved(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    // A count of BeiDou's is 14 less, and comes from a sky.
    let (count, source) = match rng.u32(..8) {
        0 => (4, 4),
        1 => (rng.i8(15..=18), 255),
        2 => (rng.i8(15..=18), 6),
        _ => (rng.i8(15..=18), 0),
    };
    let is_told = rng.u32(..3) != 0;
    let until_s = whole(reach(rng, 20.0, 750.0));
    Fault {
        from_s: 0.0,
        until_s,
        kind: FaultKind::LeapUnresolved {
            count,
            source,
            is_told,
        },
    }
}

fn restart(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let silent_s = reach(rng, 0.5, 30.0);
    let pulse = match rng.u32(..3) {
        0 => RestartPulse::Silent,
        1 => RestartPulse::RunsFreely(between(rng, 1.0, 999.0)),
        _ => RestartPulse::GoesOn,
    };
    let (lie, lies_s) = match rng.u32(..4) {
        0 => (RestartLie::Nothing, 0.0),
        1 => {
            let count = [15, 16, 17, 19][rng.usize(..4)];
            (RestartLie::Count { count }, reach(rng, 1.0, 60.0))
        }
        _ => {
            let by_days = outside(rng);
            (RestartLie::Date { by_days }, reach(rng, 1.0, 1_200.0))
        }
    };
    let kind = FaultKind::Restart {
        silent_s,
        lie,
        pulse,
    };
    let mut fault = anywhere(rng, silent_s + lies_s, kind);
    fault.until_s = fault.until_s.min(LASTS_S);
    fault
}

/// Days by which a date is outside any window of 1024 weeks that has the flight's: 16
/// years back is before 2025, 19.7 years on is after 2044.
fn outside(rng: &mut Rng) -> i32 {
    match rng.u32(..3) {
        0 => -1_024 * 7,
        1 => 1_024 * 7,
        _ => -rng.i32(5_900..16_000),
    }
}

fn leap_early_or_silence(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let lasts_s = reach(rng, 1.0, 60.0);
    if rng.bool() {
        anywhere(rng, lasts_s, FaultKind::LeapEarly)
    } else {
        anywhere(rng, lasts_s * 4.0, FaultKind::Silence)
    }
}

fn free_run(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    // From the second itself, from near to it, or from anywhere.
    let near = rng.u32(..6);
    let phase_ms = match near {
        0 => 0.0,
        1 => {
            let phase_ms = reach(rng, 0.001, 1.0);
            either_sign(rng, phase_ms)
        }
        _ => between(rng, 1.0, 999.0),
    };
    let ppm = reach(rng, 0.05, 5.0);
    let kind = FaultKind::PulseFreeRun {
        phase_ms,
        ppm: if near == 0 || rng.bool() {
            either_sign(rng, ppm)
        } else {
            0.0
        },
        word: match rng.u32(..4) {
            0 => PulseWord::Nothing,
            1 => PulseWord::Fraction,
            _ => PulseWord::NoUtc,
        },
    };
    as_long_as_you_like(rng, kind)
}

fn shifted(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let phase_ms = between(rng, 1.0, 999.0);
    let lasts_s = reach(rng, 2.0, 20.0).floor();
    let mut fault = anywhere(rng, lasts_s, FaultKind::PulseShifted { phase_ms });
    // Pulses belong to whole seconds: no more than are allowed.
    fault.from_s = fault.from_s.floor() + 0.5;
    fault.until_s = fault.from_s + lasts_s;
    fault
}

fn doubled(rng: &mut Rng, receiver: &FieldReceiver) -> Fault {
    let width_ms = [receiver.width_ms, 10.0, 50.0][rng.usize(..3)];
    let after_ms = between(rng, receiver.width_ms + 1.0, 999.0 - width_ms);
    as_long_as_you_like(rng, FaultKind::PulseDoubled { after_ms, width_ms })
}

fn rate(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let hz = [2, 3, 4, 5, 10, 25, 100, 1_000][rng.usize(..8)];
    let is_told = rng.bool();
    let mut fault = as_long_as_you_like(rng, FaultKind::PulseRate { hz, is_told });
    if hz >= 100 {
        // Nothing new after a minute, and many edges.
        fault.until_s = fault.until_s.min(fault.from_s + 6_000.0 / f64::from(hz));
    }
    fault
}

fn inverted(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    as_long_as_you_like(rng, FaultKind::PulseInverted)
}

/// A width that nobody takes for the receiver's, in ms.
fn other_width_ms(rng: &mut Rng, receiver: &FieldReceiver) -> f64 {
    let width_ms = if rng.bool() {
        [100.0, 10.0, 50.0, 200.0][rng.usize(..4)]
    } else {
        between(rng, 0.01, 500.0)
    };
    if (width_ms - receiver.width_ms).abs() < 5.0 {
        width_ms + 10.0
    } else {
        width_ms
    }
}

fn width(rng: &mut Rng, receiver: &FieldReceiver) -> Fault {
    let width_ms = other_width_ms(rng, receiver);
    as_long_as_you_like(rng, FaultKind::PulseWidth { width_ms })
}

fn swap(rng: &mut Rng, receiver: &FieldReceiver) -> Fault {
    let ppm = reach(rng, 0.05, 50.0);
    let kind = FaultKind::PulseSwap {
        phase_ms: between(rng, 0.0, 999.0),
        ppm: either_sign(rng, ppm),
        width_ms: other_width_ms(rng, receiver),
    };
    as_long_as_you_like(rng, kind)
}

fn cut(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    as_long_as_you_like(rng, FaultKind::PulseCut)
}

fn missing_or_odd(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let one_in = rng.u32(2..=20);
    let kind = if rng.bool() {
        FaultKind::PulseMissing { one_in }
    } else {
        FaultKind::PulseOdd { one_in }
    };
    as_long_as_you_like(rng, kind)
}

fn q_err(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let nonsense = match rng.u32(..4) {
        0 => {
            let ps = reach(rng, 50_001.0, 2_147_483_647.0);
            QErrNonsense::Constant(either_sign(rng, ps) as i32)
        }
        1 => QErrNonsense::Random,
        2 => QErrNonsense::Negated,
        _ => QErrNonsense::Invalid,
    };
    as_long_as_you_like(rng, FaultKind::QErr(nonsense))
}

fn tim_tp_lie(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let lies = [
        TimTpLie::GpsBase,
        TimTpLie::Glonass,
        TimTpLie::Week,
        TimTpLie::NoRaim,
        TimTpLie::NoUtc,
        TimTpLie::Missing,
    ];
    let lie = lies[rng.usize(..lies.len())];
    as_long_as_you_like(rng, FaultKind::TimTpLie(lie))
}

fn other_receiver(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_ms = reach(rng, 1.0, 60.0);
    let kind = FaultKind::OtherReceiver {
        floor_by_ms: either_sign(rng, by_ms),
        pulse_by_ns: between(rng, -50.0, 50.0),
    };
    as_long_as_you_like(rng, kind)
}

fn forged_sky(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let by_s = reach(rng, 1.0, 3e7).round() as i64;
    Fault {
        from_s: 0.0,
        until_s: LASTS_S,
        kind: FaultKind::ForgedSky {
            by_ns: by_s * 1_000_000_000,
        },
    }
}

fn shifted_for_ever(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let phase_ms = between(rng, 1.0, 400.0);
    Fault {
        from_s: 0.0,
        until_s: LASTS_S,
        kind: FaultKind::PulseShifted { phase_ms },
    }
}

fn dragged(rng: &mut Rng, _: &FieldReceiver) -> Fault {
    let ppb = reach(rng, 1.0, 15.0);
    let kind = FaultKind::PulseDragged {
        ppb: either_sign(rng, ppb),
    };
    let mut fault = anywhere(rng, 0.0, kind);
    fault.until_s = LASTS_S;
    fault
}
