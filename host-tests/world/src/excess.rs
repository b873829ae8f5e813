//! What a receiver takes beyond its least latency, as a distribution.
//!
//! *Purpose.* The edges that an estimator of the least latency has to do with:
//! sharp ones, even ones, and soft ones on which hardly a sample lies.
//!
//! *Design.* Everything is drawn through the quantile, so that jitter with a
//! memory has exactly the distribution of jitter without one.
//!
//! *Limits.* One-sided: nothing is ever below 0.

use core::f64::consts::{FRAC_1_SQRT_2, FRAC_2_SQRT_PI, PI};

use crate::chance::{normal_cdf, normal_quantile};

/// The distribution of the latency above its floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Excess {
    /// Always 0.
    None,
    /// The upper half of a bell curve, cut off at a window.
    HalfNormal {
        /// The standard deviation of the whole bell curve. \[ns\]
        sigma_ns: u64,
        /// The most there can be; `u64::MAX` where nothing is cut off. \[ns\]
        window_ns: u64,
    },
    /// Anything up to a window, all alike: the density at the edge is low.
    Even {
        /// The most there can be. \[ns\]
        window_ns: u64,
    },
    /// Gamma of shape 2: the density at the edge is 0 and grows in proportion to
    /// the distance from it. Its standard deviation is √2 times the scale.
    Gamma {
        /// The scale, where the density is greatest. \[ns\]
        scale_ns: u64,
    },
    /// Rayleigh: at the edge as the gamma's, with a shorter tail. Its standard
    /// deviation is √(2 − π/2) times the scale.
    Rayleigh {
        /// The scale, where the density is greatest. \[ns\]
        scale_ns: u64,
    },
}

impl Excess {
    /// Half a bell curve whose *own* standard deviation, after the window has cut
    /// it off, is `deviation_ns`.
    ///
    /// The bell's σ is found by bisection on the deviation of the truncated
    /// distribution, which is known in closed form and grows with σ: it is 0.603 σ
    /// where the window does not matter and tends to 0.289 of the window, which an
    /// even distribution has. 6.5 ms in 30 ms take a σ of 11.38 ms.
    ///
    /// # Panics
    ///
    /// If the window is too narrow: less than √12 times `deviation_ns`.
    #[must_use]
    pub fn half_normal_of(deviation_ns: u64, window_ns: u64) -> Self {
        let (deviation, window) = (deviation_ns as f64, window_ns as f64);
        assert!(
            deviation * 12_f64.sqrt() < window,
            "no half bell within {window_ns} ns deviates by {deviation_ns} ns"
        );
        let (mut low, mut high) = (deviation, 1e3 * window.min(1e3 * deviation));
        while high - low > 0.1 {
            let sigma = 0.5 * (low + high);
            if half_normal_deviation(sigma, window) < deviation {
                low = sigma;
            } else {
                high = sigma;
            }
        }
        Self::HalfNormal {
            sigma_ns: high as u64,
            window_ns,
        }
    }

    /// The gamma of shape 2 that has the standard deviation `deviation_ns`.
    #[must_use]
    pub fn gamma_of(deviation_ns: u64) -> Self {
        Self::Gamma {
            scale_ns: (deviation_ns as f64 * FRAC_1_SQRT_2) as u64,
        }
    }

    /// The Rayleigh that has the standard deviation `deviation_ns`.
    #[must_use]
    pub fn rayleigh_of(deviation_ns: u64) -> Self {
        Self::Rayleigh {
            scale_ns: (deviation_ns as f64 / (2.0 - PI / 2.0).sqrt()) as u64,
        }
    }

    /// Below which excess, in ns, the share `p` of all lies; `p` is between 0 and 1.
    pub(crate) fn quantile_ns(self, p: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::HalfNormal {
                sigma_ns,
                window_ns,
            } => {
                let sigma = sigma_ns.max(1) as f64;
                let share = normal_cdf(window_ns as f64 / sigma) - 0.5;
                sigma * normal_quantile(0.5 + p * share)
            }
            Self::Even { window_ns } => p * window_ns as f64,
            Self::Gamma { scale_ns } => scale_ns as f64 * gamma_quantile(p),
            Self::Rayleigh { scale_ns } => scale_ns as f64 * (-2.0 * (1.0 - p).ln()).sqrt(),
        }
    }
}

