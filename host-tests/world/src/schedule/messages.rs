//! The receiver's messages of a schedule, through its line's queue.
//!
//! *Design.* Each message is made, is ready when the receiver has computed it, and
//! leaves when the line is free. A line that is full of other messages holds all of
//! them back by the lag of the moment, and has been busy since the lag began.

use fastrand::Rng;

use super::{
    FaultKind, LEAP_COUNT, PulseWord, QErrNonsense, RestartLie, RestartPulse, Schedule, TimTpLie,
};
use crate::chance::{Stream, even, normal, stream};
use crate::{Event, EventKind, PulseName, WorldPicos};

const NS_PER_S: i64 = 1_000_000_000;
const NS_PER_MS: f64 = 1e6;
/// A byte at 115200 baud, in ns.
const BYTE_NS: i64 = 86_800;
/// A gap of two byte times ends what is busy, in ns.
const GAP_NS: i64 = 2 * BYTE_NS;
/// Bytes of the frames.
const NAV_PVT_BYTES: i64 = 100;
const TIM_TP_BYTES: i64 = 24;
const TIME_LS_BYTES: i64 = 32;
/// TIM-TP that leaves by itself is made so late in its second, in ns.
const TIM_TP_ALONE_NS: i64 = 360_000_000;
/// TIM-TP's time of week is so many ms behind a whole second where it tells of one that
/// is none.
const FRACTION_MS: i64 = 350;
/// The first poll of NAV-TIMELS, in s.
const FIRST_POLL_S: f64 = 1.05;
/// From poll to poll until the count is known, and then, in s.
const POLL_UNRESOLVED_S: f64 = 10.0;
const POLL_RESOLVED_S: f64 = 600.0;
/// Around an event it polls often, from so long before to so long after, in s.
const POLL_BEFORE_EVENT_S: f64 = 60.0;
const POLL_AFTER_EVENT_S: f64 = 120.0;
/// A contradicted second is asked about after so long, in s.
const POLL_CONTRADICTED_S: f64 = 1.0;
/// The start of GPS weeks, in s since 1970.
const GPS_EPOCH_S: i64 = 315_964_800;
const WEEK_S: i64 = 604_800;
const DAY_S: i64 = 86_400;
/// What NAV-TIMELS tells of the past leap second: 2017-01-01, in s since 1970.
const LAST_LEAP_S: i64 = 1_483_228_800;
/// A leap second that is announced for months later, in s.
const MONTHS_S: i32 = 19_090_556;

/// A message that waits to leave.
struct Ready {
    at_ns: i64,
    bytes: i64,
    kind: EventKind,
}

/// What the receiver believes at a moment.
struct Belief {
    is_silent: bool,
    /// Its labels are ahead, in ns.
    label_ns: i64,
    /// TIM-TP's name for the pulse is ahead, in s.
    name_s: i64,
    valid: u8,
    t_acc_ns: u32,
    leap_source: u8,
    leap_count: i8,
    is_leap_early: bool,
    /// TIM-TP's flags.
    flags: u8,
}

impl Schedule {
    /// The messages, in the order of their arrival; `late_ps` is by how much each
    /// second's pulse is late.
    pub(super) fn messages(&self, late_ps: &[i32]) -> Vec<Event> {
        let mut ready = self.solutions(late_ps);
        ready.extend(self.leap_answers());
        ready.sort_by_key(|message| message.at_ns);
        self.queue(ready)
    }

