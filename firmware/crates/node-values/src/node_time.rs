//! The node's time at one moment, in each unit that a message has.
//!
//! *Design.* UTC once the clock is set, time since boot before, as MAVLink allows.
//!
//! *Limits.* UTC before 1970 is 0 µs.

use timebase::{Cycles, divide};

/// The node's time at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeTime {
    /// Time since boot.
    pub boot: Cycles,
    /// UTC in ns since 1970, once the clock is set.
    pub utc_ns: Option<i64>,
}

impl NodeTime {
    /// Time since boot, in µs.
    #[must_use]
    pub const fn boot_us(self) -> u64 {
        self.boot.as_micros()
    }

    /// UTC in µs; 0 until the clock is set.
    #[must_use]
    pub fn utc_us(self) -> u64 {
        divide::<1_000>(u64::try_from(self.utc_ns.unwrap_or(0)).unwrap_or(0))
    }

    /// UTC in µs; since boot until the clock is set.
    #[must_use]
    pub fn rtos_us(self) -> u64 {
        match self.utc_ns {
            Some(_) => self.utc_us(),
            None => self.boot_us(),
        }
    }

    /// UTC in ns; since boot until the clock is set. Never 0, which in a
    /// TIMESYNC would mean a request.
    #[must_use]
    pub fn rtos_ns(self) -> i64 {
        let since_boot = || i64::try_from(self.boot_us().saturating_mul(1_000)).unwrap_or(i64::MAX);
        match self.utc_ns.unwrap_or_else(since_boot) {
            0 => 1,
            ns => ns,
        }
    }

    /// Time since boot, in ms, modulo 2^32.
    #[must_use]
    pub fn boot_ms(self) -> u32 {
        divide::<1_000>(self.boot_us()) as u32
    }
}
