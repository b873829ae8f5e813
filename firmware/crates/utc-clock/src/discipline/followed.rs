//! The pulse's line, of the train that is followed or was last.
//!
//! *Purpose.* Where the next pulse has to be, and whether another train may take its place.

use timebase::Cycles;

use crate::float::float;
use crate::holdover::{CRYSTAL_PPB, DRIFT_PPB_PER_S};
use crate::refusal::PulseRefusal;
use crate::second::SECOND_NS;
use crate::track::{PulseTrack, nearest_second};

/// A train is the one that was followed before when it is no farther from its line than the line's
/// uncertainty and this. \[ns\]
pub(super) const SAME_TRAIN_NS: f32 = 2_000.0;
/// An edge is not seen where a pulse is expected just because nobody knows where that is. \[ns\]
const MOST_DOOR_NS: f32 = 20_000.0;
/// Another one has to outlast it by so long while it is there, and when it is not. \[s\]
const OUTLASTS_S: f32 = 120.0;
pub(super) const OUTLASTS_HOLDOVER_S: f32 = 60.0;
/// And at the crystal's frequency to so much. \[ppb\]
const OUTLASTS_PPB: f32 = 500.0;

/// Without a pulse for so long the clock is not on one any more. \[s\]
const PULSE_LASTS_S: f32 = 10.0;
/// The same. \[ns\]
pub(super) const PULSE_LASTS_NS: i64 = PULSE_LASTS_S as i64 * SECOND_NS;

/// The pulse's line: of the train that is followed, or was last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Followed {
    pub(super) track: PulseTrack,
    pub(super) train: u8,
    /// The second that its last pulse marks, in the discipline's scale. \[ns\]
    pub(super) second_ns: i64,
    /// When an edge last rose where its pulse is expected, whatever became of it. \[ns\]
    pub(super) seen_ns: u64,
}

impl Followed {
    /// UTC by its line in the discipline's scale, with how far it may be off; both in ns.
    pub(super) fn utc_at(&self, local_ns: u64) -> (i64, f32) {
        let utc_ns = self
            .second_ns
            .saturating_add(self.track.elapsed_ns(local_ns));
        (utc_ns, self.track.uncertainty_ns(local_ns))
    }

    /// Whether the clock is on it.
    pub(super) fn is_lasting(&self, local_ns: u64) -> bool {
        self.track.since_s(local_ns) < PULSE_LASTS_S
    }

    /// Whether the followed pulse is there is known from its rise alone.
    pub(super) fn note_rise(&mut self, rise_ns: u64) {
        let elapsed_ns = self.track.elapsed_ns(rise_ns);
        let off_ns = float(elapsed_ns.saturating_sub(nearest_second(elapsed_ns)));
        let door_ns = self.track.uncertainty_ns(rise_ns).min(MOST_DOOR_NS) + SAME_TRAIN_NS;
        if off_ns.abs() <= door_ns {
            self.seen_ns = rise_ns;
        }
    }

    /// Whether a train at another phase than the one that is followed has outlasted it.
    pub(super) fn may_replace(
        &self,
        track: &PulseTrack,
        edge_ns: u64,
        steady_s: f32,
    ) -> Result<(), PulseRefusal> {
        let since_s = self.track.since_s(edge_ns);
        let is_gone = since_s > PULSE_LASTS_S;
        let unseen_s = float(edge_ns.wrapping_sub(self.seen_ns).cast_signed()) * 1e-9;
        if is_gone && unseen_s < PULSE_LASTS_S {
            // It is still there, if misshapen.
            return Err(PulseRefusal::OffLine);
        }
        let lasts_s = if is_gone {
            OUTLASTS_HOLDOVER_S
        } else {
            OUTLASTS_S
        };
        let apart_ppb = track.crystal_ppb() - self.track.crystal_ppb();
        let most_ppb = OUTLASTS_PPB + 2.0 * DRIFT_PPB_PER_S * since_s;
        if steady_s < lasts_s || apart_ppb.abs() > most_ppb {
            return Err(PulseRefusal::OffLine);
        }
        Ok(())
    }
}

/// How far off a crystal's frequency may be for a train that begins. \[ppb\]
pub(super) fn crystal_uncertainty_ppb(
    followed: Option<&Followed>,
    known_ppb: f32,
    at: Cycles,
) -> f32 {
    // What messages teach of it can be wrong by more than anybody knows.
    followed.map_or(CRYSTAL_PPB, |followed| {
        let since_s = followed.track.since_s(at.as_nanos());
        (known_ppb + 2.0 * DRIFT_PPB_PER_S * since_s).min(CRYSTAL_PPB)
    })
}
