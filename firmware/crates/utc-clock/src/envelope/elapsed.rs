//! Time between two moments of the envelope.

/// From `earlier_us` to `later_us`, µs since boot, in s; an hour at most.
pub(super) fn elapsed_s(later_us: u64, earlier_us: u64) -> f32 {
    later_us.saturating_sub(earlier_us).min(3_600_000_000) as u32 as f32 * 1e-6
}
