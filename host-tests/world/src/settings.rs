//! What a simulated receiver is like.
//!
//! *Purpose.* Everything about a receiver that a test chooses, and what goes wrong
//! with it and when.
//!
//! *Design.* Plain fields; [`ReceiverSettings::new`] gives a receiver as it comes
//! out of its box, warm, with the latency of one that was measured. The same
//! settings drive [`Receiver`](crate::Receiver), [`Arrivals`](crate::Arrivals) and
//! [`Pulses`](crate::Pulses), so that they are of one world.
//!
//! *Limits.* What goes wrong does so at given moments, never by chance.

use crate::WorldNanos;
use crate::latency::Latency;
use crate::pulse::PulseSettings;

/// A time without a word, after which everything comes at once: what became ready
/// meanwhile leaves back to back, and the last epoch of it once more.
///
/// A Pixhawk 1's log has one of 1.56 s at 5 Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stall {
    /// When it begins.
    pub from: WorldNanos,
    /// How long it lasts, in ns.
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
    /// By how much its time jumps ahead at `from`, in ns; may be negative.
    pub jump_ns: i64,
    /// How fast it runs away after that, in ppb; positive runs ahead.
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

    /// Runs away by `drift_ppb` for ever after `from`.
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

    /// By how much its time is ahead at `at`, in ns.
    pub(crate) fn error_ns(&self, at: WorldNanos) -> i64 {
        if (self.from..self.until).contains(&at) {
            let since_ns = (at.0 - self.from.0).cast_signed();
            self.jump_ns + drifted_ns(since_ns, self.drift_ppb)
        } else {
            0
        }
    }
}

/// What an error of `ppb` makes of `ns`, in ns.
pub(crate) fn drifted_ns(ns: i64, ppb: i32) -> i64 {
    (i128::from(ns) * i128::from(ppb) / 1_000_000_000) as i64
}

/// By how much a receiver with `faults` is ahead of UTC at `at`, in ns.
pub(crate) fn time_error_ns(faults: &[TimeFault], at: WorldNanos) -> i64 {
    let of_each = faults.iter().map(|fault| fault.error_ns(at));
    of_each.sum()
}

/// The receiver's port and rate, as they stand at power-on and as CFG-PRT,
/// CFG-MSG and CFG-RATE change them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Bits a second.
    pub baud: u32,
    /// From epoch to epoch, in ms.
    pub period_ms: u16,
    /// NAV-PVT is sent every so many epochs; 0 is never.
    pub nav_pvt_every: u8,
    /// TIM-TP is sent for every so many pulses; 0 is never.
    pub tim_tp_every: u8,
    /// Whether NMEA (here one RMC sentence an epoch) leaves, too.
    pub nmea: bool,
}

impl Port {
    /// As an M8 leaves the factory: NMEA once a second at 9600.
    pub const FACTORY: Self = Self {
        baud: 9_600,
        period_ms: 1_000,
        nav_pvt_every: 0,
        tim_tp_every: 0,
        nmea: true,
    };

    /// As this firmware configures it: NAV-PVT alone, 5 Hz at 115200.
    pub const CONFIGURED: Self = Self {
        baud: 115_200,
        period_ms: 200,
        nav_pvt_every: 1,
        tim_tp_every: 0,
        nmea: false,
    };

    /// From epoch to epoch, in ns.
    pub(crate) fn period_ns(&self) -> i64 {
        i64::from(self.period_ms.max(1)) * 1_000_000
    }
}

/// What a receiver is like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReceiverSettings {
    /// True UTC at the world's start, in ns since 1970.
    pub utc_at_start_ns: i64,
    /// Where its chance comes from.
    pub seed: u64,
    /// From the epoch to the line.
    pub latency: Latency,
    /// How long after the world's start it has no time that may be believed, in
    /// ns; 0 for one that starts warm.
    pub cold_start_ns: u64,
    /// The rate error of the receiver's own crystal, in 10⁻⁹. Its solutions are
    /// computed at a 1 kHz tick of that crystal, so that any value but 0 makes
    /// `nano` a sawtooth of ±0.5 ms around the wanted epoch.
    pub crystal_ppb: i32,
    /// Its port at power-on.
    pub port: Port,
    /// When it falls silent.
    pub stalls: Vec<Stall>,
    /// When its time is wrong.
    pub time_faults: Vec<TimeFault>,
    /// Its time pulse.
    pub pulse: PulseSettings,
}

impl ReceiverSettings {
    /// A warm receiver out of its box with 60 to 80 ms of latency, as measured on
    /// a ZED-F9P (floor 60.9 ms, standard deviation 2.8 ms).
    #[must_use]
    pub const fn new(utc_at_start_ns: i64) -> Self {
        Self {
            utc_at_start_ns,
            seed: 0,
            latency: Latency::half_normal(60_900_000, 4_600_000),
            cold_start_ns: 0,
            crystal_ppb: 600,
            port: Port::FACTORY,
            stalls: Vec::new(),
            time_faults: Vec::new(),
            pulse: PulseSettings::m8(),
        }
    }
}
