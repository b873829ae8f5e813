//! Statistics of many differences.
//!
//! *Purpose.* A mean and percentiles of sizes, and the confidence interval of a mean
//! over several seeds.
//!
//! *Design.* Sizes are in ns. Samples of one run are not independent, since a clock
//! that is off stays so for a while; runs of different seeds are. So an interval is
//! made of the runs' means alone, by Student's t.
//!
//! *Limits.* With few seeds, the interval trusts the means to be distributed normally.

use comparison::spread::quantile;

/// Many sizes. \[ns\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Half of them are no larger.
    pub p50: u64,
    /// 95 % are no larger.
    pub p95: u64,
    /// 99 % are no larger.
    pub p99: u64,
    /// The largest.
    pub max: u64,
}

impl Spread {
    /// The spread of the sizes of `values`; none of nothing.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = i64>) -> Option<Self> {
        let mut sizes: Vec<u64> = values.into_iter().map(i64::unsigned_abs).collect();
        sizes.sort_unstable();
        Some(Self {
            count: sizes.len(),
            mean: mean(sizes.iter().map(|&size| size as f64))?,
            p50: quantile(&sizes, 0.50)?,
            p95: quantile(&sizes, 0.95)?,
            p99: quantile(&sizes, 0.99)?,
            max: *sizes.last()?,
        })
    }
}

/// A mean, and how far it may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The mean of the runs' means.
    pub mean: f64,
    /// Half the width of its 95 % confidence interval; none from a single run.
    pub half_width: Option<f64>,
    /// How many runs.
    pub runs: usize,
}

impl Estimate {
    /// The estimate from each run's mean; none without a run.
    #[must_use]
    pub fn of(means: &[f64]) -> Option<Self> {
        let runs = means.len();
        let centre = mean(means.iter().copied())?;
        let half_width = (runs > 1).then(|| {
            let squares = means
                .iter()
                .map(|mean| (mean - centre).powi(2))
                .sum::<f64>();
            let deviation = (squares / (runs - 1) as f64).sqrt();
            student(runs - 1) * deviation / (runs as f64).sqrt()
        });
        Some(Self {
            mean: centre,
            half_width,
            runs,
        })
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u64), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Student's t at 97.5 % with `freedom` degrees of freedom: exact for one and two, then by
/// Cornish and Fisher's expansion about the normal quantile (Abramowitz and Stegun,
/// 26.7.5).
fn student(freedom: usize) -> f64 {
    const Z: f64 = 1.959_963_984_540_054;
    match freedom {
        1 => 12.706_204_736,
        2 => 4.302_652_730,
        _ => {
            let n = freedom as f64;
            let z2 = Z * Z;
            let g1 = Z * (z2 + 1.0) / 4.0;
            let g2 = Z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
            let g3 = Z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
            let g4 =
                Z * ((((79.0 * z2 + 776.0) * z2 + 1_482.0) * z2 - 1_920.0) * z2 - 945.0) / 92_160.0;
            Z + g1 / n + g2 / n.powi(2) + g3 / n.powi(3) + g4 / n.powi(4)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_of_sizes() {
        let spread = Spread::of((1..=100).map(|n| if n % 2 == 0 { n } else { -n })).unwrap();
        let percentiles = [spread.p50, spread.p95, spread.p99, spread.max];
        assert_eq!(percentiles, [50, 95, 99, 100]);
        assert_eq!((spread.count, spread.mean), (100, 50.5));
        assert_eq!(Spread::of([]), None);
    }

    #[test]
    fn students_t_is_that_of_the_tables() {
        for (freedom, table) in [
            (1, 12.706),
            (2, 4.303),
            (3, 3.182),
            (4, 2.776),
            (9, 2.262),
            (19, 2.093),
            (120, 1.980),
        ] {
            let t = student(freedom);
            assert!((t - table).abs() < 0.012, "{freedom}: {t} for {table}");
        }
    }

    #[test]
    fn an_interval_needs_two_runs() {
        let one = Estimate::of(&[5.0]).unwrap();
        assert_eq!((one.mean, one.half_width), (5.0, None));
        // Mean 5, deviation 1, four runs.
        let four = Estimate::of(&[4.0, 4.0 + 1.0 / 3.0, 5.0, 6.0 + 2.0 / 3.0]).unwrap();
        let deviation = [1.0, 2.0 / 3.0, 0.0, 5.0 / 3.0].map(|x: f64| x * x);
        let deviation = (deviation.iter().sum::<f64>() / 3.0).sqrt();
        let expected = 3.182 * deviation / 2.0;
        assert!((four.half_width.unwrap() - expected).abs() < 0.01);
        assert_eq!(Estimate::of(&[]), None);
    }
}
