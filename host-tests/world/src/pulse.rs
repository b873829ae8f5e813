//! The time pulse's wire: an edge at each second, and what is wrong with it.
//!
//! *Purpose.* What a board's input capture sees, true and false edges alike.
//!
//! *Design.* The true edges come from the receiver's own stream of chance
//! ([`PulseMaker`]) and the faults of the wire from another, so that faults change
//! nothing about them, and what [`Receiver`](crate::Receiver) forecasts is what
//! [`Pulses`] does. Those of [`Receiver::pulses`](crate::Receiver::pulses) are as wide as CFG-TP5
//! has made them.
//!
//! *Limits.* A new width is seen up to 3 s later: that far ahead are edges made. Faults begin and
//! end with a second. Edges are rounded to 1 ns.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use fastrand::Rng;

use crate::WorldNanos;
use crate::chance::{Stream, stream};
use crate::faults::PulseFaultKind;
use crate::pulse_maker::PulseMaker;
use crate::settings::{PulseSettings, ReceiverSettings};

const NS_PER_S: i64 = 1_000_000_000;

/// An edge on the pulse's wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// When it rises.
    pub edge: WorldNanos,
    /// When it falls again.
    pub end: WorldNanos,
    /// The second of UTC that it stands for, since 1970; `None` for an edge that
    /// stands for none: a bounce, a double, one at a wrong phase.
    pub utc_s: Option<i64>,
    /// By how much the receiver's clock made it late, in ps, as TIM-TP forecasts;
    /// negative if it is early.
    pub late_ps: i32,
}

/// How long pulses last. \[ns\]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Widths {
    pub(crate) unlocked_ns: u64,
    pub(crate) locked_ns: u64,
}

/// Where CFG-TP5 says how long pulses last, and the wire looks.
#[derive(Clone, Debug)]
pub(crate) struct PulsePort(Arc<Mutex<Widths>>);

impl PulsePort {
    pub(crate) fn new(settings: &PulseSettings) -> Self {
        Self(Arc::new(Mutex::new(Widths {
            unlocked_ns: settings.unlocked_width_ns,
            locked_ns: settings.width_ns,
        })))
    }

