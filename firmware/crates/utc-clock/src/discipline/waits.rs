//! How long marks wait behind other messages, and which of them may teach the floor.

use timebase::{CORE_HZ, Cycles};

use super::course::Observation;

/// A mark that waited longer than this behind other messages teaches the floor nothing. \[µs\]
pub(super) const PROMPT_US: u32 = 20_000;

/// Where every mark has waited for so long, those that waited least are observed. \[cycles\] 10 s
const ALL_WAITED: u64 = 10 * CORE_HZ as u64;

/// Those that waited longer than the least by no more than this. \[µs\]
const LEAST_WAIT_US: u32 = 5_000;

/// How long marks wait behind others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waits {
    /// When one last had not waited.
    prompt_at: Cycles,
    /// The least of the last [`ALL_WAITED`], of those before, and when that began. \[µs\]
    least_us: u32,
    least_before_us: u32,
    since: Cycles,
    /// What the floor's marks have waited. \[µs\]
    pub(super) floor_us: u32,
}

impl Waits {
    /// None has come yet.
    pub(super) const fn new() -> Self {
        Self {
            prompt_at: Cycles::BOOT,
            least_us: u32::MAX,
            least_before_us: u32::MAX,
            since: Cycles::BOOT,
            floor_us: 0,
        }
    }

    /// Whether a mark that has waited for so long teaches the floor.
    pub(super) fn may_teach(
        &mut self,
        observed: &Observation,
        busy_us: u32,
        message_uncertainty_ns: f32,
    ) -> bool {
        if observed.at.since(self.since) > ALL_WAITED.cast_signed() {
            self.since = observed.at;
            self.least_before_us = core::mem::replace(&mut self.least_us, u32::MAX);
        }
        self.least_us = self.least_us.min(busy_us);
        if busy_us <= PROMPT_US {
            self.prompt_at = observed.at;
            return true;
        }
        let is_needed = observed
            .uncertainty_ns
            .is_none_or(|ns| ns > message_uncertainty_ns + busy_us as f32 * 1e3);
        is_needed
            && observed.at.since(self.prompt_at) > ALL_WAITED.cast_signed()
            && busy_us <= self.least_before_us.saturating_add(LEAST_WAIT_US)
    }
}