    /// NAV-PVT of each epoch, and TIM-TP of each second.
    fn solutions(&self, late_ps: &[i32]) -> Vec<Ready> {
        let receiver = &self.receiver;
        let mut rng = stream(self.seed, Stream::ScheduleMessages);
        let mut ready = Vec::new();
        let period_ns = receiver.period_ms * 1_000_000;
        let epochs = (self.lasts_s * 1e9) as i64 / period_ns;
        // Marks since the receiver's last start, and since a label was to be off once.
        let mut heard = 0_u32;
        let mut had_once = vec![false; self.faults.len()];
        for epoch_ns in (0..epochs).map(|number| number * period_ns) {
            let at_s = epoch_ns as f64 * 1e-9;
            let jitter_ms = self.jitter_ms(&mut rng);
            let is_lost = one_in(&mut rng, receiver.lost_one_in);
            let belief = self.belief(at_s);
            if belief.is_silent {
                heard = 0;
                continue;
            }
            let ready_ns = epoch_ns + ((self.floor_ms(at_s) + jitter_ms) * NS_PER_MS) as i64;
            if !is_lost {
                let label_ns = belief.label_ns + self.once_ns(at_s, heard, &mut had_once);
                heard += 1;
                ready.push(Ready {
                    at_ns: ready_ns,
                    bytes: NAV_PVT_BYTES,
                    kind: self.nav_pvt(epoch_ns, label_ns, &belief),
                });
            }
            // With the first solution of each second.
            if receiver.has_pulse && epoch_ns % NS_PER_S < period_ns {
                // Right behind NAV-PVT: a ns later, so that sorting keeps it there.
                let alone_ns = if receiver.is_tim_tp_behind {
                    1
                } else {
                    TIM_TP_ALONE_NS
                };
                let second = epoch_ns / NS_PER_S;
                let late_ps = late_ps.get(second as usize + 1).copied().unwrap_or(0);
                if let Some(kind) = self.tim_tp(&mut rng, second, alone_ns, late_ps, &belief) {
                    ready.push(Ready {
                        at_ns: ready_ns + alone_ns,
                        bytes: TIM_TP_BYTES,
                        kind,
                    });
                }
            }
        }
        ready
    }

    /// NAV-PVT of an epoch whose label is ahead.
    fn nav_pvt(&self, epoch_ns: i64, label_ns: i64, belief: &Belief) -> EventKind {
        let since_leap_ns = self
            .leap_at_s
            .map(|leap_s| epoch_ns - (leap_s * 1e9) as i64)
            .filter(|since_ns| (0..NS_PER_S).contains(since_ns));
        match since_leap_ns {
            Some(nano) if label_ns == 0 => EventKind::Mark60 {
                nano: nano as i32,
                busy_us: None,
            },
            _ => EventKind::Mark {
                utc_ns: self.utc_ns(epoch_ns) + label_ns,
                t_acc_ns: belief.t_acc_ns,
                valid: belief.valid,
                busy_us: None,
            },
        }
    }

    /// How much later than the least latency a message is, in ms.
    fn jitter_ms(&self, rng: &mut Rng) -> f64 {
        let usual_ms = normal(rng).abs() * self.receiver.jitter_ms;
        let more_ms = -15.0 * even(rng).ln();
        if one_in(rng, self.receiver.late_one_in) {
            usual_ms + more_ms.min(100.0)
        } else {
            usual_ms
        }
    }

    /// What is ahead in one label alone, in ns.
    fn once_ns(&self, at_s: f64, heard: u32, had_once: &mut [bool]) -> i64 {
        let mut ahead_ms = 0.0;
        for (fault, had) in self.faults.iter().zip(had_once) {
            match fault.kind {
                FaultKind::FirstMarks { marks, by_ms }
                    if fault.is_at(at_s) && heard < u32::from(marks) =>
                {
                    ahead_ms += by_ms;
                }
                FaultKind::LabelOnce { by_ms } if fault.is_at(at_s) && !*had => {
                    *had = true;
                    ahead_ms += by_ms;
                }
                _ => {}
            }
        }
        (ahead_ms * NS_PER_MS) as i64
    }

    /// What the receiver believes at a moment.
    fn belief(&self, at_s: f64) -> Belief {
        let receiver = &self.receiver;
        let has_time = at_s >= receiver.valid_from_s;
        let mut belief = Belief {
            is_silent: false,
            label_ns: 0,
            name_s: 0,
            valid: if has_time { 0x37 } else { 0xf0 },
            t_acc_ns: if has_time {
                receiver.t_acc_ns
            } else {
                u32::MAX
            },
            leap_source: if has_time { receiver.leap_source } else { 0 },
            leap_count: LEAP_COUNT + i8::from(self.is_after_leap(at_s)),
            is_leap_early: false,
            flags: if has_time { 0x0b } else { 0x11 },
        };
        for fault in self.faults_at(at_s) {
            self.take_fault(at_s, fault.from_s, &fault.kind, &mut belief);
        }
        belief
    }

