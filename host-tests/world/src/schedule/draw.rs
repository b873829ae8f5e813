//! Schedules drawn from seeds.
//!
//! *Design.* Sizes and durations reach their ends often: one in six draws is the
//! largest that is allowed, one in ten the smallest. A fault that breaks a rule of
//! [`Schedule::is_tellable`] together with the others is drawn again.

use fastrand::Rng;

use super::{
    Fault, FaultKind, FieldReceiver, PulseWord, QErrNonsense, RestartLie, RestartPulse, Schedule,
    TimTpLie,
};
use crate::chance::{Stream, even, stream};

/// How long a flight lasts, in s: 20 minutes.
pub const LASTS_S: f64 = 1_200.0;

/// The first and the last day on which a flight begins, in s since 1970: 2025-06-01
/// and 2040-01-01.
const DAYS_S: std::ops::Range<i64> = 1_748_736_000..2_208_988_800;
/// Crystals are within so many ppm, and move by at most so many a minute.
const MOST_PPM: f64 = 97.0;
const MOST_PPM_PER_MIN: f64 = 1.0;
/// Floors stay below this, in ms: what a clock without a pulse has to allow for.
const MOST_FLOOR_MS: f64 = 145.0;
/// Faults begin before this, in s.
const LAST_BEGIN_S: f64 = 1_000.0;
/// A stretch without anything that keeps a clock from being set, in s.
const SETTLED_S: f64 = 30.0;
/// A pulse was followed for so long before it shifts, in s.
const FOLLOWED_S: f64 = 30.0;
/// One schedule in so many has a leap second.
const EVENT_ONE_IN: u32 = 12;
/// Around a leap second no count and no label is wrong, in s.
const EVENT_ALONE_S: f64 = 130.0;
const DAY_S: i64 = 86_400;
/// A receiver that says nothing for so long has started anew, in s.
const SEEN_SILENCE_S: f64 = 5.0;
/// Attempts at a fault that keeps the rules.
const ATTEMPTS: usize = 200;

/// A family of faults that is drawn with the same chance as any other.
type Draw = fn(&mut Rng, &FieldReceiver) -> Fault;

