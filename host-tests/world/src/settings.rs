//! What a simulated receiver is like.
//!
//! *Purpose.* Everything about a receiver and its time pulse that a test chooses.
//!
//! *Design.* Plain fields; [`ReceiverSettings::new`] gives a receiver as it comes
//! out of its box, warm, with the latency of one that was measured. The same
//! settings drive [`Receiver`](crate::Receiver), [`Arrivals`](crate::Arrivals) and
//! [`Pulses`](crate::Pulses), so that they are of one world.

use crate::WorldNanos;
use crate::faults::{PulseFault, Stall, TimeFault};
use crate::latency::Latency;
use crate::model::Model;
use crate::ubx;

/// The receiver's port and rate, as they stand at power-on and as CFG-PRT,
/// CFG-MSG and CFG-RATE change them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Bits a second.
    pub baud: u32,
    /// From epoch to epoch. \[ms\]
    pub period_ms: u16,
    /// From NAV-PVT to NAV-PVT; 0 is never. \[epochs\]
    pub nav_pvt_every: u8,
    /// From TIM-TP to TIM-TP; 0 is never. \[pulses\]
    pub tim_tp_every: u8,
    /// Whether NMEA (here one RMC sentence an epoch) leaves, too.
    pub nmea: bool,
    /// Whether UBX leaves: without it nothing is answered.
    pub ubx: bool,
    /// Which protocols it takes, as in the mask of CFG-PRT.
    pub protocols_in: u8,
}

impl Port {
    /// As an M8 leaves the factory: NMEA once a second at 9600.
    pub const FACTORY: Self = Self {
        baud: 9_600,
        period_ms: 1_000,
        nav_pvt_every: 0,
        tim_tp_every: 0,
        nmea: true,
        ubx: true,
        protocols_in: 0x07,
    };

    /// As this firmware configures it: NAV-PVT alone, 5 Hz at 115200.
    pub const CONFIGURED: Self = Self {
        baud: 115_200,
        period_ms: 200,
        nav_pvt_every: 1,
        tim_tp_every: 0,
        nmea: false,
        ubx: true,
        protocols_in: 0x01,
    };

    /// From epoch to epoch. \[ns\]
    pub(crate) fn period_ns(&self) -> i64 {
        i64::from(self.period_ms.max(1)) * 1_000_000
    }
}

/// What the time pulse is like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PulseSettings {
    /// How far its edges are off, root of the mean square. \[ns\]
    pub rms_ns: u32,
    /// How much of that square is slow. \[percent\]
    pub correlated_percent: u8,
    /// The time constant of the slow part. \[ns\]
    pub correlation_ns: u64,
    /// The clock at whose ticks edges can be made; 0 for any time. Its
    /// sawtooth is a part of `rms_ns`. \[Hz\]
    pub clock_hz: u32,
    /// How long a pulse lasts before CFG-TP5 has said another width. \[ns\]
    pub width_ns: u64,
    /// How long a pulse lasts while the receiver has no time, before CFG-TP5 has said: 0 for none. Then
    /// it comes at a phase of its own. \[ns\]
    pub unlocked_width_ns: u64,
    /// When the receiver begins to make pulses at the second.
    pub from: WorldNanos,
    /// What goes wrong on the way.
    pub faults: Vec<PulseFault>,
}

impl PulseSettings {
    /// An M8's: 30 ns RMS on a clock of 48 MHz, which is ±10.4 ns of it, and 100 ms
    /// wide, from the first second on. None of it is slow.
    #[must_use]
    pub const fn m8() -> Self {
        Self {
            rms_ns: 30,
            correlated_percent: 0,
            correlation_ns: 100_000_000_000,
            clock_hz: 48_000_000,
            width_ns: 100_000_000,
            unlocked_width_ns: 0,
            from: WorldNanos(0),
            faults: Vec::new(),
        }
    }

    /// An M8's of which half the square is slow, over 100 s.
    #[must_use]
    pub fn m8_correlated() -> Self {
        Self {
            correlated_percent: 50,
            ..Self::m8()
        }
    }
}

