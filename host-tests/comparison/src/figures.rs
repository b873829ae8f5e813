//! The figures of a case: its trials, pooled.
//!
//! *Purpose.* What the table shows and the bounds judge.
//!
//! *Design.* The differences of all trials are pooled; only the worst mean and the
//! convergence are a trial's own.
//!
//! *Limits.* Quantiles of the time to converge are as fine as there are trials.

use crate::baselines;
use crate::case::{Case, Temperature};
use crate::spread::{Spread, mean, quantile};
use crate::trial::{Own, Trial};

/// A candidate in a case. Times are in ns.
#[derive(Clone, Debug)]
pub struct Row {
    /// Its name.
    pub name: &'static str,
    /// The difference between the two boards in the window.
    pub spread: Spread,
    /// The largest mean of a trial.
    pub worst_mean: f64,
    /// The seed and the temperature of that trial.
    pub worst: (u64, Temperature),
    /// The trial with the largest difference of all.
    pub largest: (u64, Temperature),
    /// When each trial had converged, after the start, sorted.
    pub converged_at: Vec<u64>,
}

/// A case's figures.
#[derive(Clone, Debug)]
pub struct Figures {
    /// The case.
    pub case: &'static Case,
    /// The number of trials that were pooled.
    pub trials: usize,
    /// Ours first, then the baselines.
    pub rows: Vec<Row>,
    /// The difference between the two floors in the window. \[ns\]
    pub floors: Spread,
    /// Ours over that of the floors, both as means over all times.
    pub ever_over_floors: f64,
    /// The share of errors within their uncertainty.
    pub coverage: f64,
    /// The share of errors against UTC within the sum of it and the uncertainty of an
    /// unknown latency.
    pub coverage_utc: f64,
    /// The mean uncertainty over the mean error.
    pub width: f64,
    /// How far the rates of whole minutes were off. \[10⁻¹²\]
    pub rates: Option<Spread>,
    /// By how much the difference changed from a loss to the window. \[ns\]
    pub grown: Option<Spread>,
    /// Readings that violate an invariant.
    pub violations: u32,
    /// What the first of them did.
    pub first_violation: Option<String>,
}

impl Figures {
    /// The figures of `trials`; none if no candidate published in the window.
    #[must_use]
    pub fn of(case: &'static Case, trials: Vec<Trial>) -> Option<Self> {
        let candidates = trials.first()?.tracks.len();
        let rows = baselines::candidates()
            .take(candidates)
            .enumerate()
            .map(|(index, name)| row(name, index, &trials))
            .collect::<Option<Vec<_>>>()?;
        let count = trials.len();
        let mut floors = Vec::new();
        let mut ever = (0, 0);
        let mut grown = Vec::new();
        let mut own = Own::default();
        for trial in trials {
            floors.extend(trial.floors);
            ever.0 += trial.ever.0;
            ever.1 += trial.ever.1;
            grown.extend(trial.own.grown);
            own.errors.extend(trial.own.errors);
            own.rates.extend(trial.own.rates);
            own.uncertainty_sum += trial.own.uncertainty_sum;
            own.covered += trial.own.covered;
            own.covered_utc += trial.own.covered_utc;
            own.violations += trial.own.violations;
            own.first_violation = own.first_violation.or(trial.own.first_violation);
        }
        let readings = own.errors.len() as f64;
        Some(Self {
            case,
            trials: count,
            rows,
            floors: Spread::of(floors)?,
            ever_over_floors: ever.0 as f64 / ever.1 as f64,
            coverage: own.covered as f64 / readings,
            coverage_utc: own.covered_utc as f64 / readings,
            width: own.uncertainty_sum as f64 / readings / mean(&own.errors)?,
            rates: Spread::of(own.rates),
            grown: Spread::of(grown),
            violations: own.violations,
            first_violation: own.first_violation,
        })
    }

    /// The simulated time of all its boards together. \[s\]
    #[must_use]
    pub const fn simulated_s(&self) -> u64 {
        2 * self.trials as u64 * self.case.end_s()
    }

    /// Ours.
    #[must_use]
    pub fn ours(&self) -> &Row {
        &self.rows[0]
    }

    /// The least of a figure among the baselines; none where they do not take part.
    #[must_use]
    pub fn best_baseline(&self, figure: impl Fn(&Row) -> f64) -> Option<f64> {
        self.rows[1..].iter().map(figure).reduce(f64::min)
    }
}

impl Row {
    /// The share of the trials that had converged by `s` seconds after the start.
    #[must_use]
    pub fn converged_by(&self, s: u64) -> f64 {
        let limit = s * crate::case::SECOND;
        let by = self.converged_at.partition_point(|&at| at <= limit);
        by as f64 / self.converged_at.len() as f64
    }

    /// When 95 % of the trials had converged, after the start. \[ns\]
    #[must_use]
    pub fn converged_p95(&self) -> u64 {
        quantile(&self.converged_at, 0.95).unwrap_or(u64::MAX)
    }
}

fn row(name: &'static str, index: usize, trials: &[Trial]) -> Option<Row> {
    let tracks = || trials.iter().map(|trial| &trial.tracks[index]);
    let pooled = tracks().flat_map(|track| &track.differences).copied();
    let means = trials.iter().filter_map(|trial| {
        let mean = mean(&trial.tracks[index].differences)?;
        Some((mean, (trial.seed, trial.temperature)))
    });
    let (worst_mean, worst) = means.max_by(|one, other| one.0.total_cmp(&other.0))?;
    let largest = trials
        .iter()
        .max_by_key(|trial| trial.tracks[index].differences.iter().max().copied())?;
    let mut converged_at: Vec<_> = tracks().map(|track| track.converged_at).collect();
    converged_at.sort_unstable();
    Some(Row {
        name,
        spread: Spread::of(pooled.collect())?,
        worst_mean,
        worst,
        largest: (largest.seed, largest.temperature),
        converged_at,
    })
}