    fn take_fault(&self, at_s: f64, from_s: f64, kind: &FaultKind, belief: &mut Belief) {
        match *kind {
            FaultKind::Labels {
                by_ns,
                is_in_tim_tp,
            } => {
                belief.label_ns += by_ns;
                if is_in_tim_tp {
                    belief.name_s += by_ns / NS_PER_S;
                }
            }
            FaultKind::ForgedSky { by_ns } => {
                belief.label_ns += by_ns;
                belief.name_s += by_ns.div_euclid(NS_PER_S);
            }
            FaultKind::LeapEarly => {
                belief.is_leap_early = true;
                self.count(LEAP_COUNT + 1, belief);
            }
            FaultKind::LeapUnresolved {
                count,
                source,
                is_told,
            } => {
                self.count(count, belief);
                belief.leap_source = source;
                if is_told {
                    belief.valid |= 0xf0;
                    belief.flags &= !2;
                }
            }
            FaultKind::Restart {
                silent_s,
                lie,
                pulse,
            } => {
                belief.is_silent |= at_s < from_s + silent_s;
                belief.leap_source = 0;
                match lie {
                    RestartLie::Nothing => belief.leap_source = self.receiver.leap_source,
                    RestartLie::Date { by_days } => {
                        let by_s = i64::from(by_days) * DAY_S;
                        belief.label_ns += by_s * NS_PER_S;
                        belief.name_s += by_s;
                        if pulse != RestartPulse::GoesOn {
                            belief.flags &= !2;
                        }
                    }
                    RestartLie::Count { count } => {
                        self.count(count, belief);
                        belief.valid |= 0xf0;
                        belief.flags &= !2;
                    }
                }
            }
            FaultKind::Silence => belief.is_silent = true,
            _ => {}
        }
    }

    /// The receiver believes in another leap count.
    fn count(&self, count: i8, belief: &mut Belief) {
        let ahead_s = i64::from(LEAP_COUNT) - i64::from(count);
        belief.label_ns += ahead_s * NS_PER_S;
        belief.name_s += ahead_s;
        belief.leap_count = count;
    }

    /// What TIM-TP says in a second of the pulse of the next one; nothing where it is
    /// missing.
    fn tim_tp(
        &self,
        rng: &mut Rng,
        second: i64,
        said_ns: i64,
        late_ps: i32,
        belief: &Belief,
    ) -> Option<EventKind> {
        let pulse_s = second as f64 + 1.0;
        let random: i32 = rng.i32(..);
        let tick: i32 = rng.i32(-10_400..=10_400);
        let mut late_ps = late_ps;
        let mut flags = belief.flags;
        let pulse_ms = self.utc_ns((second + 1) * NS_PER_S) / 1_000_000;
        let mut name_ms = pulse_ms + belief.name_s * 1_000;
        for fault in self.faults_at(pulse_s) {
            match fault.kind {
                FaultKind::PulseFreeRun { word, .. } => match word {
                    PulseWord::Nothing => return None,
                    PulseWord::NoUtc => flags = flags & 1 | 0x10,
                    PulseWord::Fraction => name_ms += FRACTION_MS,
                },
                FaultKind::Restart {
                    pulse: RestartPulse::Silent | RestartPulse::RunsFreely(_),
                    ..
                } => flags = flags & !0x0c | 0x10,
                FaultKind::PulseRate { hz, is_told: true } => {
                    // The next pulse is the first after the message.
                    let ready_ms = self.floor_ms(second as f64) as i64 + said_ns / 1_000_000;
                    let hz = i64::from(hz);
                    let pulse = (ready_ms * hz / 1_000 + 1).min(hz);
                    name_ms += pulse * 1_000 / hz - 1_000;
                }
                FaultKind::QErr(nonsense) => match nonsense {
                    QErrNonsense::Constant(ps) => late_ps = ps,
                    QErrNonsense::Random => late_ps = random,
                    QErrNonsense::Negated => late_ps = -late_ps,
                    QErrNonsense::Invalid => (late_ps, flags) = (tick, flags | 0x10),
                },
                FaultKind::TimTpLie(lie) => match lie {
                    TimTpLie::GpsBase => {
                        flags &= !1;
                        name_ms += i64::from(belief.leap_count) * 1_000;
                    }
                    TimTpLie::Glonass => name_ms += 3 * 3_600_000,
                    TimTpLie::Week => name_ms -= 1_024 * WEEK_S * 1_000,
                    TimTpLie::NoRaim => flags = flags & !0x0c | 0x04,
                    TimTpLie::NoUtc => flags &= !2,
                    TimTpLie::Missing => return None,
                },
                _ => {}
            }
        }
        let since_ms = name_ms - GPS_EPOCH_S * 1_000;
        let week = since_ms.div_euclid(WEEK_S * 1_000);
        Some(EventKind::TimTp {
            late_ps,
            names: Some(PulseName {
                tow_ms: since_ms.rem_euclid(WEEK_S * 1_000) as u32,
                week: week.clamp(0, i64::from(u16::MAX)) as u16,
                flags,
            }),
            busy_us: None,
        })
    }