/// What can befall any receiver.
const OF_MESSAGES: [Draw; 13] = [
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
const OF_PULSES: [Draw; 13] = [
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

/// What nothing on the board can tell.
const UNTELLABLE: [Draw; 3] = [forged_sky, shifted_for_ever, dragged];

impl Schedule {
    /// The schedule of a seed: two to five faults, in every second one two at once.
    #[must_use]
    pub fn draw(seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Schedule);
        let mut schedule = Self::without_faults(seed, &mut rng);
        let faults = rng.usize(2..=5);
        let is_at_once = seed.is_multiple_of(2);
        while schedule.faults.len() < faults {
            let within = if is_at_once && schedule.faults.len() == 1 {
                schedule.faults.first().copied()
            } else {
                None
            };
            if !schedule.add_fault(&mut rng, within) {
                // Nothing fits the first one.
                schedule.faults.clear();
            }
        }
        schedule
            .faults
            .sort_by(|one, next| one.from_s.total_cmp(&next.from_s));
        schedule
    }

    /// A schedule with a fault that nothing on the board can tell.
    #[must_use]
    pub fn draw_untellable(seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Schedule);
        let mut schedule = Self::without_faults(seed, &mut rng);
        // The last kind is a floor that no clock without a pulse allows for.
        let kind = rng.usize(0..=UNTELLABLE.len());
        if let Some(draw) = UNTELLABLE.get(kind) {
            schedule.receiver.has_pulse = true;
            schedule.faults.push(draw(&mut rng, &schedule.receiver));
        } else {
            schedule.receiver.has_pulse = false;
            schedule.receiver.floor_ms = 300.0 + 300.0 * even(&mut rng);
        }
        schedule
    }

    fn without_faults(seed: u64, rng: &mut Rng) -> Self {
        let periods_ms = [200, 200, 200, 200, 200, 100, 1_000, 60, 40];
        let receiver = FieldReceiver {
            period_ms: periods_ms[rng.usize(..periods_ms.len())],
            floor_ms: between(rng, 20.0, 110.0),
            jitter_ms: between(rng, 0.3, 4.0),
            late_one_in: if rng.bool() { rng.u32(20..200) } else { 0 },
            lost_one_in: if rng.bool() { rng.u32(20..500) } else { 0 },
            is_tim_tp_behind: rng.bool(),
            has_pulse: rng.u32(..10) < 7,
            pulse_noise_ns: between(rng, 3.0, 35.0),
            width_ms: f64::from(rng.u32(20..=150)),
            t_acc_ns: rng.u32(8..=100),
            valid_from_s: if rng.bool() {
                0.0
            } else {
                reach(rng, 1.0, 60.0).round()
            },
            leap_source: [2, 2, 2, 3, 4, 5][rng.usize(..6)],
            is_event_late: false,
        };
        let start_s = rng.i64(DAYS_S);
        let crystal = crystal(rng);
        let mut schedule = Self {
            seed,
            lasts_s: LASTS_S,
            start_utc_ns: start_s * 1_000_000_000,
            leap_at_s: None,
            receiver,
            crystal,
            faults: Vec::new(),
        };
        schedule.draw_event();
        schedule
    }

    /// In one schedule of so many, a leap second at the end of its day.
    fn draw_event(&mut self) {
        let mut rng = stream(self.seed, Stream::ScheduleEvent);
        if rng.u32(..EVENT_ONE_IN) != 0 {
            return;
        }
        let leap_s = between(&mut rng, 300.0, LAST_BEGIN_S).floor();
        let day_s = self.start_utc_ns / 1_000_000_000 / DAY_S * DAY_S;
        self.start_utc_ns = (day_s - leap_s as i64) * 1_000_000_000;
        self.leap_at_s = Some(leap_s);
        self.receiver.is_event_late = rng.bool();
    }

    /// Adds a fault that begins within `within`, if that is one; says whether one was
    /// found.
    fn add_fault(&mut self, rng: &mut Rng, within: Option<Fault>) -> bool {
        for _ in 0..ATTEMPTS {
            let of_pulse = self.receiver.has_pulse && rng.bool();
            let draw = if of_pulse {
                OF_PULSES[rng.usize(..OF_PULSES.len())]
            } else {
                OF_MESSAGES[rng.usize(..OF_MESSAGES.len())]
            };
            let mut fault = draw(rng, &self.receiver);
            if let Some(first) = within {
                // What is there from the start cannot be moved into another one.
                let can_move = fault.from_s > 0.0;
                let room_s = (first.until_s - first.from_s).min(LASTS_S - first.from_s);
                if can_move {
                    let lasts_s = fault.until_s - fault.from_s;
                    fault.from_s = whole(first.from_s + even(rng) * room_s * 0.8);
                    fault.until_s = fault.from_s + lasts_s;
                }
                if fault.from_s >= first.until_s || first.from_s >= fault.until_s {
                    continue;
                }
            }
            self.faults.push(fault);
            if self.is_tellable() {
                return true;
            }
            self.faults.pop();
        }
        false
    }

    /// Whether the evidence on the board is enough to tell each fault.
    ///
    /// - Labels that are wrong, with nothing else to say against them, need a clock that
    ///   has been set by right ones. So does a shifted pulse that TIM-TP confirms; that
    ///   one needs a clock that followed the pulse right before, or its phase is as good
    ///   as any.
    /// - A pulse that leaves its second as slowly as a crystal moves is told by TIM-TP's
    ///   word, or by its absence: no lag and no silence may be the reason for that.
    /// - Wrong labels stand for less than 300 s: after that they are the reason to start
    ///   anew.
    /// - Restarts do not overlap, and one with another leap count shows: it is silent for 5 s,
    ///   or the clock has been set.
    /// - A leap second is told by the count alone: around it, no label and no count is wrong.
    /// - The floor stays between 5 and 145 ms.
    #[must_use]
    pub fn is_tellable(&self) -> bool {
        let of = |kind: fn(&FaultKind) -> bool| {
            self.faults.iter().filter(move |fault| kind(&fault.kind))
        };
        let is_label =
            |kind: &FaultKind| matches!(kind, FaultKind::Labels { .. } | FaultKind::LeapEarly);
        let settled = |before_s: f64, for_s: f64| self.settled_from(for_s) + for_s <= before_s;
        let labels_ok = of(is_label).all(|fault| settled(fault.from_s, SETTLED_S));
        let labels_apart = self.labels_apart();
        let shifts_ok = of(|kind| matches!(kind, FaultKind::PulseShifted { .. })).all(|shift| {
            let needed = (shift.from_s - FOLLOWED_S)..shift.until_s;
            let others = self.faults.iter().filter(|fault| *fault != shift);
            settled(shift.from_s, FOLLOWED_S)
                && others.into_iter().all(|fault| {
                    !touches_pulse(&fault.kind)
                        || fault.until_s <= needed.start
                        || needed.end + FOLLOWED_S <= fault.from_s
                })
        });
        let drifts_ok = of(drifts_from_its_second).all(|drift| {
            of(holds_tim_tp_back)
                .all(|other| other.until_s <= drift.from_s || drift.until_s <= other.from_s)
        });
        labels_ok
            && labels_apart
            && shifts_ok
            && drifts_ok
            && self.once_each()
            && self.restarts_ok()
            && self.event_alone()
            && self.floor_stays()
    }

    /// What is there from the start is there once.
    fn once_each(&self) -> bool {
        let count = |kind: fn(&FaultKind) -> bool| {
            self.faults.iter().filter(|fault| kind(&fault.kind)).count()
        };
        count(|kind| matches!(kind, FaultKind::LeapUnresolved { .. })) <= 1
            && count(|kind| matches!(kind, FaultKind::FirstMarks { .. })) <= 1
            && count(|kind| matches!(kind, FaultKind::Lag { rise_s: 0.0, .. })) <= 1
    }

    /// Restarts are apart, for two wrong dates can add up to one that is believed; and one
    /// with another count is seen: by the clock, which has been set, or by its silence.
    fn restarts_ok(&self) -> bool {
        let restarts: Vec<_> = self
            .faults
            .iter()
            .filter_map(|fault| match fault.kind {
                FaultKind::Restart { silent_s, lie, .. } => Some((fault, silent_s, lie)),
                _ => None,
            })
            .collect();
        let are_apart = restarts.iter().enumerate().all(|(number, (one, ..))| {
            restarts[number + 1..]
                .iter()
                .all(|(next, ..)| next.until_s <= one.from_s || one.until_s <= next.from_s)
        });
        let are_seen = restarts.iter().all(|(fault, silent_s, lie)| {
            !matches!(lie, RestartLie::Count { .. })
                || *silent_s >= SEEN_SILENCE_S
                || self.settled_from(SETTLED_S) + SETTLED_S <= fault.from_s
        });
        are_apart && are_seen
    }

    fn event_alone(&self) -> bool {
        let Some(leap_s) = self.leap_at_s else {
            return true;
        };
        self.faults.iter().all(|fault| {
            let tells_second = fault.kind.is_contradiction()
                || matches!(
                    fault.kind,
                    FaultKind::Labels { .. } | FaultKind::LeapUnresolved { .. }
                );
            !tells_second
                || fault.until_s + EVENT_ALONE_S < leap_s
                || leap_s + EVENT_ALONE_S < fault.from_s
        })
    }

    fn floor_stays(&self) -> bool {
        let begins_and_middles = self
            .faults
            .iter()
            .filter(|fault| fault.kind.moves_floor() || is_other_receiver(&fault.kind))
            .flat_map(|fault| match fault.kind {
                FaultKind::FloorBreathe { period_s, .. } => [
                    fault.from_s + period_s / 4.0,
                    fault.from_s + period_s * 3.0 / 4.0,
                ],
                _ => [fault.from_s, (fault.from_s + fault.until_s) / 2.0],
            });
        begins_and_middles
            .map(|at_s| self.floor_ms(at_s))
            .all(|floor_ms| (super::plan::MIN_FLOOR_MS + 1e-9..MOST_FLOOR_MS).contains(&floor_ms))
    }

    /// Labels that are off by an hour do not follow each other.
    fn labels_apart(&self) -> bool {
        let off: Vec<&Fault> = self
            .faults
            .iter()
            .filter(|fault| fault.kind.is_contradiction())
            .collect();
        let hours = off.iter().filter(|fault| {
            matches!(fault.kind, FaultKind::Labels { by_ns, .. } if by_ns.abs() > 2_000_000_000)
        });
        hours.count() <= 1
    }

    /// When the first stretch of so many s begins in which nothing keeps a clock from
    /// being set.
    fn settled_from(&self, for_s: f64) -> f64 {
        let mut from_s = self.receiver.valid_from_s.max(0.0) + 11.0;
        // Each blocker moves it at most once past its end.
        for _ in 0..=self.faults.len() {
            for fault in self.faults.iter().filter(|fault| keeps_unset(&fault.kind)) {
                if fault.from_s < from_s + for_s && from_s < fault.until_s + 11.0 {
                    from_s = fault.until_s + 11.0;
                }
            }
        }
        from_s
    }
}

