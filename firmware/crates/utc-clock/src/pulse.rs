//! The pulse's estimator: which second it marks, and how the crystal stands to it.
//!
//! *Purpose.* The time pulse has no name, only an edge, good to tens of ns. The clock
//! names it; this judges whether it is the pulse that it ought to be, and follows
//! it.
//!
//! *Design.* As in the [`envelope`](crate::envelope), on the board's own counter: a
//! pulse is that counter's time less the second it marks, its *lateness*, and a
//! crystal makes a line of those. Two Kalman filters (`crate::kalman`) follow the line side by
//! side: one believes in drift, as a changing temperature makes it, one does
//! not and is quieter. The quiet one is asked unless the mean of its innovations says that
//! it lags.
//!
//! A pulse is a candidate when it comes at a plausible time after the messages: a
//! latency that is none, or longer than any receiver's, is a pulse of something
//! else. [`CONFIRMING`] of them in a row, each within the gate of what those before
//! predict, are a pulse to follow; from then on anything outside of the gate is refused. When
//! nothing has passed for [`LOST_AFTER_S`], the search begins anew; the old line stays until
//! a new one is confirmed.
//!
//! *Limits.* One pulse a second, on the second. A pulse that is off by less than the
//! plausible latencies differ, before any latency was learnt, is taken for good: nothing on the
//! board could tell.

use crate::holdover::{CRYSTAL_PPB, DRIFT_PPB_PER_S};
use crate::kalman::{Kalman, Noise};
use crate::refusal::PulseRefusal;

/// So many pulses in a row have to fit each other before they are followed.
pub const CONFIRMING: u8 = 5;

/// Without a pulse that fits for so long, in s, the pulse is lost.
pub const LOST_AFTER_S: f32 = 10.0;

/// A pulse is refused when it is farther from its prediction than so many standard deviations,
const GATE_SIGMAS: f32 = 6.0;
/// and than so many ns: a few of the M8's 60 ns (99 %, u-blox M8 data sheets, time pulse accuracy).
const GATE_NS: f32 = 250.0;

/// 30 ns RMS for an M8's pulse (u-blox M8 data sheets), and the capture's own step of 11.9 ns.
const MEASUREMENT: f32 = 30.0 * 30.0 + 11.9 * 11.9 / 12.0;

/// A crystal at constant temperature.
const QUIET: Noise = Noise {
    phase_walk: 25.0,
    frequency_walk: 0.5,
    drift_variance: 0.0,
    drift_time_s: 300.0,
    measurement: MEASUREMENT,
};

/// A crystal whose temperature moves: 1 ppm a minute is 16.7 ppb a second.
const RAMPING: Noise = Noise {
    drift_variance: 8.0 * 8.0,
    ..QUIET
};

/// The quiet filter's innovations are averaged over so many pulses.
const BIAS_OVER: f32 = 8.0;
/// It lags when their mean is above so many standard deviations of one; white ones have 0.26.
const BIASED: f32 = 0.9;
/// It does not lag any more when their mean is below.
const UNBIASED: f32 = 0.5;

/// For so many pulses the quiet filter is not asked after it has lagged: while a ramp turns
/// round, the mean passes through 0.
const LAGS_FOR: u8 = 20;

/// The uncertainty, in standard deviations.
const UNCERTAINTY_SIGMAS: f32 = 2.55;

/// What a pulse says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PulseEstimate {
    /// UTC at the edge by the line, in ns: the second, but for the pulse's own noise.
    pub utc_ns: i64,
    /// By how much the crystal is fast, in ppb.
    pub crystal_ppb: f32,
    /// How far the line may be from the truth, in ns.
    pub uncertainty_ns: f32,
    /// How far the frequency may be off, in ppb.
    pub frequency_uncertainty_ppb: f32,
}

/// What became of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PulseVerdict {
    /// It fits; others have to, too, before they are followed.
    Candidate,
    /// It is followed.
    Followed(PulseEstimate),
    /// It is not.
    Refused(PulseRefusal),
}

/// The pulses' lines.
#[derive(Clone, Debug)]
pub struct Pulse {
    followed: Option<PulseTrack>,
    /// Grows beside a line that is lost, and replaces it when it is confirmed.
    candidate: Option<PulseTrack>,
}

#[derive(Clone, Copy, Debug)]
struct PulseTrack {
    quiet: Kalman,
    ramping: Kalman,
    /// The quiet filter has lagged so many pulses ago that it is not asked for so many more.
    lags_for: u8,
    bias: f32,
    /// The pulse that fitted last: its edge by the board's counter and its second, in ns;
    /// the filters' phases are relative to its lateness.
    edge_ns: u64,
    second_ns: i64,
    fitted: u8,
}

