//! What the receiver of a schedule believes at a moment.

use super::{FaultKind, LEAP_COUNT, RestartLie, RestartPulse, Schedule};

const NS_PER_S: i64 = 1_000_000_000;
const DAY_S: i64 = 86_400;

/// What the receiver believes at a moment.
pub(super) struct Belief {
    pub(super) is_silent: bool,
    /// Its labels are ahead, in ns.
    pub(super) label_ns: i64,
    /// TIM-TP's name for the pulse is ahead, in s.
    pub(super) name_s: i64,
    pub(super) valid: u8,
    pub(super) t_acc_ns: u32,
    pub(super) leap_source: u8,
    pub(super) leap_count: i8,
    pub(super) is_leap_early: bool,
    /// TIM-TP's flags.
    pub(super) flags: u8,
}

impl Schedule {
    /// What the receiver believes at a moment.
    pub(super) fn belief(&self, at_s: f64) -> Belief {
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
}
