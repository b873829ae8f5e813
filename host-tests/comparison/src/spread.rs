//! How a lot of sizes are spread.
//!
//! *Purpose.* The columns of every table: mean, quantiles, largest.
//!
//! *Design.* Sizes are whole numbers, sorted; a quantile is the smallest size that
//! so large a share does not exceed. Nothing depends on the order in which they
//! came.
//!
//! *Limits.* All of them are held at once.

/// Mean, quantiles and the largest of a lot of sizes, in their unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// Half of them are no larger.
    pub p50: u32,
    /// 95 % are no larger.
    pub p95: u32,
    /// 99 % are no larger.
    pub p99: u32,
    /// The largest.
    pub max: u32,
}

impl Spread {
    /// The spread of `sizes`; none of nothing.
    #[must_use]
    pub fn of(mut sizes: Vec<u32>) -> Option<Self> {
        sizes.sort_unstable();
        Some(Self {
            mean: mean(&sizes)?,
            p50: quantile(&sizes, 0.50)?,
            p95: quantile(&sizes, 0.95)?,
            p99: quantile(&sizes, 0.99)?,
            max: *sizes.last()?,
        })
    }
}

/// The mean of `sizes`; none of nothing.
#[must_use]
pub fn mean(sizes: &[u32]) -> Option<f64> {
    let sum: u64 = sizes.iter().map(|&size| u64::from(size)).sum();
    (!sizes.is_empty()).then(|| sum as f64 / sizes.len() as f64)
}

/// The smallest of `sorted` that the share `share` does not exceed; none of nothing.
#[must_use]
pub fn quantile<T: Copy>(sorted: &[T], share: f64) -> Option<T> {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_numbers_are_their_own_percentiles() {
        let expected = Spread {
            mean: 50.5,
            p50: 50,
            p95: 95,
            p99: 99,
            max: 100,
        };
        assert_eq!(Spread::of((1..=100).rev().collect()), Some(expected));
        assert_eq!(Spread::of(vec![]), None);
        let one = Spread::of(vec![7]).map(|one| (one.mean, one.p50, one.p99));
        assert_eq!(one, Some((7.0, 7, 7)));
    }
}