/// The standard deviation of half a bell curve of `sigma` up to `window`.
fn half_normal_deviation(sigma: f64, window: f64) -> f64 {
    // With a = window/σ, φ the bell curve and Z its share between 0 and a:
    // mean = σ (φ(0) − φ(a)) / Z, mean square = σ² (1 − a φ(a) / Z).
    let a = window / sigma;
    let top = 0.5 * FRAC_1_SQRT_2 * FRAC_2_SQRT_PI;
    let at_window = top * (-0.5 * a * a).exp();
    let share = normal_cdf(a) - 0.5;
    let mean = (top - at_window) / share;
    sigma * (1.0 - a * at_window / share - mean * mean).sqrt()
}

/// The quantile of the gamma distribution of shape 2 and scale 1, whose
/// distribution function is 1 − (1 + x) e^−x.
fn gamma_quantile(p: f64) -> f64 {
    // Newton on ln(1 + x) − x = ln(1 − p), which is concave: from above the root it
    // comes down to it and never beyond. It starts at the bound of Chatzigeorgiou
    // (IEEE Communications Letters 17, 2013) on the Lambert function's lower branch.
    let target = (-p).ln_1p();
    let mut x = (-2.0 * target).sqrt() - target;
    for _ in 0..20 {
        let step = (x.ln_1p() - x - target) * (1.0 + x) / x;
        x += step;
        if step.abs() < 1e-9 * x {
            break;
        }
    }
    x.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::{Stream, even, stream};

    const MS: u64 = 1_000_000;

    /// Mean and standard deviation of 200 000 draws, and the greatest of them.
    fn moments(excess: Excess) -> (f64, f64, f64) {
        let mut rng = stream(1, Stream::Jitter);
        let count = 200_000;
        let (mut sum, mut squares, mut most) = (0.0, 0.0, 0.0_f64);
        for _ in 0..count {
            let ns = excess.quantile_ns(even(&mut rng));
            assert!(ns >= 0.0);
            sum += ns;
            squares += ns * ns;
            most = most.max(ns);
        }
        let mean = sum / f64::from(count);
        (
            mean,
            (squares / f64::from(count) - mean * mean).sqrt(),
            most,
        )
    }

    #[test]
    fn each_has_the_deviation_that_was_asked_for() {
        // 200 000 draws: a mean is good to 0.3 % here and a deviation to 0.5 %.
        let near = |is: f64, expected: f64| (is / expected - 1.0).abs() < 0.01;
        let d = 6.5e6;
        let m8 = Excess::half_normal_of(6_500_000, 30 * MS);
        let Excess::HalfNormal { sigma_ns, .. } = m8 else {
            panic!("half a bell");
        };
        // Found independently by summing the truncated bell up in 20 000 slices.
        assert!(sigma_ns.abs_diff(11_377_065) < 1_000);
        let (_, deviation, most) = moments(m8);
        assert!(near(deviation, d) && most <= 30e6 && most > 29e6);
        // The whole half bell: mean σ √(2/π), deviation σ √(1 − 2/π).
        let (mean, deviation, _) = moments(Excess::half_normal_of(3 * MS, u64::MAX));
        assert!(near(deviation, 3e6) && near(mean, 3e6 * 0.797_885 / 0.602_810));
        let (mean, deviation, most) = moments(Excess::Even { window_ns: 90 * MS });
        assert!(near(mean, 45e6) && near(deviation, 90e6 / 12_f64.sqrt()) && most < 90e6);
        let (mean, deviation, _) = moments(Excess::gamma_of(6_500_000));
        assert!(near(deviation, d) && near(mean, d * 2_f64.sqrt()));
        let (mean, deviation, _) = moments(Excess::rayleigh_of(6_500_000));
        assert!(near(deviation, d) && near(mean, d * 1.913_058));
        assert_eq!(moments(Excess::None).0, 0.0);
    }

    #[test]
    fn the_gamma_quantile_undoes_its_distribution() {
        for p in [1e-12, 1e-6, 0.01, 0.5, 0.99, 1.0 - 1e-12] {
            let x = gamma_quantile(p);
            let again = -(x.ln_1p() - x).exp_m1();
            assert!((again - p).abs() < 1e-9 * p, "{p}: {again}");
        }
    }
}
