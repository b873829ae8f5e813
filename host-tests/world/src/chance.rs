//! Where the world's chance comes from.
//!
//! *Purpose.* Independent streams of chance from one seed, and the bell curve.
//!
//! *Design.* A normal number is the bell curve's quantile at an even one, so that
//! what is drawn and what is mapped through a distribution (as jitter with a
//! memory is) goes one way. The quantile is Wichura's PPND7 (Algorithm AS 241,
//! Applied Statistics 37, 1988), good to one part in 10⁷.
//!
//! *Limits.* For simulations; not for secrets.

use fastrand::Rng;

/// What a stream of chance is for: each has its own, so that asking for one thing
/// more leaves the rest of the world as it was.
#[derive(Clone, Copy)]
pub(crate) enum Stream {
    Crystal = 1,
    Jitter,
    Wander,
    Answers,
    Pulse,
    PulseFaults,
    Schedule,
    ScheduleMessages,
    ScheduleLeap,
    ScheduleWire,
    ScheduleEvent,
}

/// The stream `purpose` of the world `seed`.
pub(crate) fn stream(seed: u64, purpose: Stream) -> Rng {
    // Twice through the generator, so that neighbouring seeds have nothing in common.
    let mixed = Rng::with_seed(seed).u64(..) ^ purpose as u64;
    Rng::with_seed(Rng::with_seed(mixed).u64(..))
}

/// An even number between 0 and 1, never either of them.
pub(crate) fn even(rng: &mut Rng) -> f64 {
    ((rng.u64(..) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
}

/// A normal number of mean 0 and standard deviation 1.
pub(crate) fn normal(rng: &mut Rng) -> f64 {
    normal_quantile(even(rng))
}

/// How much of the bell curve lies below `x`.
pub(crate) fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * core::f64::consts::FRAC_1_SQRT_2)
}

/// Below which number the share `p` of the bell curve lies; `p` is between 0 and 1.
pub(crate) fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * polynomial(
            r,
            &[
                3.387_132_717_9,
                50.434_271_938,
                159.291_132_02,
                59.109_374_720,
            ],
        ) / polynomial(r, &[1.0, 17.895_169_469, 78.757_757_664, 67.187_563_600]);
    }
    let r = (-p.min(1.0 - p).ln()).sqrt();
    let tail = if r <= 5.0 {
        let r = r - 1.6;
        polynomial(
            r,
            &[
                1.423_437_277_7,
                2.756_815_390_0,
                1.306_728_481_6,
                0.170_238_211_03,
            ],
        ) / polynomial(r, &[1.0, 0.737_001_642_50, 0.120_211_329_75])
    } else {
        let r = r - 5.0;
        polynomial(
            r,
            &[
                6.657_905_115_0,
                3.081_226_386_0,
                0.428_682_943_37,
                0.017_337_203_997,
            ],
        ) / polynomial(r, &[1.0, 0.241_978_942_25, 0.012_258_202_635])
    };
    tail.copysign(q)
}

/// The polynomial with `coefficients`, the constant first.
fn polynomial(x: f64, coefficients: &[f64]) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_undoes_the_bell_curve() {
        for tenths in -80..=80 {
            let x = f64::from(tenths) / 10.0;
            // Above 5 the share is too near to 1 to distinguish numbers.
            if x <= 5.0 {
                let again = normal_quantile(normal_cdf(x));
                assert!((again - x).abs() < 1e-6 * (1.0 + x.abs()), "{x}: {again}");
            }
        }
        // A value of any table: 97.5 % lie below 1.959964.
        assert!((normal_quantile(0.975) - 1.959_964).abs() < 1e-6);
    }

    #[test]
    fn neighbouring_seeds_and_streams_have_nothing_in_common() {
        let draw = |seed, purpose| {
            let mut rng = stream(seed, purpose);
            (0..10_000).map(|_| normal(&mut rng)).collect::<Vec<f64>>()
        };
        let one = draw(1, Stream::Jitter);
        let square: f64 = one.iter().map(|x| x * x).sum();
        // Over 10 000 draws the square's mean is 1 ± 0.014, a product's 0 ± 0.010.
        assert!((square / 1e4 - 1.0).abs() < 0.06);
        for other in [draw(2, Stream::Jitter), draw(1, Stream::Crystal)] {
            let product: f64 = one.iter().zip(&other).map(|(a, b)| a * b).sum();
            assert!((product / 1e4).abs() < 0.05);
        }
    }
}
