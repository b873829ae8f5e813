//! The anchor: what a crystal cannot have done, the receiver did.
//!
//! *Purpose.* Tells a receiver whose time drifts away from a crystal that does, as far as that is
//! possible without a pulse.
//!
//! *Design.* A slow memory of the floor: its frequency, averaged over minutes, and a line that runs
//! with it and is drawn after the floor by no more than [`FOLLOW_PPB`]. A floor that leaves the line by more than floors
//! wander, or whose frequency leaves the average by more than a crystal changes in that time, is
//! not a crystal's. The average serves a holdover, too: it is better than the last
//! frequency where the two agree.
//!
//! *Limits.* It needs [`SETTLED_S`] of marks; before that it has no opinion. Within its reach
//! a receiver may drift as it likes.

use crate::envelope::Floor;

/// Marks for so long make an anchor, in s.
const SETTLED_S: f32 = 300.0;
/// The frequency is averaged over so long, in s: at 1 ppm a minute the average lags by 3.3 ppm.
const AVERAGE_S: f32 = 200.0;
/// How fast the line is drawn after the floor, at most, in ppb.
const FOLLOW_PPB: f32 = 20_000.0;
/// How far the floor may be from the line, in ns: twice what the floors of real receivers wander.
const REACH_NS: f32 = 20e6;
/// How far the frequency may be from its average, in ppb.
const REACH_PPB: f32 = 15_000.0;
/// A mark's time is counted for so long at most, in s.
const STEP_S: f32 = 2.0;

/// The slow memory of the floor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Anchor {
    /// The line: ns since boot by the board, UTC in ns.
    at: Option<(u64, i64)>,
    average_ppb: f32,
    marks_s: f32,
}

impl Anchor {
    pub(crate) const fn new() -> Self {
        Self {
            at: None,
            average_ppb: 0.0,
            marks_s: 0.0,
        }
    }

    /// Whether the floor, which is at `utc_ns` when the board's counter is at `local_ns`, is a crystal's;
    /// if it is, remembers it.
    pub(crate) fn reaches(&mut self, local_ns: u64, utc_ns: i64, floor: &Floor) -> bool {
        let Some((then_ns, then_utc_ns)) = self.at else {
            self.at = Some((local_ns, utc_ns));
            self.average_ppb = floor.fast_ppb;
            return true;
        };
        let passed_ns = local_ns.wrapping_sub(then_ns).cast_signed();
        let passed_s = passed_ns as f32 * 1e-9;
        let rise_ns = self.average_ppb * passed_s;
        let line_utc_ns = then_utc_ns
            .saturating_add(passed_ns)
            .saturating_sub(rise_ns as i64);
        let off_ns = utc_ns.saturating_sub(line_utc_ns) as f32;
        if self.marks_s >= SETTLED_S {
            let off_ppb = floor.fast_ppb - self.average_ppb;
            if off_ns.abs() > REACH_NS
                || off_ppb.abs() > REACH_PPB + 2.0 * floor.frequency_doubt_ppb
            {
                return false;
            }
        }
        let step_s = passed_s.clamp(0.0, STEP_S);
        self.marks_s += step_s;
        let most_ns = if self.marks_s >= SETTLED_S {
            FOLLOW_PPB * step_s
        } else {
            f32::MAX
        };
        let follow_ns = off_ns.clamp(-most_ns, most_ns) as i64;
        self.at = Some((local_ns, line_utc_ns.saturating_add(follow_ns)));
        let over_s = self.marks_s.clamp(STEP_S, AVERAGE_S);
        self.average_ppb += (floor.fast_ppb - self.average_ppb) * (step_s / over_s);
        true
    }

    /// The average, if there has been enough to average, and the crystal was as steady as `fast_ppb` can tell.
    pub(crate) fn steady_ppb(&self, fast_ppb: f32, doubt_ppb: f32) -> Option<f32> {
        let is_steady = (fast_ppb - self.average_ppb).abs() <= doubt_ppb + 500.0;
        (self.marks_s >= AVERAGE_S && is_steady).then_some(self.average_ppb)
    }
}
