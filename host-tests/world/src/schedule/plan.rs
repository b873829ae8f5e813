//! A flight's receiver, crystal and faults, as values.

use super::fault::{Fault, FaultKind};

/// A flight with its faults.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// Where its chance comes from.
    pub seed: u64,
    /// How long it lasts, in s.
    pub lasts_s: f64,
    /// True UTC at its start, in ns since 1970; a whole second.
    pub start_utc_ns: i64,
    /// The first moment of a leap second, which has long been announced: a whole second,
    /// at the end of a day of UTC.
    pub leap_at_s: Option<f64>,
    /// The receiver.
    pub receiver: FieldReceiver,
    /// The board's crystal: points of time in s and how fast it is there in ppm, linear
    /// between.
    pub crystal: Vec<(f64, f64)>,
    /// What goes wrong.
    pub faults: Vec<Fault>,
}

/// A receiver and its wiring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldReceiver {
    /// From solution to solution, in ms.
    pub period_ms: i64,
    /// The least latency of its messages, in ms.
    pub floor_ms: f64,
    /// How much later they usually are: the standard deviation of half a bell curve,
    /// in ms.
    pub jitter_ms: f64,
    /// Messages for each one that is late by some 15 ms more, by chance; 0 is none late.
    pub late_one_in: u32,
    /// Solutions for each one that is lost, by chance; 0 is none lost.
    pub lost_one_in: u32,
    /// TIM-TP leaves right behind the second's NAV-PVT; else by itself later.
    pub is_tim_tp_behind: bool,
    /// The pulse is wired.
    pub has_pulse: bool,
    /// How far its edges are off beside what TIM-TP says, root of the mean square, in
    /// ns.
    pub pulse_noise_ns: f64,
    /// How wide it was asked to make its pulse, in ms.
    pub width_ms: f64,
    /// tAcc, in ns.
    pub t_acc_ns: u32,
    /// Until then it has no time after its start, in s.
    pub valid_from_s: f64,
    /// Where its leap count comes from, as NAV-TIMELS has it.
    pub leap_source: u8,
    /// It counts to the end of second 60, not to its start.
    pub is_event_late: bool,
}

impl Schedule {
    /// The least latency of messages made at a moment, in ms.
    #[must_use]
    pub fn floor_ms(&self, at_s: f64) -> f64 {
        let moved: f64 = self
            .faults
            .iter()
            .map(|fault| match fault.kind {
                FaultKind::FloorStep { by_ms } if fault.is_at(at_s) => by_ms,
                FaultKind::OtherReceiver { floor_by_ms, .. } if fault.is_at(at_s) => floor_by_ms,
                FaultKind::FloorRamp { by_ms, edge_s } => by_ms * fault.share(at_s, edge_s),
                FaultKind::FloorBreathe { by_ms, period_s } if fault.is_at(at_s) => {
                    let turns = (at_s - fault.from_s) / period_s;
                    by_ms * (turns * std::f64::consts::TAU).sin()
                }
                _ => 0.0,
            })
            .sum();
        // No receiver sends an epoch before it is over.
        (self.receiver.floor_ms + moved).max(MIN_FLOOR_MS)
    }

    /// Whether the leap second is over at a moment.
    pub(super) fn is_after_leap(&self, at_s: f64) -> bool {
        self.leap_at_s.is_some_and(|leap_s| leap_s + 1.0 <= at_s)
    }

    /// True UTC at a moment, in ns since 1970; in second 60 as in the second after it.
    pub(super) fn utc_ns(&self, at_ns: i64) -> i64 {
        let leapt_ns = i64::from(self.is_after_leap(at_ns as f64 * 1e-9)) * 1_000_000_000;
        self.start_utc_ns + at_ns - leapt_ns
    }

    /// The faults that are there at a moment.
    pub(super) fn faults_at(&self, at_s: f64) -> impl Iterator<Item = &Fault> {
        self.faults.iter().filter(move |fault| fault.is_at(at_s))
    }
}

/// No floor is below this, in ms.
pub(super) const MIN_FLOOR_MS: f64 = 5.0;
