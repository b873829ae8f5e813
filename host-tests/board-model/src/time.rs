//! Units, the start of the world, and how long a board takes to handle what it receives.

use timebase::{CORE_HZ, Cycles};
use utc_clock::UtcNanos;
use world::WorldNanos;

/// A microsecond. \[ns\]
pub const US: i64 = 1_000;
/// A millisecond. \[ns\]
pub const MS: i64 = 1_000 * US;
/// A second. \[ns\]
pub const SECOND: i64 = 1_000 * MS;

/// 2026-11-22T01:02:03Z, the start of the world's time.
pub const START: UtcNanos = UtcNanos(1_795_309_323 * SECOND);

/// A byte at 115200 baud, rounded up; a message's stamp is the end of its first one. \[ns\]
pub const BYTE_NS: i64 = 86_806;
/// From the start of a NAV-PVT to its handling: 100 bytes at 115200 baud and the task's wake-up.
/// \[ns\]
pub const FRAME_NS: i64 = 8_700_000;
/// The same of a TIM-TP, 24 bytes. \[ns\]
pub(crate) const FORECAST_NS: i64 = 2_100_000;
/// From the start of a TIM-TP to its pulse. \[ns\]
pub(crate) const FORECAST_AHEAD_NS: i64 = 500 * MS;
/// From a pulse's edge to its handling: an interrupt and a task's wake-up. \[ns\]
pub(crate) const PULSE_TASK_NS: i64 = 20_000;
/// How late the firmware's timers are: a tick and a wake-up. \[cycles\]
pub(crate) const TIMER_LATE: u64 = 10_000;

/// A moment of the world, `seconds` after its start.
#[must_use]
pub const fn at_s(seconds: u64) -> WorldNanos {
    WorldNanos(seconds * SECOND.unsigned_abs())
}

/// The moment `world_ns` after the start; the start itself for a negative one.
pub(crate) fn moment(world_ns: i64) -> WorldNanos {
    WorldNanos(u64::try_from(world_ns).unwrap_or(0))
}

/// A board's own time without any clock: its counter at the nominal rate. \[ns\]
#[must_use]
pub fn nominal_ns(cycles: Cycles) -> i64 {
    let ns = u128::from(cycles.0) * 1_000_000_000 / u128::from(CORE_HZ);
    i64::try_from(ns).unwrap_or(i64::MAX)
}

/// How long a receiver's pulse is high, as it was asked for. \[ns\]
pub const PULSE_WIDTH_NS: i64 = 100 * MS;
