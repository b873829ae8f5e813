//! What a simulated receiver is like.
//!
//! *Purpose.* Everything about [`Receiver`](crate::Receiver) that a test chooses.
//!
//! *Design.* Plain fields; [`ReceiverSettings::new`] gives a receiver as it comes
//! out of its box, warm, with the latency of one that was measured.
//!
//! *Limits.* The latency is drawn anew for each epoch; slow wander of its floor
//! is not modelled.

/// How long a solution takes from its epoch to the first byte on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Latency {
    /// Always the same.
    Constant {
        /// ns from the epoch to the first start bit.
        ns: u64,
    },
    /// Never less than a floor, and half a bell curve above it.
    HalfNormal {
        /// The least, in ns.
        floor_ns: u64,
        /// The standard deviation of the whole bell curve, in ns.
        sigma_ns: u64,
    },
}

impl Latency {
    pub(crate) fn draw(self, rng: &mut fastrand::Rng) -> u64 {
        match self {
            Self::Constant { ns } => ns,
            Self::HalfNormal { floor_ns, sigma_ns } => {
                // Box–Muller; 1 − u keeps the logarithm's argument above zero.
                let radius = (-2.0 * (1.0 - rng.f64()).ln()).sqrt();
                let normal = radius * (core::f64::consts::TAU * rng.f64()).cos();
                floor_ns + (normal.abs() * sigma_ns as f64) as u64
            }
        }
    }
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
    /// Whether NMEA (here one RMC sentence an epoch) leaves, too.
    pub nmea: bool,
}

impl Port {
    /// As an M8 leaves the factory: NMEA once a second at 9600.
    pub const FACTORY: Self = Self {
        baud: 9_600,
        period_ms: 1_000,
        nav_pvt_every: 0,
        nmea: true,
    };

    /// As this firmware configures it: NAV-PVT alone, 5 Hz at 115200.
    pub const CONFIGURED: Self = Self {
        baud: 115_200,
        period_ms: 200,
        nav_pvt_every: 1,
        nmea: false,
    };
}

/// What a [`Receiver`](crate::Receiver) is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
}

impl ReceiverSettings {
    /// A warm receiver out of its box with 60 to 80 ms of latency, as measured on
    /// a ZED-F9P (floor 60.9 ms, standard deviation 2.8 ms).
    #[must_use]
    pub const fn new(utc_at_start_ns: i64) -> Self {
        Self {
            utc_at_start_ns,
            seed: 0,
            latency: Latency::HalfNormal {
                floor_ns: 60_900_000,
                sigma_ns: 4_600_000,
            },
            cold_start_ns: 0,
            crystal_ppb: 600,
            port: Port::FACTORY,
        }
    }
}