    pub(crate) fn set(&self, widths: Widths) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = widths;
    }

    fn widths(&self) -> Widths {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How long the wire is low at most between pulses that run into each other: 1 ms. \[ns\]
const DIP_NS: u64 = 1_000_000;

/// The phase at which a receiver without a time makes its pulses, if it makes any. \[ns\]
const UNLOCKED_PHASE_NS: i64 = 370_000_000;

/// The edges on the pulse's wire in their order, for ever or until it is cut for
/// ever.
#[derive(Clone, Debug)]
pub struct Pulses {
    maker: PulseMaker,
    rng: Rng,
    utc_at_start_ns: i64,
    settings: PulseSettings,
    port: PulsePort,
    /// Edges on their way, in their order.
    ahead: VecDeque<Pulse>,
    /// No edge of a second to come is before this.
    settled_ns: i64,
    is_cut: bool,
}

impl Pulses {
    /// The pulses of a receiver like this.
    #[must_use]
    pub fn new(settings: &ReceiverSettings) -> Self {
        Self::at(PulsePort::new(&settings.pulse), settings)
    }

    /// The same with the widths of `port`.
    pub(crate) fn at(port: PulsePort, settings: &ReceiverSettings) -> Self {
        Self {
            port,
            maker: PulseMaker::new(settings),
            rng: stream(settings.seed, Stream::PulseFaults),
            utc_at_start_ns: settings.utc_at_start_ns,
            settings: settings.pulse.clone(),
            ahead: VecDeque::new(),
            settled_ns: i64::MIN,
            is_cut: false,
        }
    }

    /// Brings the edges of the next second.
    fn add_second(&mut self) {
        let made = self.maker.make();
        let second_ns = made.utc_s * NS_PER_S - self.utc_at_start_ns;
        // The next second's may come half a second early.
        self.settled_ns = second_ns + NS_PER_S / 2;
        let Ok(at) = u64::try_from(second_ns).map(WorldNanos) else {
            return;
        };
        let widths = self.port.widths();
        if at < self.settings.from {
            if widths.unlocked_ns > 0 {
                self.add_edge(second_ns + UNLOCKED_PHASE_NS, None, 0, widths.unlocked_ns);
            }
            return;
        }
        let mut width_ns = widths.locked_ns;
        let mut edge_ns = made.edge_ns;
        let mut utc_s = Some(made.utc_s);
        let mut is_lost = false;
        let mut more_ns = Vec::new();
        for fault in &self.settings.faults {
            if !(fault.from..fault.until).contains(&at) {
                continue;
            }
            match fault.kind {
                PulseFaultKind::Cut => {
                    is_lost = true;
                    self.is_cut |= fault.until.0 == u64::MAX;
                }
                PulseFaultKind::Missing { one_in } => {
                    is_lost |= self.rng.u32(0..one_in.max(1)) == 0;
                }
                PulseFaultKind::Doubled { after_ns } => more_ns.push((after_ns, width_ns)),
                PulseFaultKind::Bouncing { edges, within_ns } => {
                    // It falls when it would have fallen.
                    more_ns.extend((0..edges).map(|_| {
                        let after_ns = self.rng.u64(0..within_ns.max(1)) + 1;
                        (after_ns, width_ns.saturating_sub(after_ns).max(1))
                    }));
                }
                PulseFaultKind::Inverted => {
                    edge_ns = edge_ns.saturating_add_unsigned(width_ns);
                    width_ns = NS_PER_S.cast_unsigned().saturating_sub(width_ns);
                    utc_s = None;
                }
                PulseFaultKind::Repeated { hz } => {
                    let period_ns = NS_PER_S.cast_unsigned() / u64::from(hz.max(1));
                    more_ns.extend((1..u64::from(hz)).map(|nth| (nth * period_ns, width_ns)));
                }
                PulseFaultKind::Width { width_ns: other_ns } => width_ns = other_ns,
                PulseFaultKind::WrongPhase { by_ns } => {
                    edge_ns += by_ns;
                    utc_s = None;
                }
            }
        }
        if is_lost {
            return;
        }
        self.add_edge(edge_ns, utc_s, made.late_ps, width_ns);
        for (after_ns, width_ns) in more_ns {
            let edge_ns = edge_ns.saturating_add_unsigned(after_ns);
            self.add_edge(edge_ns, None, 0, width_ns);
        }
    }

    fn add_edge(&mut self, edge_ns: i64, utc_s: Option<i64>, late_ps: i32, width_ns: u64) {
        let Ok(edge) = u64::try_from(edge_ns).map(WorldNanos) else {
            return;
        };
        let index = self.ahead.partition_point(|pulse| pulse.edge <= edge);
        self.ahead.insert(
            index,
            Pulse {
                edge,
                end: edge.plus(width_ns),
                utc_s,
                late_ps,
            },
        );
    }
}

impl Iterator for Pulses {
    type Item = Pulse;

    fn next(&mut self) -> Option<Pulse> {
        // The one behind has to be known, too: it may cut this one short.
        let is_settled = |pulse: &Pulse, until_ns: i64| (pulse.edge.0 as i64) < until_ns;
        while !self.is_cut
            && !self
                .ahead
                .get(1)
                .is_some_and(|p| is_settled(p, self.settled_ns))
        {
            self.add_second();
        }
        let mut pulse = self.ahead.pop_front()?;
        if let Some(behind) = self.ahead.front()
            && pulse.end >= behind.edge
        {
            let apart_ns = behind.edge.0 - pulse.edge.0;
            pulse.end = pulse.edge.plus(apart_ns - (apart_ns / 2).min(DIP_NS));
        }
        Some(pulse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::PulseFault;

    const NOON_NS: i64 = 1_795_348_800_000_000_000;
    const NOON_S: i64 = NOON_NS / NS_PER_S;
    const SECOND: u64 = 1_000_000_000;

    fn settings(pulse: PulseSettings) -> ReceiverSettings {
        ReceiverSettings {
            pulse,
            ..ReceiverSettings::new(NOON_NS)
        }
    }

    /// A fault from second 10 to second 20 and the pulses of the first 30 s.
    fn with_fault(kind: PulseFaultKind) -> Vec<Pulse> {
        let mut settings = settings(PulseSettings::m8());
        settings.pulse.faults.push(PulseFault {
            from: WorldNanos(10 * SECOND),
            until: WorldNanos(20 * SECOND),
            kind,
        });
        let end = WorldNanos(30 * SECOND - SECOND / 2);
        Pulses::new(&settings)
            .take_while(|p| p.edge < end)
            .collect()
    }

    #[test]
    fn a_steady_train_has_every_second_once() {
        let mut settings = settings(PulseSettings::m8());
        settings.utc_at_start_ns += 300_000_000;
        settings.pulse.from = WorldNanos(5 * SECOND);
        for (number, pulse) in Pulses::new(&settings).take(100).enumerate() {
            // The first second after 5 s from 0.3 s on is the 6th.
            assert_eq!(pulse.utc_s, Some(NOON_S + 6 + number as i64));
            assert!(
                pulse
                    .edge
                    .0
                    .abs_diff(5_700_000_000 + number as u64 * SECOND)
                    < 200
            );
            assert_eq!(pulse.end.0 - pulse.edge.0, 100_000_000);
        }
    }

    #[test]
    fn lost_pulses_leave_a_gap() {
        let seconds = |pulses: Vec<Pulse>| -> Vec<i64> {
            pulses.iter().map(|p| p.utc_s.unwrap() - NOON_S).collect()
        };
        let gap: Vec<i64> = (0..10).chain(20..30).collect();
        // The very first may come before the world's start, and then is not there.
        let all = seconds(with_fault(PulseFaultKind::Cut));
        assert!(all == gap || all == gap[1..], "{all:?}");
        let every = seconds(with_fault(PulseFaultKind::Missing { one_in: 1 }));
        assert_eq!(every, all);
        let some = seconds(with_fault(PulseFaultKind::Missing { one_in: 2 }));
        assert!(some.len() > all.len() && some.len() < all.len() + 10);

        let mut forever = settings(PulseSettings::m8());
        forever.pulse.faults.push(PulseFault {
            from: WorldNanos(10 * SECOND),
            until: WorldNanos(u64::MAX),
            kind: PulseFaultKind::Cut,
        });
        assert_eq!(
            Pulses::new(&forever).last().unwrap().utc_s,
            Some(NOON_S + 9)
        );
    }

    #[test]
    fn false_edges_come_between_the_true_ones_and_change_none() {
        let healthy = with_fault(PulseFaultKind::Missing { one_in: u32::MAX });
        for (kind, false_edges, within_ns) in [
            (PulseFaultKind::Doubled { after_ns: 30_000 }, 1, 30_000),
            (
                PulseFaultKind::Doubled {
                    after_ns: 700_000_000,
                },
                1,
                700_000_000,
            ),
            (
                PulseFaultKind::Bouncing {
                    edges: 3,
                    within_ns: 50_000,
                },
                3,
                50_000,
            ),
        ] {
            let pulses = with_fault(kind);
            assert!(pulses.is_sorted_by(|one, next| one.end <= next.edge));
            let (kept, extra): (Vec<&Pulse>, Vec<&Pulse>) =
                pulses.iter().partition(|p| p.utc_s.is_some());
            assert_eq!(extra.len(), 10 * false_edges);
            for (is, was) in kept.iter().zip(&healthy) {
                assert_eq!(
                    (is.edge, is.utc_s, is.late_ps),
                    (was.edge, was.utc_s, was.late_ps)
                );
            }
            for edge in extra {
                let behind = edge.edge.0 % SECOND;
                assert!(behind <= within_ns + 200 && (10..=20).contains(&(edge.edge.0 / SECOND)));
            }
        }
    }

    #[test]
    fn an_inverted_pulse_falls_where_it_should_rise() {
        let pulses = with_fault(PulseFaultKind::Inverted);
        let inverted: Vec<&Pulse> = pulses.iter().filter(|p| p.utc_s.is_none()).collect();
        assert_eq!(inverted.len(), 10);
        for is in inverted {
            assert!((is.edge.0 % SECOND).abs_diff(100_000_000) < 300);
            assert!((is.end.0 - is.edge.0).abs_diff(900_000_000) < 1_000_300);
            let phase_ns = is.end.0 % SECOND;
            assert!(!(300..SECOND - 1_000_300).contains(&phase_ns));
        }
    }

    #[test]
    fn a_repeated_pulse_has_its_second_and_others() {
        let pulses = with_fault(PulseFaultKind::Repeated { hz: 10 });
        let extra = pulses.iter().filter(|p| p.utc_s.is_none()).count();
        assert_eq!(extra, 9 * 10);
        let in_it = pulses.iter().filter(|p| p.edge.0 / SECOND == 15);
        let phases: Vec<u64> = in_it.map(|p| (p.edge.0 % SECOND + 500) / 1_000).collect();
        let even = phases.windows(2).all(|pair| pair[1] - pair[0] == 100_000);
        assert!(even && phases.len() >= 9, "{phases:?}");
        let wide = with_fault(PulseFaultKind::Width {
            width_ns: 37_000_000,
        });
        let narrow = wide.iter().filter(|p| p.end.0 - p.edge.0 == 37_000_000);
        assert_eq!(narrow.count(), 10);
    }

    #[test]
    fn without_a_time_it_comes_at_another_phase_or_not_at_all() {
        let mut settings = settings(PulseSettings::m8());
        settings.pulse.from = WorldNanos(10 * SECOND);
        assert!(Pulses::new(&settings).next().unwrap().edge.0 > 9 * SECOND);
        settings.pulse.unlocked_width_ns = 50_000_000;
        let first: Vec<Pulse> = Pulses::new(&settings).take(9).collect();
        for pulse in first {
            assert_eq!((pulse.edge.0 % SECOND, pulse.utc_s), (370_000_000, None));
            assert_eq!(pulse.end.0 - pulse.edge.0, 50_000_000);
        }
    }

    #[test]
    fn a_wrong_phase_is_off_by_what_was_asked() {
        let healthy = with_fault(PulseFaultKind::Missing { one_in: u32::MAX });
        for by_ns in [-400_000_000, 250_000, 400_000_000] {
            let pulses = with_fault(PulseFaultKind::WrongPhase { by_ns });
            let wrong: Vec<&Pulse> = pulses.iter().filter(|p| p.utc_s.is_none()).collect();
            assert_eq!(wrong.len(), 10);
            for (is, was) in pulses.iter().zip(&healthy) {
                let off_ns = is.edge.0 as i64 - was.edge.0 as i64;
                assert_eq!(off_ns, if is.utc_s.is_some() { 0 } else { by_ns });
            }
        }
    }
}
