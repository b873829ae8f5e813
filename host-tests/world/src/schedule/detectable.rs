//! What the evidence on a board can show.

use super::plan::MIN_FLOOR_MS;
use super::{Fault, FaultKind, RestartLie, Schedule, TimTpLie};

/// Floors stay below this, in ms: what a clock without a pulse has to allow for.
const MOST_FLOOR_MS: f64 = 145.0;
/// A stretch without anything that keeps a clock from being set, in s.
const SETTLED_S: f64 = 30.0;
/// A pulse was followed for so long before it shifts, in s.
const FOLLOWED_S: f64 = 30.0;
/// Around a leap second no count and no label is wrong, in s.
const EVENT_ALONE_S: f64 = 130.0;
/// A receiver that says nothing for so long has started anew, in s.
const SEEN_SILENCE_S: f64 = 5.0;

impl Schedule {
    /// Whether the evidence on the board is enough to detect each fault.
    ///
    /// - Labels that are wrong, with nothing else to say against them, need a clock that
    ///   has been set by right ones. So does a shifted pulse that TIM-TP confirms; that
    ///   one needs a clock that followed the pulse right before, or its phase is as good
    ///   as any.
    /// - A pulse that leaves its second as slowly as a crystal moves is detected by TIM-TP's
    ///   word, or by its absence: no lag and no silence may be the reason for that.
    /// - Wrong labels stand for less than 300 s: after that they are the reason to start
    ///   anew.
    /// - Restarts do not overlap, and one with another leap count shows: it is silent for 5 s,
    ///   or the clock has been set.
    /// - A leap second is detected by the count alone: around it, no label and no count is wrong.
    /// - The floor stays between 5 and 145 ms.
    #[must_use]
    pub fn is_detectable(&self) -> bool {
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
            .all(|floor_ms| (MIN_FLOOR_MS + 1e-9..MOST_FLOOR_MS).contains(&floor_ms))
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

    /// When the first stretch of `for_s` seconds begins in which nothing keeps a clock from
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