/// A pulse, numbered by somebody.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NumberedEdge {
    /// The edge by the board's counter, in ns since boot.
    pub at_ns: u64,
    /// UTC by the messages, in ns.
    pub told_ns: i64,
    /// By how much UTC may be later than the messages say, in ns, at least and at most: the
    /// latencies that are plausible, beyond the one that is corrected.
    pub plausible_ns: (i64, i64),
}

const SECOND_NS: i64 = 1_000_000_000;

impl Pulse {
    /// A pulse that nobody has heard yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            followed: None,
            candidate: None,
        }
    }

    /// Whether pulses are being followed.
    #[must_use]
    pub const fn is_followed(&self) -> bool {
        self.followed.is_some()
    }

    /// Whether a pulse has fitted of late, and was followed.
    #[must_use]
    pub fn is_alive(&self, at_ns: u64) -> bool {
        self.followed
            .as_ref()
            .is_some_and(|line| elapsed_s(at_ns, line.edge_ns) <= LOST_AFTER_S)
    }

    /// UTC by the line at a time of the board's counter, with how far it may be off; both in ns.
    /// `None` while nothing is followed.
    #[must_use]
    pub fn utc_at(&self, at_ns: u64) -> Option<(i64, f32)> {
        let line = self.followed.as_ref()?;
        let filter = line.filter();
        let since_ns = at_ns.wrapping_sub(line.edge_ns).cast_signed();
        let since_s = since_ns as f32 * 1e-9;
        let ahead_ns = filter.phase_ns + filter.frequency_ppb * since_s;
        let utc_ns = line
            .second_ns
            .saturating_add(since_ns)
            .saturating_sub(ahead_ns as i64);
        let uncertainty_ns = UNCERTAINTY_SIGMAS
            * (filter.phase_deviation_ns() + filter.frequency_deviation_ppb() * since_s.abs())
            + 0.5 * DRIFT_PPB_PER_S * since_s * since_s;
        Some((utc_ns, uncertainty_ns))
    }

    /// Gives the seconds other numbers, `by_ns` more: the clock has stepped.
    pub fn renumber(&mut self, by_ns: i64) {
        for line in [&mut self.followed, &mut self.candidate]
            .into_iter()
            .flatten()
        {
            line.second_ns = line.second_ns.saturating_add(by_ns);
        }
    }

    /// Forgets the pulse: the messages contradict it.
    pub const fn forget(&mut self) {
        self.followed = None;
        self.candidate = None;
    }

    /// Hears a pulse; the crystal's frequency is known from elsewhere, to `uncertainty_ppb`.
    pub fn update(
        &mut self,
        edge: &NumberedEdge,
        crystal_ppb: f32,
        uncertainty_ppb: f32,
    ) -> PulseVerdict {
        if let Some(line) = &mut self.followed
            && elapsed_s(edge.at_ns, line.edge_ns) <= LOST_AFTER_S
        {
            return line.update(edge);
        }
        if let Some(line) = &mut self.candidate
            && elapsed_s(edge.at_ns, line.edge_ns) <= LOST_AFTER_S
        {
            let heard = line.update(edge);
            if matches!(heard, PulseVerdict::Followed(_)) {
                self.followed = self.candidate.take();
            }
            // What bounces behind a candidate says nothing against it.
            if heard != PulseVerdict::Refused(PulseRefusal::OffLine) {
                return heard;
            }
        }
        // The second that it marks, if it comes with a plausible latency.
        let (least_ns, greatest_ns) = edge.plausible_ns;
        let middle_ns = least_ns.midpoint(greatest_ns);
        let second_ns = nearest_second(edge.told_ns.saturating_add(middle_ns));
        let latency_ns = second_ns.saturating_sub(edge.told_ns);
        if !(least_ns..=greatest_ns).contains(&latency_ns) {
            return PulseVerdict::Refused(PulseRefusal::OffSecond);
        }
        self.candidate = Some(PulseTrack {
            quiet: Kalman::new(QUIET, crystal_ppb, uncertainty_ppb),
            ramping: Kalman::new(RAMPING, crystal_ppb, uncertainty_ppb),
            lags_for: 0,
            bias: 0.0,
            edge_ns: edge.at_ns,
            second_ns,
            fitted: 1,
        });
        PulseVerdict::Candidate
    }
}