    /// The answers to the polls of NAV-TIMELS, at the times at which the firmware polls.
    fn leap_answers(&self) -> Vec<Ready> {
        let mut rng = stream(self.seed, Stream::ScheduleLeap);
        // Besides, it polls when the second is contradicted, and when that ends.
        let mut begins: Vec<f64> = self
            .faults
            .iter()
            .filter(|fault| fault.kind.is_contradiction())
            .flat_map(|fault| match fault.kind {
                FaultKind::Restart { silent_s, .. } => [fault.from_s + silent_s, fault.until_s],
                _ => [fault.from_s, fault.until_s],
            })
            .map(|at_s| at_s + POLL_CONTRADICTED_S)
            .collect();
        begins.sort_by(f64::total_cmp);
        let mut begins = begins.into_iter().peekable();
        let mut answers = Vec::new();
        let mut poll_s = FIRST_POLL_S;
        while poll_s < self.lasts_s {
            let ready_s = poll_s + 0.02 + 0.1 * even(&mut rng);
            let belief = self.belief(ready_s);
            let is_resolved = belief.leap_source != 0
                && belief.leap_count >= LEAP_COUNT
                && !matches!(belief.leap_source, 6 | 255);
            if !belief.is_silent {
                answers.push(Ready {
                    at_ns: (ready_s * 1e9) as i64,
                    bytes: TIME_LS_BYTES,
                    kind: self.time_ls(ready_s, &belief),
                });
            }
            let contradicted = self
                .faults_at(poll_s)
                .any(|fault| fault.kind.is_contradiction());
            let next_s = if is_resolved && !belief.is_silent && !contradicted {
                self.next_poll_s(poll_s)
            } else {
                poll_s + POLL_UNRESOLVED_S
            };
            while begins.next_if(|begin_s| *begin_s <= poll_s).is_some() {}
            poll_s = begins.peek().map_or(next_s, |begin_s| begin_s.min(next_s));
        }
        answers
    }

    /// When the firmware polls again where the count is known: often around an event.
    fn next_poll_s(&self, poll_s: f64) -> f64 {
        let seldom_s = poll_s + POLL_RESOLVED_S;
        let Some(leap_s) = self.leap_at_s else {
            return seldom_s;
        };
        let around = leap_s - POLL_BEFORE_EVENT_S..leap_s + POLL_AFTER_EVENT_S;
        if around.contains(&poll_s) {
            poll_s + POLL_UNRESOLVED_S
        } else if poll_s < around.start {
            seldom_s.min(around.start)
        } else {
            seldom_s
        }
    }

