//! When nothing is wrong, and has not been for long enough.
//!
//! *Design.* Each fault is wrong over a span; a clock has some time after it to be
//! right again, more without a pulse. With a pulse a floor that moves is no excuse;
//! without one it is, while it moves and for a while after.

use super::{FaultKind, RestartLie, Schedule};

/// After what was wrong, with a pulse, in s.
const AFTER_WITH_PULSE_S: f64 = 75.0;
/// And without, in s.
const AFTER_WITHOUT_PULSE_S: f64 = 200.0;
/// After the floor moved, without a pulse, in s.
const AFTER_FLOOR_S: f64 = 300.0;
/// The count is known with the next poll's answer, at most so much later, in s.
const POLL_S: f64 = 11.0;

/// The spans in which something is wrong.
#[derive(Clone, Debug)]
pub struct Calm {
    /// From, until, and how long after that a clock is excused, in s.
    wrong: Vec<(f64, f64, f64)>,
}

impl Calm {
    /// Whether nothing is wrong, and has not been for so long that a clock has no
    /// excuse.
    #[must_use]
    pub fn has(&self, at_s: f64) -> bool {
        self.wrong
            .iter()
            .all(|(from, until, after)| !(*from..*until + *after).contains(&at_s))
    }

    /// Whether nothing has been wrong for so long, in s.
    #[must_use]
    pub fn has_been_for(&self, at_s: f64, for_s: f64) -> bool {
        self.wrong
            .iter()
            .all(|(from, until, _)| !(*from..*until + for_s).contains(&at_s))
    }
}

impl Schedule {
    /// When nothing is wrong.
    #[must_use]
    pub fn calm(&self) -> Calm {
        let receiver = &self.receiver;
        let after = if receiver.has_pulse {
            AFTER_WITH_PULSE_S
        } else {
            AFTER_WITHOUT_PULSE_S
        };
        // Before the start, and until the receiver knows the time and has been asked
        // for its leap count.
        let known_s = if receiver.valid_from_s > 0.0 {
            receiver.valid_from_s + POLL_S
        } else {
            0.0
        };
        let mut wrong = vec![(f64::NEG_INFINITY, known_s, after)];
        if let Some(leap_s) = self.leap_at_s {
            // The second itself may be ambiguous, and the one in which it is noticed.
            wrong.push((leap_s, leap_s + 2.0, 0.0));
        }
        for fault in &self.faults {
            let (from, until) = (fault.from_s, fault.until_s);
            match fault.kind {
                FaultKind::FloorStep { .. }
                | FaultKind::FloorRamp { .. }
                | FaultKind::FloorBreathe { .. }
                    if receiver.has_pulse => {}
                FaultKind::FloorStep { .. } => {
                    wrong.extend([from, until].map(|at| (at, at, AFTER_FLOOR_S)));
                }
                FaultKind::FloorRamp { edge_s, .. } => wrong.extend([
                    (from, from + edge_s, AFTER_FLOOR_S),
                    (until - edge_s, until, AFTER_FLOOR_S),
                ]),
                FaultKind::FloorBreathe { .. } => wrong.push((from, until, AFTER_FLOOR_S)),
                // Only the switch is wrong, not what it switches to.
                FaultKind::OtherReceiver { .. } => {
                    let after = if receiver.has_pulse {
                        after
                    } else {
                        AFTER_FLOOR_S
                    };
                    wrong.extend([from, until].map(|at| (at, at, after)));
                }
                FaultKind::LeapUnresolved { .. } => wrong.push((from, until + POLL_S, after)),
                FaultKind::Restart { lie, .. } => {
                    let known = if lie == RestartLie::Nothing {
                        until
                    } else {
                        until + POLL_S
                    };
                    wrong.push((from, known, after));
                }
                _ => wrong.push((from, until, after)),
            }
        }
        Calm { wrong }
    }
}