/// Whether a clock may be kept from being set by it.
const fn keeps_unset(kind: &FaultKind) -> bool {
    matches!(
        kind,
        FaultKind::Lag { .. }
            | FaultKind::Queue { .. }
            | FaultKind::FirstMarks { .. }
            | FaultKind::LeapUnresolved { .. }
            | FaultKind::Restart { .. }
            | FaultKind::Silence
            | FaultKind::Labels { .. }
            | FaultKind::LeapEarly
    )
}

/// Whether a pulse may not be followed because of it.
const fn touches_pulse(kind: &FaultKind) -> bool {
    kind.shapes_pulse()
        || is_other_receiver(kind)
        || matches!(
            kind,
            FaultKind::Restart { .. }
                | FaultKind::TimTpLie(_)
                | FaultKind::QErr(_)
                | FaultKind::LeapUnresolved { .. }
        )
}

const fn is_other_receiver(kind: &FaultKind) -> bool {
    matches!(kind, FaultKind::OtherReceiver { .. })
}

/// Whether TIM-TP comes late, or not at all.
const fn holds_tim_tp_back(kind: &FaultKind) -> bool {
    matches!(
        kind,
        FaultKind::Lag { .. } | FaultKind::Silence | FaultKind::TimTpLie(TimTpLie::Missing)
    )
}