impl Default for Pulse {
    fn default() -> Self {
        Self::new()
    }
}

impl PulseTrack {
    const fn filter(&self) -> &Kalman {
        if self.lags_for > 0 {
            &self.ramping
        } else {
            &self.quiet
        }
    }

    fn update(&mut self, edge: &NumberedEdge) -> PulseVerdict {
        let since_ns = edge.at_ns.wrapping_sub(self.edge_ns).cast_signed();
        // Numbered by the crystal, which is right to a ms over the few seconds.
        let second_ns = self.second_ns.wrapping_add(nearest_second(since_ns));
        if since_ns < 0 || second_ns == self.second_ns {
            return PulseVerdict::Refused(PulseRefusal::Doubled);
        }
        let dt_s = since_ns as f32 * 1e-9;
        let moved_ns = since_ns.wrapping_sub(second_ns.wrapping_sub(self.second_ns)) as f32;
        let (mut quiet, mut ramping) = (self.quiet, self.ramping);
        quiet.predict(dt_s);
        ramping.predict(dt_s);
        let innovation_ns = moved_ns - ramping.phase_ns;
        let gate_ns = GATE_NS + GATE_SIGMAS * libm::sqrtf(ramping.innovation_variance());
        if innovation_ns.abs() > gate_ns {
            return PulseVerdict::Refused(PulseRefusal::OffLine);
        }
        ramping.update(innovation_ns);
        let quiet_ns = moved_ns - quiet.phase_ns;
        let surprise = quiet_ns / libm::sqrtf(quiet.innovation_variance());
        quiet.update(quiet_ns);
        // What wanders off like no crystal does is not on any line, however well it fits.
        if [&quiet, &ramping]
            .iter()
            .any(|filter| filter.frequency_ppb.abs() > CRYSTAL_PPB)
        {
            return PulseVerdict::Refused(PulseRefusal::OffLine);
        }
        self.bias += (surprise.clamp(-5.0, 5.0) - self.bias) / BIAS_OVER;
        if self.bias.abs() > BIASED {
            self.lags_for = LAGS_FOR;
        } else if self.bias.abs() < UNBIASED {
            self.lags_for = self.lags_for.saturating_sub(1);
        }
        quiet.rebase(moved_ns);
        ramping.rebase(moved_ns);
        *self = Self {
            quiet,
            ramping,
            edge_ns: edge.at_ns,
            second_ns,
            fitted: self.fitted.saturating_add(1),
            ..*self
        };
        if self.fitted < CONFIRMING {
            return PulseVerdict::Candidate;
        }
        let filter = self.filter();
        PulseVerdict::Followed(PulseEstimate {
            utc_ns: second_ns.saturating_sub(libm::rintf(filter.phase_ns) as i64),
            crystal_ppb: filter.frequency_ppb,
            uncertainty_ns: UNCERTAINTY_SIGMAS * filter.phase_deviation_ns(),
            frequency_uncertainty_ppb: UNCERTAINTY_SIGMAS * filter.frequency_deviation_ppb(),
        })
    }
}

/// From `earlier_ns` to `later_ns`, ns since boot, in s.
fn elapsed_s(later_ns: u64, earlier_ns: u64) -> f32 {
    later_ns.saturating_sub(earlier_ns) as f32 * 1e-9
}

