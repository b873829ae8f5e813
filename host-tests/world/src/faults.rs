//! What goes wrong with a receiver and its time pulse.
//!
//! *Design.* Every fault begins and ends at given moments; only which pulses of a
//! faulty wire are lost, and where its bounces lie, is chance.

use crate::WorldNanos;

/// A silence, after which everything comes at once: what became ready meanwhile
/// leaves back to back, and the last epoch of it once more.
///
/// A Pixhawk 1's log has one of 1.56 s at 5 Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stall {
    /// When it begins.
    pub from: WorldNanos,
    /// How long it lasts. \[ns\]
    pub lasts_ns: u64,
}

impl Stall {
    pub(crate) fn end(&self) -> WorldNanos {
        self.from.plus(self.lasts_ns)
    }

    /// Whether what is ready at `at` has to wait.
    pub(crate) fn holds(&self, at: WorldNanos) -> bool {
        (self.from..self.end()).contains(&at)
    }
}

/// A receiver whose time is wrong for a while, as after a glitch of its leap second
/// or when its signals are forged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeFault {
    /// The first moment at which it is wrong.
    pub from: WorldNanos,
    /// The first moment at which it is right again; `WorldNanos(u64::MAX)` for one
    /// that stays wrong.
    pub until: WorldNanos,
    /// By how much its time jumps ahead at `from`; may be negative. \[ns\]
    pub jump_ns: i64,
    /// How fast it drifts after that; positive runs ahead. \[ppb\]
    pub drift_ppb: i32,
}

impl TimeFault {
    /// A jump by `jump_ns` for ever after `from`.
    #[must_use]
    pub const fn jump(from: WorldNanos, jump_ns: i64) -> Self {
        Self {
            from,
            until: WorldNanos(u64::MAX),
            jump_ns,
            drift_ppb: 0,
        }
    }

    /// A drift by `drift_ppb` for ever after `from`.
    #[must_use]
    pub const fn drift(from: WorldNanos, drift_ppb: i32) -> Self {
        Self {
            from,
            until: WorldNanos(u64::MAX),
            jump_ns: 0,
            drift_ppb,
        }
    }

    /// The same, right again from `until` on.
    #[must_use]
    pub const fn until(self, until: WorldNanos) -> Self {
        Self { until, ..self }
    }

    /// By how much its time is ahead at `at`. \[ns\]
    pub(crate) fn error_ns(&self, at: WorldNanos) -> i64 {
        if (self.from..self.until).contains(&at) {
            let since_ns = (at.0 - self.from.0).cast_signed();
            self.jump_ns + drifted_ns(since_ns, self.drift_ppb)
        } else {
            0
        }
    }
}

/// What an error of `ppb` makes of `ns`. \[ns\]
pub(crate) fn drifted_ns(ns: i64, ppb: i32) -> i64 {
    (i128::from(ns) * i128::from(ppb) / 1_000_000_000) as i64
}

/// By how much a receiver with `faults` is ahead of UTC at `at`. \[ns\]
pub(crate) fn time_error_ns(faults: &[TimeFault], at: WorldNanos) -> i64 {
    let of_each = faults.iter().map(|fault| fault.error_ns(at));
    of_each.sum()
}

/// A fault of the pulse for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseFault {
    /// The first second with it, in true time.
    pub from: WorldNanos,
    /// The first second without it again; `WorldNanos(u64::MAX)` for a fault without an end.
    pub until: WorldNanos,
    /// What it is.
    pub kind: PulseFaultKind,
}

/// What can be wrong with the pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PulseFaultKind {
    /// The wire is cut.
    Cut,
    /// By chance, pulses are lost.
    Missing {
        /// One in that many, on average; 0 and 1 are all of them.
        one_in: u32,
    },
    /// A second edge follows each.
    Doubled {
        /// How long after it; less than a second. \[ns\]
        after_ns: u64,
    },
    /// Each edge is followed by others while a contact bounces.
    Bouncing {
        /// How many.
        edges: u8,
        /// Within how long after it, spread by chance; less than a second. \[ns\]
        within_ns: u64,
    },
    /// It is high where it should be low.
    Inverted,
    /// It comes so often a second.
    Repeated {
        /// How often. \[Hz\]
        hz: u32,
    },
    /// It has another width.
    Width {
        /// How long it lasts. \[ns\]
        width_ns: u64,
    },
    /// It comes at another phase of the second.
    WrongPhase {
        /// By how much it is late; within half a second to either side. \[ns\]
        by_ns: i64,
    },
}
