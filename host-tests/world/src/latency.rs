//! The way from an epoch to the first byte on the line.
//!
//! *Purpose.* The one source of lateness, for receivers that send bytes and for
//! [`Arrivals`](crate::Arrivals) without any.
//!
//! *Design.* A least, a slow [`Wander`] of the floor above it, and an [`Excess`]
//! drawn for each epoch. With a memory, the draws are a Gaussian copula: a normal
//! first-order process goes through the bell curve and then through the excess'
//! quantile, so that its distribution is the same with and without memory.
//!
//! *Limits.* The measured receivers were few: the figures say what was seen, not
//! what a model guarantees.

use fastrand::Rng;

use crate::WorldNanos;
use crate::chance::{Stream, even, normal, normal_cdf, stream};
use crate::excess::Excess;
use crate::wander::{Wander, Wanderer};

/// How long a solution takes from its epoch to the first byte on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latency {
    /// The least there ever is. \[ns\]
    pub least_ns: u64,
    /// How the floor moves above the least.
    pub wander: Wander,
    /// What each epoch takes beyond the floor.
    pub excess: Excess,
    /// The time constant with which the excess forgets; 0 draws it anew for
    /// each epoch. \[ns\]
    pub memory_ns: u64,
}

impl Latency {
    /// Always `ns`.
    #[must_use]
    pub const fn constant(ns: u64) -> Self {
        Self {
            least_ns: ns,
            wander: Wander::None,
            excess: Excess::None,
            memory_ns: 0,
        }
    }

    /// Half a bell curve of `sigma_ns` above a still floor.
    #[must_use]
    pub const fn half_normal(least_ns: u64, sigma_ns: u64) -> Self {
        Self::constant(least_ns).with_excess(Excess::HalfNormal {
            sigma_ns,
            window_ns: u64::MAX,
        })
    }

    /// An M8 in good order: half a bell with 6.5 ms of standard deviation in a
    /// window of 30 ms, which is what logs of flights at 5 Hz look like, above
    /// 40 ms.
    #[must_use]
    pub fn m8() -> Self {
        Self::constant(40_000_000).with_excess(Excess::half_normal_of(6_500_000, 30_000_000))
    }

    /// An M8 at work: even over 90 ms above 94.7 ms, as a LEA-M8T was seen at 9600
    /// (94.7 to 185.4 ms, standard deviation 28.6 ms).
    #[must_use]
    pub const fn harsh_m8() -> Self {
        Self::constant(94_700_000).with_excess(Excess::Even {
            window_ns: 90_000_000,
        })
    }

    /// An F9: half a bell with 3 ms of standard deviation above 60.9 ms, after a
    /// ZED-F9P (60.9 to 70.8 ms, standard deviation 2.8 ms).
    #[must_use]
    pub fn f9() -> Self {
        Self::constant(60_900_000).with_excess(Excess::half_normal_of(3_000_000, u64::MAX))
    }

    /// A receiver as quiet as those of Shim, Joo and Kim (2021) must have been: their best row is a mean
    /// difference of 3.44 ms, so the spread of two such receivers' latency makes no more. Half a bell of σ,
    /// two of which are apart by 2 √2 (√2 − 1) / √π · σ = 0.661 σ in the mean, above the M8's 40 ms.
    #[must_use]
    pub const fn paper() -> Self {
        Self::half_normal(40_000_000, 5_204_000)
    }

    /// The same with half of that spread.
    #[must_use]
    pub const fn paper_half() -> Self {
        Self::half_normal(40_000_000, 2_602_000)
    }

    /// A soft edge, on which hardly a sample lies: gamma of shape 2 with the M8's
    /// standard deviation of 6.5 ms. Not measured: a case for estimators.
    #[must_use]
    pub fn gamma() -> Self {
        Self::constant(40_000_000).with_excess(Excess::gamma_of(6_500_000))
    }

    /// A soft edge as [`Latency::gamma`], after Rayleigh, with 6.5 ms too.
    #[must_use]
    pub fn rayleigh() -> Self {
        Self::constant(40_000_000).with_excess(Excess::rayleigh_of(6_500_000))
    }

    /// The same with another excess.
    #[must_use]
    pub const fn with_excess(self, excess: Excess) -> Self {
        Self { excess, ..self }
    }

    /// The same with a floor that moves.
    #[must_use]
    pub const fn with_wander(self, wander: Wander) -> Self {
        Self { wander, ..self }
    }

    /// The same distribution, correlated over `memory_ns`.
    #[must_use]
    pub const fn with_memory(self, memory_ns: u64) -> Self {
        Self { memory_ns, ..self }
    }
}

/// The latency as it happens.
#[derive(Clone, Debug)]
pub(crate) struct LatencySource {
    latency: Latency,
    rng: Rng,
    wanderer: Wanderer,
    /// The normal process behind jitter with a memory, and when it stood so.
    state: f64,
    state_at: WorldNanos,
}

