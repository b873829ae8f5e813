//! The unit of the load's times.

/// Counts of the timer in a µs: 84 MHz, twice the clock of APB1.
pub const COUNTS_PER_US: u32 = 84;
