//! A Kalman filter over a crystal's phase, frequency and drift.
//!
//! *Purpose.* Finds the crystal in a series of noisy phases.
//!
//! *Design.* Three states: phase in ns, frequency in ppb, drift in ppb a second. The drift
//! is a Gauss–Markov process: it forgets itself with a time constant. With a drift
//! that is known to be 0 the same filter has two states. The phase is kept relative to
//! the last update, so that 24 bits are enough for it; the caller has the whole.
//!
//! *Limits.* `f32`: a frequency of 50 ppm has a resolution of 4 · 10⁻³ ppb.

use crate::float::sqrt;

/// The noise that is assumed of a crystal and its measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Noise {
    /// White frequency noise: the phase's random walk. [ns²/s]
    pub(crate) phase_walk: f32,
    /// The frequency's random walk. [ppb²/s]
    pub(crate) frequency_walk: f32,
    /// The drift's variance. [(ppb/s)²]
    pub(crate) drift_variance: f32,
    /// The time constant with which the drift forgets itself. \[s\]
    pub(crate) drift_time_s: f32,
    /// A measurement's variance. [ns²]
    pub(crate) measurement: f32,
}

/// Phase, frequency and drift, with their covariance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kalman {
    noise: &'static Noise,
    pub(crate) phase_ns: f32,
    pub(crate) frequency_ppb: f32,
    pub(crate) drift_ppb_per_s: f32,
    covariance: Covariance,
}

/// The upper half of a symmetric matrix: p phase, f frequency, d drift.
#[derive(Clone, Copy, Debug)]
struct Covariance {
    pp: f32,
    pf: f32,
    pd: f32,
    ff: f32,
    fd: f32,
    dd: f32,
}

impl Kalman {
    /// A filter that has seen one measurement, of phase 0, of a crystal whose
    /// frequency is known to `uncertainty_ppb`.
    pub(crate) const fn new(
        noise: &'static Noise,
        frequency_ppb: f32,
        uncertainty_ppb: f32,
    ) -> Self {
        Self {
            noise,
            phase_ns: 0.0,
            frequency_ppb,
            drift_ppb_per_s: 0.0,
            covariance: Covariance {
                pp: noise.measurement,
                pf: 0.0,
                pd: 0.0,
                ff: uncertainty_ppb * uncertainty_ppb,
                fd: 0.0,
                dd: noise.drift_variance,
            },
        }
    }

    /// Lets `dt_s` pass.
    pub(crate) fn predict(&mut self, dt_s: f32) {
        let half = 0.5 * dt_s * dt_s;
        self.phase_ns += self.frequency_ppb * dt_s + self.drift_ppb_per_s * half;
        self.frequency_ppb += self.drift_ppb_per_s * dt_s;
        // First order is enough for steps that are short beside the time constant, and
        // stops at 0 for those that are not.
        let kept = (1.0 - dt_s / self.noise.drift_time_s).max(0.0);
        self.drift_ppb_per_s *= kept;
        let Covariance {
            pp,
            pf,
            pd,
            ff,
            fd,
            dd,
        } = self.covariance;
        let ff_walk = self.noise.frequency_walk * dt_s;
        let pf_new = pf + ff * dt_s + fd * half;
        let pd_new = pd + fd * dt_s + dd * half;
        let fd_new = fd + dd * dt_s;
        self.covariance = Covariance {
            pp: pp
                + (pf + pf_new) * dt_s
                + (pd + pd_new) * half
                + self.noise.phase_walk * dt_s
                + ff_walk * dt_s * dt_s / 3.0,
            // Half a step of each walk and of the drift's has moved what it drives.
            pf: pf_new + pd_new * dt_s + ff_walk * dt_s / 2.0,
            pd: pd_new * kept,
            ff: ff + (fd + fd_new) * dt_s + ff_walk,
            fd: fd_new * kept,
            dd: dd * kept * kept + self.noise.drift_variance * (1.0 - kept * kept),
        };
    }

    /// The variance of the next measurement about its prediction. [ns²]
    pub(crate) fn innovation_variance(&self) -> f32 {
        self.covariance.pp + self.noise.measurement
    }