impl LatencySource {
    pub(crate) fn new(latency: Latency, seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Jitter);
        Self {
            latency,
            state: normal(&mut rng),
            state_at: WorldNanos(0),
            rng,
            wanderer: Wanderer::new(latency.wander, seed),
        }
    }

    /// The floor at `at`: the least that an epoch at that moment can take. \[ns\]
    pub(crate) fn floor_ns(&mut self, at: WorldNanos) -> u64 {
        self.latency.least_ns + self.wanderer.above_least_ns(at) as u64
    }

    /// What the epoch at `at` takes. \[ns\]
    pub(crate) fn draw_ns(&mut self, at: WorldNanos) -> u64 {
        let share = if self.latency.memory_ns == 0 {
            even(&mut self.rng)
        } else {
            let passed_ns = at.0.saturating_sub(self.state_at.0) as f64;
            let keeps = (-passed_ns / self.latency.memory_ns as f64).exp();
            let fresh = normal(&mut self.rng);
            self.state = keeps * self.state + (1.0 - keeps * keeps).sqrt() * fresh;
            self.state_at = at;
            normal_cdf(self.state)
        };
        self.floor_ns(at) + self.latency.excess.quantile_ns(share) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    /// The latencies of `count` epochs at 5 Hz. \[ns\]
    fn draws(latency: Latency, seed: u64, count: u64) -> Vec<f64> {
        let mut source = LatencySource::new(latency, seed);
        (0..count)
            .map(|number| source.draw_ns(WorldNanos(number * SECOND / 5)) as f64)
            .collect()
    }

    fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        (mean, square.sqrt())
    }

    fn autocorrelation(values: &[f64], lag: usize) -> f64 {
        let (mean, deviation) = mean_and_deviation(values);
        let products = values.iter().zip(&values[lag..]);
        let sum: f64 = products.map(|(a, b)| (a - mean) * (b - mean)).sum();
        sum / (values.len() - lag) as f64 / (deviation * deviation)
    }

    #[test]
    fn the_measured_kinds_have_their_floor_and_their_deviation() {
        for (latency, floor_ms, deviation_ms, window_ms) in [
            (Latency::m8(), 40.0, 6.5, 30.0),
            (Latency::harsh_m8(), 94.7, 25.98, 90.0),
            (Latency::f9(), 60.9, 3.0, f64::MAX),
            (Latency::gamma(), 40.0, 6.5, f64::MAX),
            (Latency::rayleigh(), 40.0, 6.5, f64::MAX),
        ] {
            let all = draws(latency, 1, 100_000);
            let least = all.iter().copied().fold(f64::MAX, f64::min) / 1e6;
            let most = all.iter().copied().fold(0.0, f64::max) / 1e6;
            // Sharp edges are reached to the µs, soft ones within 0.1 ms.
            assert!((0.0..0.1).contains(&(least - floor_ms)), "{least}");
            assert!(most <= floor_ms + window_ms);
            let deviation = mean_and_deviation(&all).1 / 1e6;
            assert!((deviation / deviation_ms - 1.0).abs() < 0.01, "{deviation}");
        }
    }

    #[test]
    fn the_papers_receivers_are_as_far_apart_as_its_best_row() {
        for (latency, apart_ms) in [(Latency::paper(), 3.44), (Latency::paper_half(), 1.72)] {
            let [one, other] = [11, 12].map(|seed| draws(latency, seed, 100_000));
            let apart = one
                .iter()
                .zip(&other)
                .map(|(one, other)| (one - other).abs());
            let mean_ms = apart.sum::<f64>() / 1e5 / 1e6;
            assert!((mean_ms / apart_ms - 1.0).abs() < 0.01, "{mean_ms}");
        }
    }

    #[test]
    fn a_memory_keeps_the_distribution_and_correlates_it() {
        let latency = Latency::harsh_m8().with_memory(20 * SECOND);
        // 200 000 s: 10 000 time constants, good to 1.5 %.
        let all = draws(latency, 2, 1_000_000);
        let (mean, deviation) = mean_and_deviation(&all);
        assert!((mean / 1e6 - 139.7).abs() < 1.5, "{mean}");
        assert!((deviation / 25.98e6 - 1.0).abs() < 0.02, "{deviation}");
        assert!(all.iter().all(|ns| (94.7e6..=184.7e6).contains(ns)));
        // Two even numbers whose normal ones correlate by ρ do by 6/π · asin(ρ/2).
        for (lag, rho) in [(1, 0.990_05_f64), (100, 0.367_88), (400, 0.018_32)] {
            let expected = 6.0 / core::f64::consts::PI * (0.5 * rho).asin();
            let is = autocorrelation(&all, lag);
            assert!((is - expected).abs() < 0.04, "{lag}: {is} for {expected}");
        }
        assert!(autocorrelation(&draws(Latency::harsh_m8(), 2, 100_000), 1).abs() < 0.02);

        let m8 = draws(Latency::m8().with_memory(20 * SECOND), 3, 1_000_000);
        let (_, deviation) = mean_and_deviation(&m8);
        assert!((deviation / 6.5e6 - 1.0).abs() < 0.03, "{deviation}");
        assert!(m8.iter().all(|ns| (40e6..=70e6).contains(ns)));
        assert!((0.28..0.42).contains(&autocorrelation(&m8, 100)));
    }

    #[test]
    fn nothing_falls_below_a_floor_that_wanders() {
        for wander in [Wander::WALK_8_MS, Wander::sine_8_ms(60 * SECOND, 0)] {
            let latency = Latency::m8().with_wander(wander);
            let mut source = LatencySource::new(latency, 4);
            let mut nearest = u64::MAX;
            for number in 0..50_000 {
                let at = WorldNanos(number * SECOND / 5);
                let above = source.draw_ns(at) - source.floor_ns(at);
                assert!(above <= 30_000_000);
                nearest = nearest.min(above);
            }
            assert!(nearest < 10_000, "{nearest}");
        }
    }
}