/// The whole second nearest to `ns`, in ns.
pub(crate) const fn nearest_second(ns: i64) -> i64 {
    let up = ns.saturating_add(SECOND_NS / 2);
    up.saturating_sub(up.rem_euclid(SECOND_NS))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const START_NS: i64 = 1_800_000_000 * SECOND_NS;
    const UNKNOWN: (i64, i64) = (-20 * MS, 300 * MS);

    /// An edge so many ns after boot, on a crystal that is 10 ppm fast; the messages are 70 ms
    /// behind.
    fn edge(true_ns: i64) -> NumberedEdge {
        NumberedEdge {
            at_ns: (true_ns + true_ns / 100_000) as u64,
            told_ns: START_NS + true_ns - 70 * MS,
            plausible_ns: UNKNOWN,
        }
    }

    fn handle(pulse: &mut Pulse, true_ns: i64) -> PulseVerdict {
        pulse.update(&edge(true_ns), 0.0, 25_000.0)
    }

    fn followed(seconds: i64) -> Pulse {
        let mut pulse = Pulse::new();
        for s in 1..=seconds {
            handle(&mut pulse, s * SECOND_NS);
        }
        assert!(pulse.is_followed());
        pulse
    }

    #[test]
    fn the_fifth_that_fits_is_followed_and_names_its_second() {
        let mut pulse = Pulse::new();
        for s in 1..5 {
            assert_eq!(handle(&mut pulse, s * SECOND_NS), PulseVerdict::Candidate);
            assert_eq!(pulse.utc_at(0), None);
        }
        for s in 5..60 {
            let PulseVerdict::Followed(line) = handle(&mut pulse, s * SECOND_NS) else {
                panic!("second {s}");
            };
            let off_ns = line.utc_ns - (START_NS + s * SECOND_NS);
            assert!(off_ns.abs() <= 10, "{off_ns}");
        }
        let at = edge(60 * SECOND_NS);
        let (utc_ns, uncertainty_ns) = pulse.utc_at(at.at_ns).unwrap();
        let off_ns = utc_ns - (START_NS + 60 * SECOND_NS);
        assert!(
            off_ns.abs() <= 10 && uncertainty_ns > 10.0,
            "{off_ns} {uncertainty_ns}"
        );
    }

    #[test]
    fn what_does_not_fit_is_refused_by_its_kind() {
        use PulseRefusal::{Doubled, OffLine};
        let mut pulse = followed(30);
        let at = 30 * SECOND_NS;
        for (off_ns, refusal) in [
            (50_000, Doubled),
            (400 * MS, Doubled),
            (600 * MS, OffLine),
            (SECOND_NS - 5_000, OffLine),
            (SECOND_NS + 5_000, OffLine),
        ] {
            assert_eq!(
                handle(&mut pulse, at + off_ns),
                PulseVerdict::Refused(refusal)
            );
        }
        let next = handle(&mut pulse, at + SECOND_NS);
        assert!(matches!(next, PulseVerdict::Followed(_)));
    }

    #[test]
    fn a_pulse_that_wanders_as_no_crystal_does_is_never_followed() {
        for (ppm, is_followed) in [
            (1_900, true),
            (-1_900, true),
            (2_100, false),
            (-2_100, false),
        ] {
            let mut pulse = Pulse::new();
            for s in 1..60 {
                let edge = NumberedEdge {
                    at_ns: (s * (SECOND_NS + ppm * 1_000)) as u64,
                    ..edge(s * SECOND_NS)
                };
                pulse.update(&edge, 0.0, 2_000_000.0);
            }
            assert_eq!(pulse.is_followed(), is_followed, "{ppm} ppm");
        }
    }

    #[test]
    fn a_pulse_that_is_not_on_the_second_is_no_candidate() {
        for (off_ms, is_refused) in [(0, false), (-100, false), (100, true), (500, true)] {
            let heard = handle(&mut Pulse::new(), 7 * SECOND_NS + off_ms * MS);
            let expected = if is_refused {
                PulseVerdict::Refused(PulseRefusal::OffSecond)
            } else {
                PulseVerdict::Candidate
            };
            assert_eq!(heard, expected, "{off_ms} ms");
        }
        // With a latency that is known, 100 ms early is not plausible either.
        let known = NumberedEdge {
            told_ns: START_NS + 7 * SECOND_NS - 100 * MS,
            plausible_ns: (-20 * MS, 20 * MS),
            ..edge(7 * SECOND_NS)
        };
        let heard = Pulse::new().update(&known, 0.0, 0.0);
        assert_eq!(heard, PulseVerdict::Refused(PulseRefusal::OffSecond));
    }

    #[test]
    fn after_ten_seconds_the_search_begins_anew() {
        let mut pulse = followed(30);
        // Half a ms off: refused as long as the old line counts.
        let moved = |s: i64| s * SECOND_NS + MS / 2;
        for s in 31..=39 {
            assert!(matches!(
                handle(&mut pulse, moved(s)),
                PulseVerdict::Refused(_)
            ));
        }
        for s in 41..45 {
            assert_eq!(handle(&mut pulse, moved(s)), PulseVerdict::Candidate);
        }
        assert!(matches!(
            handle(&mut pulse, moved(45)),
            PulseVerdict::Followed(_)
        ));
    }

    #[test]
    fn seconds_can_get_other_numbers() {
        let mut pulse = followed(10);
        let at_ns = edge(10 * SECOND_NS).at_ns;
        let (before_ns, _) = pulse.utc_at(at_ns).unwrap();
        pulse.renumber(-18 * SECOND_NS);
        let (after_ns, _) = pulse.utc_at(at_ns).unwrap();
        assert_eq!(after_ns - before_ns, -18 * SECOND_NS);
    }
}
