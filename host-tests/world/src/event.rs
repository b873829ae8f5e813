//! What a board sees of its receiver, as events in true time.
//!
//! *Purpose.* The vocabulary between the source of a flight (a generator, a file)
//! and its player on a clock.
//!
//! *Design.* An event has what stood in the message or what the wire did, and how
//! long the line had been busy by the message's first byte. Times are whole
//! picoseconds, so that the decimals of a file are kept exactly.
//!
//! *Limits.* No bytes: framing is another crate's test.

use std::fmt;

const PS_PER_US: i64 = 1_000_000;
const PS_PER_NS: i64 = 1_000;
const PS_PER_S: f64 = 1e12;

/// True time since the flight's start, in ps; below 0 before it. It runs at the rate
/// of UTC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorldPicos(pub i64);

impl WorldPicos {
    /// Whole ms.
    #[must_use]
    pub const fn from_millis(ms: i64) -> Self {
        Self(ms * 1_000 * PS_PER_US)
    }

    /// Whole ns.
    #[must_use]
    pub const fn from_nanos(ns: i64) -> Self {
        Self(ns * PS_PER_NS)
    }

    /// Seconds, rounded to a ns.
    #[must_use]
    pub fn from_secs(s: f64) -> Self {
        Self((s * 1e9).round() as i64 * PS_PER_NS)
    }

    /// Whole ns, rounded to the nearest.
    #[must_use]
    pub const fn as_nanos(self) -> i64 {
        (self.0 + PS_PER_NS / 2).div_euclid(PS_PER_NS)
    }

    /// In µs.
    #[must_use]
    pub fn as_micros(self) -> f64 {
        self.0 as f64 / PS_PER_US as f64
    }

    /// In s.
    #[must_use]
    pub fn as_secs(self) -> f64 {
        self.0 as f64 / PS_PER_S
    }

    /// `ps` later; stops at the ends of `i64`.
    #[must_use]
    pub const fn plus(self, ps: i64) -> Self {
        Self(self.0.saturating_add(ps))
    }
}

/// In µs: with three decimals, or with six where it is no whole ns.
impl fmt::Display for WorldPicos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (us, ps) = (
            self.0.unsigned_abs() / PS_PER_US as u64,
            self.0.unsigned_abs() % PS_PER_US as u64,
        );
        let sign = if self.0 < 0 { "-" } else { "" };
        if ps.is_multiple_of(PS_PER_NS as u64) {
            write!(f, "{sign}{us}.{:03}", ps / PS_PER_NS as u64)
        } else {
            write!(f, "{sign}{us}.{ps:06}")
        }
    }
}

/// Something that the board sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// When: of a message, its first byte's arrival.
    pub at: WorldPicos,
    /// What.
    pub kind: EventKind,
}

/// What a board can see of its receiver.
///
/// `busy_us` is how long the receiver's line had had no gap of two byte times by the
/// message's first byte, in µs: it waited in the queue for no longer. `None` where
/// it was not measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// NAV-PVT.
    Mark {
        /// The epoch in its fields, in ns of UTC since 1970.
        utc_ns: i64,
        /// tAcc, in ns.
        t_acc_ns: u32,
        /// `valid`, with the standard of NAV-TIMEUTC in the upper half (0xf: unknown).
        valid: u8,
        /// See [`EventKind`].
        busy_us: Option<u64>,
    },
    /// NAV-PVT in second 60 of the day's last minute.
    Mark60 {
        /// ns of that second.
        nano: i32,
        /// See [`EventKind`].
        busy_us: Option<u64>,
    },
    /// A rising edge on the pulse's wire.
    Rise,
    /// A falling edge on the pulse's wire.
    Fall,
    /// TIM-TP, of the next pulse.
    TimTp {
        /// By how much the pulse will come late, in ps (−qErr).
        late_ps: i32,
        /// The second that it names for the pulse.
        names: Option<PulseName>,
        /// See [`EventKind`].
        busy_us: Option<u64>,
    },
    /// NAV-TIMELS, the answer to a poll.
    TimeLs {
        /// Where the count comes from (srcOfCurrLs); 0, the firmware, where the
        /// receiver does not call it valid.
        source: u8,
        /// GPS less UTC, in s.
        count: i8,
        /// What the next event changes it by, in s.
        change: i8,
        /// Until the start of second 60 of that event, in s; below 0 of a past one.
        to_event_s: i32,
        /// See [`EventKind`].
        busy_us: Option<u64>,
    },
}

/// The second that TIM-TP names for the next pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseName {
    /// Time of week, in ms.
    pub tow_ms: u32,
    /// Week.
    pub week: u16,
    /// Bit 0: in UTC (else in a satellite system's time); bit 1: UTC is available;
    /// bits 2 and 3: RAIM (1 not active, 2 active); bit 4: qErr is invalid.
    pub flags: u8,
}

impl EventKind {
    /// How long the line had been busy, where it is a message and somebody looked.
    #[must_use]
    pub const fn busy_us(&self) -> Option<u64> {
        match *self {
            Self::Mark { busy_us, .. }
            | Self::Mark60 { busy_us, .. }
            | Self::TimTp { busy_us, .. }
            | Self::TimeLs { busy_us, .. } => busy_us,
            Self::Rise | Self::Fall => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn true_time_is_written_with_no_more_decimals_than_it_needs() {
        for (ps, text) in [
            (75_925_650_000, "75925.650"),
            (-41_000, "-0.041"),
            (1, "0.000001"),
            (-1_000_001, "-1.000001"),
            (0, "0.000"),
        ] {
            assert_eq!(WorldPicos(ps).to_string(), text);
        }
        assert_eq!(WorldPicos(1_499).as_nanos(), 1);
        assert_eq!(WorldPicos(-1_501).as_nanos(), -2);
    }
}