fn drifts_from_its_second(kind: &FaultKind) -> bool {
    matches!(kind, FaultKind::PulseFreeRun { phase_ms, .. } if phase_ms.abs() <= 1.0)
}

/// Linear between knots of 20 s to 3 minutes, each piece at up to the steepest.
fn crystal(rng: &mut Rng) -> Vec<(f64, f64)> {
    let mut at_s = 0.0;
    let mut ppm = between(rng, -MOST_PPM, MOST_PPM);
    let mut knots = vec![(at_s, ppm)];
    while at_s < LASTS_S {
        let lasts_s = between(rng, 20.0, 180.0).round();
        let sign = if rng.bool() { 1.0 } else { -1.0 };
        let by = sign * reach(rng, 0.0, MOST_PPM_PER_MIN) * lasts_s / 60.0;
        // Turns round at the end.
        let next = if (ppm + by).abs() > MOST_PPM {
            ppm - by
        } else {
            ppm + by
        };
        at_s += lasts_s;
        ppm = next;
        knots.push((at_s, ppm));
    }
    knots
}

fn between(rng: &mut Rng, least: f64, most: f64) -> f64 {
    least + (most - least) * even(rng)
}

/// Between two ends, and often one of them; small ones are as frequent as large ones
/// where the ends are decades apart.
fn reach(rng: &mut Rng, least: f64, most: f64) -> f64 {
    match rng.u32(..60) {
        0..10 => most,
        10..16 => least,
        16..38 if least > 0.0 => least * (most / least).powf(even(rng)),
        _ => between(rng, least, most),
    }
}

fn either_sign(rng: &mut Rng, size: f64) -> f64 {
    if rng.bool() { size } else { -size }
}

/// To a ms, so that what is printed is what was played.
fn whole(s: f64) -> f64 {
    (s * 1e3).round() / 1e3
}

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