    fn time_ls(&self, at_s: f64, belief: &Belief) -> EventKind {
        let has_sky = belief.leap_source != 0;
        let mut change = 0;
        let to_event_s = match self.leap_at_s {
            _ if !has_sky => 0,
            _ if belief.is_leap_early => MONTHS_S,
            Some(leap_s) => {
                change = i8::from(!self.is_after_leap(at_s));
                let late_s = f64::from(u8::from(self.receiver.is_event_late));
                (leap_s + late_s - at_s).ceil() as i32
            }
            None => {
                let since_s = self.start_utc_ns / NS_PER_S + at_s as i64 - LAST_LEAP_S;
                -since_s as i32
            }
        };
        EventKind::TimeLs {
            source: belief.leap_source,
            count: belief.leap_count,
            change,
            to_event_s,
            busy_us: None,
        }
    }

    /// Lets messages leave one after the other.
    fn queue(&self, ready: Vec<Ready>) -> Vec<Event> {
        let mut events = Vec::with_capacity(ready.len());
        let mut free_ns = i64::MIN;
        let mut busy_since_ns = i64::MIN;
        for message in ready {
            let made_s = message.at_ns as f64 * 1e-9;
            let mut start_ns = message.at_ns;
            let others_ns = self.others_ns(made_s);
            if start_ns > free_ns.saturating_add(GAP_NS) {
                // The line was idle; the others of its burst leave first.
                busy_since_ns = start_ns;
                start_ns += others_ns;
            }
            if let Some((begin_ns, lag_ns)) = self.lag(made_s) {
                start_ns = message.at_ns + lag_ns;
                busy_since_ns = busy_since_ns.min(begin_ns);
            }
            let start_ns = start_ns.max(free_ns);
            free_ns = start_ns + message.bytes * BYTE_NS;
            let busy_us = (start_ns - busy_since_ns + 999) / 1_000;
            events.push(Event {
                at: WorldPicos::from_nanos(start_ns),
                kind: with_busy(message.kind, busy_us.unsigned_abs()),
            });
        }
        events
    }

    /// For how long other messages leave first, in ns.
    fn others_ns(&self, at_s: f64) -> i64 {
        let ms: f64 = self
            .faults
            .iter()
            .map(|fault| match fault.kind {
                FaultKind::Queue { by_ms, edge_s } => by_ms * fault.share(at_s, edge_s),
                _ => 0.0,
            })
            .sum();
        (ms * NS_PER_MS) as i64
    }

    /// Since when the line is full, and by how much what is ready now leaves later, in
    /// ns.
    fn lag(&self, at_s: f64) -> Option<(i64, i64)> {
        let mut worst: Option<(f64, f64)> = None;
        for fault in self.faults_at(at_s) {
            if let FaultKind::Lag {
                peak_s,
                rise_s,
                fall_s,
            } = fault.kind
            {
                let rises = if rise_s > 0.0 {
                    (at_s - fault.from_s) / rise_s
                } else {
                    1.0
                };
                let falls = (fault.until_s - at_s) / fall_s;
                let lag_s = peak_s * rises.min(falls).clamp(0.0, 1.0);
                // Full since before the start: for longer than what it lags by.
                let begin_s = if rise_s > 0.0 {
                    fault.from_s
                } else {
                    fault.from_s - peak_s - 1.0
                };
                worst = Some(match worst {
                    Some((begin, lag)) => (begin_s.min(begin), lag_s.max(lag)),
                    None => (begin_s, lag_s),
                });
            }
        }
        worst.map(|(begin_s, lag_s)| ((begin_s * 1e9) as i64, (lag_s * 1e9) as i64))
    }
}

fn one_in(rng: &mut Rng, one_in: u32) -> bool {
    rng.u32(..).checked_rem(one_in) == Some(0)
}

/// The same message with how long the line had been busy.
const fn with_busy(mut kind: EventKind, us: u64) -> EventKind {
    if let EventKind::Mark { busy_us, .. }
    | EventKind::Mark60 { busy_us, .. }
    | EventKind::TimTp { busy_us, .. }
    | EventKind::TimeLs { busy_us, .. } = &mut kind
    {
        *busy_us = Some(us);
    }
    kind
}
