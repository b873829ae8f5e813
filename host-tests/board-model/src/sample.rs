//! What readers of the clock saw, beside the truth.

use utc_clock::ClockState;

/// A reading of a set clock, and its error.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// True time since the start. \[ns\]
    pub at_ns: i64,
    /// The reading less UTC. \[ns\]
    pub error_ns: i64,
    /// The uncertainty that the reading stated. \[ns\]
    pub uncertainty_ns: u64,
    /// Set, or in holdover.
    pub state: ClockState,
}

/// The largest error; `i64::MAX` of no sample at all. \[ns\]
pub fn worst_ns(samples: impl IntoIterator<Item = Sample>) -> i64 {
    let errors = samples.into_iter().map(|sample| sample.error_ns.abs());
    errors.max().unwrap_or(i64::MAX)
}

/// The share of samples whose error is within their uncertainty, from 0 to 1; not a number of no
/// sample at all.
pub fn coverage(samples: impl IntoIterator<Item = Sample>) -> f64 {
    let (mut covered, mut all) = (0.0, 0.0);
    for sample in samples {
        all += 1.0;
        if sample.error_ns.unsigned_abs() <= sample.uncertainty_ns {
            covered += 1.0;
        }
    }
    covered / all
}
