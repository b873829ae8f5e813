//! The receiver's messages of a schedule: NAV-PVT and TIM-TP.
//!
//! *Design.* Each message is made, is ready when the receiver has computed it, and
//! leaves when the line is free ([`queue`](super::queue)).

use fastrand::Rng;

use super::belief::Belief;
use super::queue::Ready;
use super::{FaultKind, PulseWord, QErrNonsense, RestartPulse, Schedule, TimTpLie};
use crate::chance::{Stream, even, normal, stream};
use crate::{Event, EventKind, PulseName};

const NS_PER_S: i64 = 1_000_000_000;
const NS_PER_MS: f64 = 1e6;
/// Bytes of the frames.
const NAV_PVT_BYTES: i64 = 100;
const TIM_TP_BYTES: i64 = 24;
/// TIM-TP that leaves by itself is made so late in its second, in ns.
const TIM_TP_ALONE_NS: i64 = 360_000_000;
/// How far TIM-TP's time of week is behind a whole second where it announces one that is none,
/// in ms.
const FRACTION_MS: i64 = 350;
/// The start of GPS weeks, in s since 1970.
const GPS_EPOCH_S: i64 = 315_964_800;
const WEEK_S: i64 = 604_800;

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
        let mut sent = 0_u32;
        let mut had_once = vec![false; self.faults.len()];
        for epoch_ns in (0..epochs).map(|number| number * period_ns) {
            let at_s = epoch_ns as f64 * 1e-9;
            let jitter_ms = self.jitter_ms(&mut rng);
            let is_lost = one_in(&mut rng, receiver.lost_one_in);
            let belief = self.belief(at_s);
            if belief.is_silent {
                sent = 0;
                continue;
            }
            let ready_ns = epoch_ns + ((self.floor_ms(at_s) + jitter_ms) * NS_PER_MS) as i64;
            if !is_lost {
                let label_ns = belief.label_ns + self.once_ns(at_s, sent, &mut had_once);
                sent += 1;
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
    fn once_ns(&self, at_s: f64, sent: u32, had_once: &mut [bool]) -> i64 {
        let mut ahead_ms = 0.0;
        for (fault, had) in self.faults.iter().zip(had_once) {
            match fault.kind {
                FaultKind::FirstMarks { marks, by_ms }
                    if fault.is_at(at_s) && sent < u32::from(marks) =>
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
}

fn one_in(rng: &mut Rng, one_in: u32) -> bool {
    rng.u32(..).checked_rem(one_in) == Some(0)
}