    /// Takes in a measurement that is `innovation_ns` away from the phase predicted.
    pub(crate) fn update(&mut self, innovation_ns: f32) {
        let c = self.covariance;
        let weight = 1.0 / self.innovation_variance();
        let (gain_p, gain_f, gain_d) = (c.pp * weight, c.pf * weight, c.pd * weight);
        self.phase_ns += gain_p * innovation_ns;
        self.frequency_ppb += gain_f * innovation_ns;
        self.drift_ppb_per_s += gain_d * innovation_ns;
        self.covariance = Covariance {
            pp: c.pp - gain_p * c.pp,
            pf: c.pf - gain_p * c.pf,
            pd: c.pd - gain_p * c.pd,
            ff: (c.ff - gain_f * c.pf).max(0.0),
            fd: c.fd - gain_f * c.pd,
            dd: (c.dd - gain_d * c.pd).max(0.0),
        };
    }

    /// Nothing better is known of the drift than so. \[ppb/s\]
    pub(crate) fn open_drift(&mut self, deviation_ppb_per_s: f32) {
        let variance = deviation_ppb_per_s * deviation_ppb_per_s;
        self.covariance.dd = self.covariance.dd.max(variance);
    }

    /// Moves the phase's origin ahead by `ns`.
    pub(crate) fn rebase(&mut self, ns: f32) {
        self.phase_ns -= ns;
    }

    /// The standard deviation of the phase. \[ns\]
    pub(crate) fn phase_deviation_ns(&self) -> f32 {
        sqrt(self.covariance.pp)
    }

    /// The standard deviation of the frequency. \[ppb\]
    pub(crate) fn frequency_deviation_ppb(&self) -> f32 {
        sqrt(self.covariance.ff)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static QUIET: Noise = Noise {
        phase_walk: 25.0,
        frequency_walk: 0.5,
        drift_variance: 0.0,
        drift_time_s: 300.0,
        measurement: 900.0,
    };
    static RAMPING: Noise = Noise {
        drift_variance: 225.0,
        ..QUIET
    };

    /// The error of phase and frequency after `seconds` of exact measurements.
    fn settle(noise: &'static Noise, frequency_ppb: f32, drift: f32, seconds: u16) -> (f32, f32) {
        let mut filter = Kalman::new(noise, 0.0, 50_000.0);
        let truth = |t: f32| frequency_ppb * t + 0.5 * drift * t * t;
        let mut origin = 0.0;
        for second in 1..=seconds {
            filter.predict(1.0);
            let measured = truth(f32::from(second)) - origin;
            filter.update(measured - filter.phase_ns);
            let whole = filter.phase_ns;
            filter.rebase(whole);
            origin += whole;
        }
        let end = f32::from(seconds);
        (
            origin - truth(end),
            filter.frequency_ppb - (frequency_ppb + drift * end),
        )
    }

    #[test]
    fn two_states_settle_on_a_constant_frequency() {
        let (phase_ns, frequency_ppb) = settle(&QUIET, 4_000.0, 0.0, 200);
        assert!(
            phase_ns.abs() < 1.0 && frequency_ppb.abs() < 0.1,
            "{phase_ns} {frequency_ppb}"
        );
    }

    #[test]
    fn three_states_settle_on_a_ramp_and_two_lag() {
        let (phase_ns, frequency_ppb) = settle(&RAMPING, 0.0, 10.0, 200);
        assert!(
            phase_ns.abs() < 5.0 && frequency_ppb.abs() < 2.0,
            "{phase_ns} {frequency_ppb}"
        );
        let (phase_ns, _) = settle(&QUIET, 0.0, 10.0, 200);
        assert!(phase_ns.abs() > 100.0, "{phase_ns}");
    }

    #[test]
    fn uncertainty_shrinks_with_measurements_and_grows_without() {
        let mut filter = Kalman::new(&RAMPING, 0.0, 1_000.0);
        for _ in 0..100 {
            filter.predict(1.0);
            filter.update(0.0);
        }
        let settled = filter.phase_deviation_ns();
        assert!(settled < 30.0, "{settled}");
        let frequency = filter.frequency_deviation_ppb();
        filter.predict(60.0);
        assert!(filter.phase_deviation_ns() > settled + 60.0 * frequency);
    }
}
