//! A scenario: everything about one board and its receiver, as data.

use std::ops::Range;

use utc_clock::Settings;
use world::{CrystalSettings, Latency, Port, ReceiverSettings};

use crate::time::{BYTE_NS, START};

/// What a board is, and what happens to it.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The settings of its clock.
    pub settings: Settings,
    /// Its crystal; the receiver's seed is the crystal's, too.
    pub crystal: CrystalSettings,
    /// Its receiver.
    pub receiver: ReceiverSettings,
    /// The receiver whose time pulse is wired, if any; most often the same one.
    pub pulse: Option<ReceiverSettings>,
    /// When messages are lost on the way, in true time since the start; `i64::MAX` is a loss
    /// without an end. \[ns\]
    pub messages_lost: Vec<Range<i64>>,
}

impl Scenario {
    /// A configured receiver with that latency, no pulse, and a crystal within ±50 ppm, drawn from
    /// the seed. The latency counts as known, so that uncertainties are about floor time.
    #[must_use]
    pub fn new(latency: Latency, seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed);
        Self {
            settings: Settings {
                latency_uncertainty_ns: 0,
                pulse_uncertainty_ns: 0,
                hidden_turn_ns: 0,
                ..Settings::DEFAULT
            },
            crystal: CrystalSettings::new(rng.f64() * 100_000.0 - 50_000.0),
            receiver: ReceiverSettings {
                seed: rng.u64(..),
                latency,
                port: Port::CONFIGURED,
                ..ReceiverSettings::new(START.0)
            },
            pulse: None,
            messages_lost: Vec::new(),
        }
    }

    /// The same with the pulse of the receiver, as it is set now, wired. The latency counts as
    /// unknown: a pulse shows it.
    #[must_use]
    pub fn with_pulse(self) -> Self {
        Self {
            pulse: Some(self.receiver.clone()),
            settings: Settings {
                latency_uncertainty_ns: Settings::DEFAULT.latency_uncertainty_ns,
                ..self.settings
            },
            ..self
        }
    }

    /// How far floor time is behind UTC: the least latency, to the end of the first byte. \[ns\]
    #[must_use]
    pub const fn floor_ns(&self) -> i64 {
        self.receiver.latency.least_ns.cast_signed() + BYTE_NS
    }
}
