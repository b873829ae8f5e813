//! The anchor: what a crystal cannot have done, the receiver did.
//!
//! *Purpose.* Tells a receiver whose time drifts away from a crystal that does, as far as that is
//! possible without a pulse; and knows the frequency of the whole lock, for a holdover.
//!
//! *Design.* A line that runs with the frequency of many minutes and is drawn after the floor by no
//! more than [`FOLLOW_PPB`]. A floor that leaves it by more than floors wander is not a crystal's:
//! its marks are refused. The line goes on being drawn, so that a receiver that has stopped
//! drifting is believed again.
//!
//! Two floors of long ago are kept. The slope from the older one to the present floor is the
//! frequency over 10 to 20 minutes: better than any that was learnt within a window, as long as the
//! crystal was steady.
//!
//! *Limits.* It needs six minutes of marks; before that it has no opinion. Within its reach
//! a receiver may drift as it likes.

use crate::envelope::EnvelopeEstimate;

/// How fast the line is drawn after the floor, at most, in ppb: more than the many minutes lag
/// behind a crystal that drifts by 1 ppm a minute.
const FOLLOW_PPB: f32 = 40_000.0;
/// How far the floor may be from the line, in ns: twice what the floors of real receivers wander.
const REACH_NS: f32 = 20e6;

/// The first floor that is kept has a frequency that is known so well, in ppb.
const SETTLED_PPB: f32 = 1_000.0;
/// From one kept floor to the next, in s.
const KEPT_EVERY_S: f32 = 600.0;
/// The shortest slope that is of use, in s.
const LEAST_SLOPE_S: f32 = 200.0;
/// The slope is as good as the last frequency if they are not farther apart, in ppb, beyond the
/// uncertainty.
const STEADY_PPB: f32 = 500.0;

/// A floor: ns since boot by the board's counter, and UTC then, in ns.
#[derive(Clone, Copy, Debug)]
struct Kept {
    local_ns: u64,
    utc_ns: i64,
}

impl Kept {
    fn elapsed_ns(&self, later: &Self) -> i64 {
        later.local_ns.wrapping_sub(self.local_ns).cast_signed()
    }

    fn elapsed_s(&self, later: &Self) -> f32 {
        self.elapsed_ns(later) as f32 * 1e-9
    }
}

/// The slow memory of the floor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DriftGuard {
    line: Option<Kept>,
    latest: Option<Kept>,
    older: Option<Kept>,
    newer: Option<Kept>,
}

impl DriftGuard {
    pub(crate) const fn new() -> Self {
        Self {
            line: None,
            latest: None,
            older: None,
            newer: None,
        }
    }

    /// Whether the floor, which is at `utc_ns` when the board's counter is at `local_ns`, is a
    /// crystal's.
    pub(crate) fn reaches(&mut self, local_ns: u64, utc_ns: i64, floor: &EnvelopeEstimate) -> bool {
        let now = Kept { local_ns, utc_ns };
        let (Some(line), Some(slow_ppb)) = (self.line, floor.slow_ppb) else {
            self.line = Some(now);
            self.keep(now, floor);
            return true;
        };
        let passed_ns = line.elapsed_ns(&now);
        let passed_s = line.elapsed_s(&now);
        let line_utc_ns = line
            .utc_ns
            .saturating_add(passed_ns)
            .saturating_sub((slow_ppb * passed_s) as i64);
        let off_ns = utc_ns.saturating_sub(line_utc_ns);
        let most_ns = (FOLLOW_PPB * passed_s.max(0.0)) as i64;
        self.line = Some(Kept {
            local_ns,
            utc_ns: line_utc_ns.saturating_add(off_ns.min(most_ns).max(-most_ns)),
        });
        let is_near = (off_ns as f32).abs() <= REACH_NS;
        if is_near {
            self.keep(now, floor);
        }
        is_near
    }