/// A message that a receiver has in its flash beside those of its [`Port`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeftOn {
    /// Its class and id.
    pub message: (u8, u8),
    /// Its payload. \[bytes\]
    pub payload_len: u16,
    /// From one to the next; 0 is never. \[epochs\]
    pub every: u8,
}

impl LeftOn {
    /// RXM-RAWX with 72 measurements at each epoch: at 5 Hz 101 % of a line at 115200 baud.
    pub const RAWX: Self = Self {
        message: (0x02, 0x15),
        payload_len: 16 + 32 * 72,
        every: 1,
    };
}

/// What a receiver knows of leap seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeapKnowledge {
    /// The count that its firmware was built with: GPS less UTC. \[s\]
    pub built_with: i8,
    /// How long after the world's start it has the count from the sky, and not before the cold
    /// start is over. Until then its UTC is off by what the other count is. \[ns\]
    pub resolved_ns: u64,
    /// When a second 60 begins that NAV-TIMELS announces from the start. Its label is that of the second
    /// behind it, as POSIX has it; from its end on all labels are a second less than the world's UTC.
    pub second_60: Option<WorldNanos>,
}

impl LeapKnowledge {
    /// The right count, from the start.
    pub const RESOLVED: Self = Self {
        built_with: 18,
        resolved_ns: 0,
        second_60: None,
    };

    /// From then on a second 60 is over.
    pub(crate) fn second_60_ends(&self) -> Option<WorldNanos> {
        self.second_60.map(|at| at.plus(1_000_000_000))
    }
}

/// What a receiver is like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReceiverSettings {
    /// True UTC at the world's start, since 1970. \[ns\]
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
    /// What it is.
    pub model: Model,
    /// Its port at power-on, as its memory has it.
    pub port: Port,
    /// What else it sends.
    pub left_on: Vec<LeftOn>,
    /// Class and id of what it answers with ACK-NAK: of a CFG message, or of the message that
    /// CFG-MSG is about.
    pub refuses: Vec<(u8, u8)>,
    /// Keys that it does not know.
    pub refuses_keys: Vec<u32>,
    /// Whether it takes nothing of what it is sent.
    pub is_deaf: bool,
    /// When it has power; it takes nothing before.
    pub power_on: WorldNanos,
    /// When it restarts, in their order: what is not in its memory is lost then.
    pub restarts: Vec<WorldNanos>,
    /// How long a message may have to wait for the line before its queue is full and it is lost. \[ns\]
    pub queue_ns: u64,
    /// What it knows of leap seconds.
    pub leap: LeapKnowledge,
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
            model: Model::M8,
            port: Port::FACTORY,
            left_on: Vec::new(),
            refuses: Vec::new(),
            refuses_keys: Vec::new(),
            is_deaf: false,
            power_on: WorldNanos(0),
            restarts: Vec::new(),
            queue_ns: u64::MAX,
            leap: LeapKnowledge::RESOLVED,
            stalls: Vec::new(),
            time_faults: Vec::new(),
            pulse: PulseSettings::m8(),
        }
    }
    /// When it has its leap count from the sky.
    pub(crate) fn leap_resolved(&self) -> WorldNanos {
        WorldNanos(self.leap.resolved_ns.max(self.cold_start_ns))
    }

    /// What is wrong with its time, a leap count of its own included.
    pub(crate) fn all_time_faults(&self) -> Vec<TimeFault> {
        let ahead_s = ubx::GPS_MINUS_UTC_S - i64::from(self.leap.built_with);
        let before = TimeFault::jump(WorldNanos(0), ahead_s * 1_000_000_000);
        let mut faults = self.time_faults.clone();
        faults.push(before.until(self.leap_resolved()));
        if let Some(end) = self.leap.second_60_ends() {
            faults.push(TimeFault::jump(end, -1_000_000_000));
        }
        faults
    }
}
