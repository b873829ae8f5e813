//! The pulse's wire of a schedule.
//!
//! *Design.* Each second has its highs, each from a rise to a fall; the fault that
//! began last says where they are. What overlaps is one high, as on a wire.

use fastrand::Rng;

use super::{FaultKind, RestartPulse, Schedule};
use crate::chance::{Stream, even, normal, stream};
use crate::{Event, EventKind, WorldPicos};

/// Half a tick of an M8's clock: edges are late by up to that, either way, in ps.
const HALF_TICK_PS: i32 = 10_400;
/// How far falls are off, root of the mean square, in ns.
const FALL_NOISE_NS: f64 = 30.0;
/// A pulse of several a second is at most so wide, as a share of its period.
const MOST_DUTY: f64 = 0.5;

/// A span in which the wire is high, in s.
type High = (f64, f64);

impl Schedule {
    /// What the board sees, in the order of its time.
    #[must_use]
    pub fn events(&self) -> Vec<Event> {
        let seconds = self.lasts_s as usize + 2;
        let mut rng = stream(self.seed, Stream::ScheduleWire);
        let late_ps: Vec<i32> = (0..seconds)
            .map(|_| rng.i32(-HALF_TICK_PS..=HALF_TICK_PS))
            .collect();
        let mut events = self.messages(&late_ps);
        if self.receiver.has_pulse {
            events.extend(self.edges(&mut rng, &late_ps));
        }
        events.retain(|event| event.at.as_secs() < self.lasts_s);
        events.sort_by_key(|event| event.at);
        events
    }

    fn edges(&self, rng: &mut Rng, late_ps: &[i32]) -> Vec<Event> {
        let mut highs: Vec<High> = Vec::new();
        for (second, late_ps) in late_ps.iter().enumerate().skip(1) {
            // Drawn always, so that a fault changes its own pulses alone.
            let noise = normal(rng) * self.receiver.pulse_noise_ns * 1e-9;
            let wide = normal(rng) * FALL_NOISE_NS * 1e-9;
            let chance = [even(rng), even(rng)];
            let jitter_s = noise + f64::from(*late_ps) * 1e-12;
            for (rise, fall) in self.highs_of(second as f64, chance) {
                highs.push((rise + jitter_s, fall + jitter_s + wide));
            }
        }
        highs.sort_by(|one, next| one.0.total_cmp(&next.0));
        let mut merged: Vec<High> = Vec::new();
        for high in highs.into_iter().filter(|high| high.1 > high.0) {
            match merged.last_mut() {
                Some(last) if high.0 <= last.1 => last.1 = last.1.max(high.1),
                _ => merged.push(high),
            }
        }
        let edge = |at_s: f64, kind| Event {
            at: WorldPicos::from_secs(at_s),
            kind,
        };
        merged
            .iter()
            .flat_map(|&(rise, fall)| [edge(rise, EventKind::Rise), edge(fall, EventKind::Fall)])
            .collect()
    }

    /// The highs that begin in a second, in s, before the receiver's own noise.
    fn highs_of(&self, second: f64, chance: [f64; 2]) -> Vec<High> {
        let width = self.receiver.width_ms * 1e-3;
        let mut at = second;
        let mut by_restart = RestartPulse::GoesOn;
        let mut shaper = None;
        for fault in self.faults_at(second) {
            match fault.kind {
                FaultKind::OtherReceiver { pulse_by_ns, .. } => at += pulse_by_ns * 1e-9,
                FaultKind::Restart { pulse, .. } => by_restart = pulse,
                kind if kind.shapes_pulse() => shaper = Some((fault.from_s, kind)),
                _ => {}
            }
        }
        if second < self.receiver.valid_from_s {
            by_restart = RestartPulse::Silent;
        }
        match by_restart {
            // Another device does not care.
            _ if matches!(
                shaper,
                Some((_, FaultKind::PulseSwap { .. } | FaultKind::PulseCut))
            ) => {}
            RestartPulse::Silent => return Vec::new(),
            RestartPulse::RunsFreely(phase_ms) => {
                at += phase_ms * 1e-3;
                return vec![(at, at + width)];
            }
            RestartPulse::GoesOn => {}
        }
        let one = |rise: f64, width: f64| vec![(rise, rise + width)];
        let Some((from_s, kind)) = shaper else {
            return one(at, width);
        };
        let since_s = second - from_s;
        match kind {
            FaultKind::PulseFreeRun { phase_ms, ppm, .. } => {
                one(at + phase_ms * 1e-3 + since_s * ppm * 1e-6, width)
            }
            FaultKind::PulseDragged { ppb } => one(at + since_s * ppb * 1e-9, width),
            FaultKind::PulseShifted { phase_ms } => one(at + phase_ms * 1e-3, width),
            FaultKind::PulseDoubled { after_ms, width_ms } => {
                let second = at + after_ms * 1e-3;
                vec![(at, at + width), (second, second + width_ms * 1e-3)]
            }
            FaultKind::PulseRate { hz, .. } => {
                let every = 1.0 / f64::from(hz);
                let width = width.min(every * MOST_DUTY);
                (0..hz)
                    .map(|number| at + f64::from(number) * every)
                    .map(|rise| (rise, rise + width))
                    .collect()
            }
            FaultKind::PulseInverted => one(at + width, 1.0 - width),
            FaultKind::PulseWidth { width_ms } => one(at, width_ms * 1e-3),
            FaultKind::PulseSwap {
                phase_ms,
                ppm,
                width_ms,
            } => one(
                second + phase_ms * 1e-3 + since_s * ppm * 1e-6,
                width_ms * 1e-3,
            ),
            FaultKind::PulseCut => Vec::new(),
            FaultKind::PulseMissing { one_in } if chance[0] * f64::from(one_in) < 1.0 => Vec::new(),
            FaultKind::PulseOdd { one_in } if chance[0] * f64::from(one_in) < 1.0 => {
                one(at + chance[1] * (1.0 - width), width)
            }
            _ => one(at, width),
        }
    }
}