    fn keep(&mut self, now: Kept, floor: &EnvelopeEstimate) {
        self.latest = Some(now);
        let newest = self.newer.or(self.older);
        let is_due = match newest {
            Some(newest) => newest.elapsed_s(&now) > KEPT_EVERY_S,
            None => floor.frequency_uncertainty_ppb < SETTLED_PPB,
        };
        if is_due {
            self.older = newest.or(Some(now));
            self.newer = newest.map(|_| now);
        }
    }

    /// The frequency of the whole lock, in ppb, if the crystal was as steady as `crystal_ppb` can
    /// tell.
    pub(crate) fn steady_ppb(&self, crystal_ppb: f32, uncertainty_ppb: f32) -> Option<f32> {
        let (older, latest) = (self.older?, self.latest?);
        let passed_s = older.elapsed_s(&latest);
        let passed_ns = older.elapsed_ns(&latest);
        let told_ns = latest.utc_ns.saturating_sub(older.utc_ns);
        let slope_ppb = passed_ns.saturating_sub(told_ns) as f32 / passed_s;
        let is_steady = (crystal_ppb - slope_ppb).abs() <= uncertainty_ppb + STEADY_PPB;
        (passed_s >= LEAST_SLOPE_S && is_steady).then_some(slope_ppb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    fn floor(crystal_ppb: f32) -> EnvelopeEstimate {
        EnvelopeEstimate {
            excess_ns: 0,
            crystal_ppb,
            uncertainty_ns: 50_000.0,
            frequency_uncertainty_ppb: 500.0,
            slow_ppb: Some(crystal_ppb),
            is_fresh: false,
        }
    }

    /// Floors a second apart, of a receiver that drifts by so much on a crystal that is 20 ppm
    /// fast; how many were refused.
    fn refused(
        anchor: &mut DriftGuard,
        from_s: u64,
        to_s: u64,
        drift_ppb: i64,
        off_ns: &mut i64,
    ) -> u64 {
        let mut refused = 0;
        for s in from_s..to_s {
            *off_ns += drift_ppb;
            let utc_ns = (s * SECOND).cast_signed() - s.cast_signed() * 20_000 + *off_ns;
            refused += u64::from(!anchor.reaches(s * SECOND, utc_ns, &floor(20_000.0)));
        }
        refused
    }

    #[test]
    fn what_a_crystal_does_is_followed_and_what_none_does_is_not() {
        for drift_ppb in [10_000, -10_000, 30_000] {
            let (mut anchor, mut off_ns) = (DriftGuard::new(), 0);
            assert_eq!(refused(&mut anchor, 0, 3_000, drift_ppb, &mut off_ns), 0);
        }
        for drift_ppb in [100_000, -100_000] {
            let (mut anchor, mut off_ns) = (DriftGuard::new(), 0);
            refused(&mut anchor, 0, 600, 0, &mut off_ns);
            // 20 ms at 100 less 40 ppm are 333 s.
            let drifting = refused(&mut anchor, 600, 1_600, drift_ppb, &mut off_ns);
            assert!((660..=670).contains(&drifting), "{drifting}");
            // 60 ms off at the end; 40 ppm draw the line into reach again in 1 000 s.
            let back = refused(&mut anchor, 1_600, 3_600, 0, &mut off_ns);
            assert!((990..=1_010).contains(&back), "{back}");
        }
    }

    #[test]
    fn the_whole_locks_frequency_is_that_of_a_steady_crystal() {
        let (mut anchor, mut off_ns) = (DriftGuard::new(), 0);
        refused(&mut anchor, 0, 150, 0, &mut off_ns);
        assert_eq!(anchor.steady_ppb(20_000.0, 0.0), None, "too short");
        refused(&mut anchor, 150, 5_000, 0, &mut off_ns);
        let steady = anchor.steady_ppb(20_400.0, 0.0).unwrap();
        assert!((steady - 20_000.0).abs() < 1.0, "{steady}");
        assert_eq!(
            anchor.steady_ppb(22_000.0, 0.0),
            None,
            "the crystal has moved"
        );
    }
}
