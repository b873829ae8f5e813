//! Edges of the pulse's wire: which of them the clock follows, and by how much it is off.

use timebase::{CORE_HZ, Cycles, Polarity, PulseEdge};

use super::course::{Course, FollowedPulse, Observation};
use super::followed::{
    Followed, OUTLASTS_HOLDOVER_S, PULSE_LASTS_NS, SAME_TRAIN_NS, crystal_uncertainty_ppb,
};
use super::{Discipline, LATENCIES_NS, NUMBERED_NS};
use crate::crystal_watch::CrystalWatch;
use crate::float::float;
use crate::refusal::PulseRefusal;
use crate::track::nearest_second;
use crate::train::{CrystalKnown, EdgeVerdict};

/// Half of the way from the least to the greatest. \[ns\]
const MIDDLE_LATENCY_NS: i64 = 200_000_000;

/// An error is absorbed in so many ms, as far as the bound of the slew allows.
const ABSORB_MS: u32 = 250;

/// A proved pulse is believed for as long as it takes to slew what is not stepped. \[cycles\] 20 s
const LONGEST_SLEW: u64 = 20 * CORE_HZ as u64;

impl Discipline {
    /// Takes an edge of the pulse's wire; `None` where it waits for others.
    ///
    /// # Errors
    /// Why it is to be ignored.
    #[inline]
    pub fn handle_edge(
        &mut self,
        edge: &PulseEdge,
        observe: impl Fn(Cycles) -> Observation,
    ) -> Result<Option<FollowedPulse>, PulseRefusal> {
        if edge.polarity == Polarity::Rise
            && let Some(followed) = &mut self.followed
        {
            followed.note_rise(edge.at.as_nanos());
        }
        let followed = self.followed.as_ref();
        let (crystal_ppb, uncertainty_ppb) = (self.crystal_ppb, self.crystal_uncertainty_ppb);
        let known = || CrystalKnown {
            crystal_ppb,
            uncertainty_ppb: crystal_uncertainty_ppb(followed, uncertainty_ppb, edge.at),
        };
        let (train, since_ns, rise, rise_ns) = match self.trains.handle_edge(edge, known) {
            EdgeVerdict::Noted => return Ok(None),
            EdgeVerdict::Refused(refusal) => return Err(refusal),
            EdgeVerdict::Proved {
                train,
                since_ns,
                rise,
                rise_ns,
            } => (train, since_ns, rise, rise_ns),
        };
        if self.crystal_watch.is_beyond() {
            self.crystal_watch = CrystalWatch::new();
        }
        let Some(track) = self.trains.track(train) else {
            return Err(PulseRefusal::Unnumbered);
        };
        let observed = observe(rise);
        let Some(clock_uncertainty_ns) = observed.uncertainty_ns else {
            return Err(PulseRefusal::Unnumbered);
        };
        let edge_ns = track.edge_ns();
        let steady_s = || float(edge_ns.wrapping_sub(since_ns).cast_signed()) * 1e-9;
        let (is_new, second_ns) = match &self.followed {
            Some(followed) => {
                let since_ns = edge_ns.wrapping_sub(followed.track.edge_ns()).cast_signed();
                if followed.train == train && since_ns < PULSE_LASTS_NS {
                    // No crystal is half a second off in so short a time.
                    let seconds_ns = nearest_second(since_ns);
                    (false, followed.second_ns.saturating_add(seconds_ns))
                } else {
                    let elapsed_ns = followed.track.elapsed_ns(edge_ns);
                    let seconds_ns = nearest_second(elapsed_ns);
                    let off_ns = float(elapsed_ns.saturating_sub(seconds_ns));
                    let door_ns = followed.track.uncertainty_ns(edge_ns) + SAME_TRAIN_NS;
                    let is_same_phase = off_ns.abs() <= door_ns;
                    if !is_same_phase {
                        followed.may_replace(track, edge_ns, steady_s())?;
                    }
                    let second_ns = followed.second_ns.saturating_add(seconds_ns);
                    (!is_same_phase, second_ns)
                }
            }
            None => {
                let shown_ns = observed.published.0.saturating_add(self.shift_ns);
                let middle_ns = if self.is_latency_learnt {
                    0
                } else {
                    MIDDLE_LATENCY_NS - self.latency_ns
                };
                let second_ns = nearest_second(shown_ns.saturating_add(middle_ns));
                let latency_ns = second_ns.saturating_sub(shown_ns) + self.latency_ns;
                if clock_uncertainty_ns > NUMBERED_NS || !LATENCIES_NS.contains(&latency_ns) {
                    return Err(PulseRefusal::OffSecond);
                }
                let apart_ppb = (track.crystal_ppb() - self.crystal_ppb).abs();
                let is_other_crystal = apart_ppb > 2.0 * self.crystal_uncertainty_ppb;
                if is_other_crystal && steady_s() < OUTLASTS_HOLDOVER_S {
                    return Err(PulseRefusal::OffLine);
                }
                self.is_latency_learnt = false;
                (true, second_ns)
            }
        };
        self.crystal_ppb = track.crystal_ppb();
        let turned_ppb;
        (self.crystal_uncertainty_ppb, turned_ppb) = track.frequency_uncertainties_ppb();
        self.followed = Some(Followed {
            track: *track,
            train,
            second_ns,
            seen_ns: edge_ns,
        });
        // Its track was moved to this pulse, and between that and its rise are some ns.
        let uncertainty_ns = track.phase_uncertainty_ns();
        let error_ns = second_ns
            .saturating_add(track.elapsed_ns(rise_ns))
            .saturating_sub(self.shift_ns)
            .saturating_sub(observed.published.0);
        // What the filters claim by the next pulse; more than that hides no turn.
        let claimed_ns = (uncertainty_ns + self.crystal_uncertainty_ppb) as u32;
        let hidden_ns = self.hidden_turn_ns.saturating_sub(claimed_ns);
        let course = Course {
            latency_uncertainty_ns: self.pulse_uncertainty_ns.saturating_add(hidden_ns),
            turned_ppb,
            absorb_ms: ABSORB_MS,
            longest_slew: LONGEST_SLEW,
            ..self.course(rise, error_ns, uncertainty_ns)
        };
        Ok(Some(FollowedPulse {
            observed,
            is_new,
            course,
        }))
    }
}
