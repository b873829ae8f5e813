//! The bounds, as data, and their verdicts.
//!
//! *Purpose.* One table of what our clock has to keep, for the tests, for CI and for
//! the printed figures.
//!
//! *Design.* A bound is a quantity of a case's [`Figures`] and a limit. Limits on
//! rates follow from those on phases: what moves from −p99 to +p99 in a minute has
//! that rate.
//!
//! *Limits.* Soft edges and correlated jitter have bounds on their uncertainty
//! alone. A floor that wanders more slowly than in 10 min is invisible to every clock:
//! there the uncertainty is reported.

use crate::case::{Case, Floor};
use crate::figures::Figures;

/// What can be bounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// The mean difference. \[ns\]
    Mean,
    /// 95 % of it.
    P95,
    /// 99 % of it.
    P99,
    /// The largest.
    Max,
    /// The largest mean of a trial.
    WorstMean,
    /// The change of the difference from a loss to the window: 95 % of it. \[ns\]
    GrownP95,
    /// The largest change.
    GrownMax,
    /// The rate over a minute, 99 % of it. \[ppb\]
    Rate,
    /// The mean over that of the best baseline.
    MeanOverBaselines,
    /// 99 % over that of the best baseline.
    P99OverBaselines,
    /// The mean of a clock that is set at every mark, over ours.
    PaperOverMean,
    /// The mean over that of the floors.
    MeanOverFloors,
    /// 99 % over 99 % of the floors'.
    P99OverFloors,
    /// The mean over that of the floors, at all times.
    EverOverFloors,
    /// The share of trials that had converged that many seconds after the start.
    ConvergedBy(u64),
    /// The share of errors within their uncertainty.
    Coverage,
    /// The same against UTC, with the uncertainty of an unknown latency.
    CoverageUtc,
    /// The mean uncertainty over the mean error.
    Width,
    /// Readings that violate an invariant.
    Violations,
}

use Quantity::{
    ConvergedBy, Coverage, CoverageUtc, EverOverFloors, GrownMax, GrownP95, Max, Mean,
    MeanOverBaselines, MeanOverFloors, P95, P99, P99OverBaselines, P99OverFloors, PaperOverMean,
    Rate, Violations, Width, WorstMean,
};

/// A quantity of a case, and its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// What is bounded.
    pub quantity: Quantity,
    /// By what: the most, or the least for shares and [`PaperOverMean`].
    pub limit: f64,
}

/// What a bound's quantity was, and whether that is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// The bound.
    pub bound: Bound,
    /// The quantity.
    pub measured: f64,
    /// Whether the bound holds.
    pub holds: bool,
}

const MS: f64 = 1e6;
const US: f64 = 1e3;

/// What each case is bounded by, beside what holds `everywhere`.
const TABLE: [(&str, &[(Quantity, f64)]); 16] = [
    (
        "m8",
        &[
            (Mean, 0.12 * MS),
            (P99, 0.40 * MS),
            (Max, 1.0 * MS),
            (WorstMean, 0.22 * MS),
            (Rate, 2.0 * 0.40 * MS / 60.0),
            (MeanOverBaselines, 0.5),
            (P99OverBaselines, 0.5),
            (PaperOverMean, 50.0),
            (ConvergedBy(60), 0.95),
            (Width, 4.0),
        ],
    ),
    (
        "harsh",
        &[
            (Mean, 0.45 * MS),
            (P99, 1.8 * MS),
            (Rate, 2.0 * 1.8 * MS / 60.0),
            (MeanOverBaselines, 0.5),
            (P99OverBaselines, 0.5),
            (PaperOverMean, 50.0),
            (ConvergedBy(60), 0.95),
            (Width, 4.0),
        ],
    ),
    (
        "f9",
        &[
            (Mean, 0.06 * MS),
            (P99, 0.22 * MS),
            (Rate, 2.0 * 0.22 * MS / 60.0),
            (MeanOverBaselines, 0.5),
            (P99OverBaselines, 0.5),
            (PaperOverMean, 50.0),
            (Width, 4.0),
        ],
    ),
    ("stored", &[(ConvergedBy(10), 0.93), (Width, 4.0)]),
    ("wander-60s", SEEN),
    ("wander-2min", SEEN),
    ("wander-4min", SEEN),
    ("wander-10min", SEEN),
    ("wander-30min", ANY_PERIOD),
    ("wander-1h", ANY_PERIOD),
    ("wander-walk", ANY_PERIOD),
    (
        "pulse",
        &[
            (Mean, 32.0),
            (P99, 105.0),
            (Max, 250.0),
            (Rate, 2.0 * 105.0 / 60.0),
            (Width, 4.0),
        ],
    ),
    (
        "pulse-constant",
        &[(Mean, 22.0), (Max, 130.0), (Width, 4.0)],
    ),
    ("pulse-timtp", &[(Width, 4.0)]),
    ("pulse-lost", &[(P95, 1.5 * US), (Max, 3.0 * US)]),
    // What holdover adds: the difference itself begins with that of the lock.
    (
        "messages-lost",
        &[(GrownP95, 100.0 * US), (GrownMax, 200.0 * US)],
    ),
];

/// A wander of at most 10 min, which can be distinguished from a crystal's drift.
const SEEN: &[(Quantity, f64)] = &[
    (MeanOverFloors, 0.8),
    (P99OverFloors, 1.0),
    (EverOverFloors, 1.2),
];
const ANY_PERIOD: &[(Quantity, f64)] = &[(EverOverFloors, 1.2)];

/// What holds in all cases.
fn everywhere(case: &Case) -> Vec<(Quantity, f64)> {
    let mut bounds = vec![(Violations, 0.0), (CoverageUtc, 0.95)];
    let is_visible = match case.floor {
        Floor::Still => true,
        Floor::Sine { .. } | Floor::Walk => false,
    };
    if is_visible {
        bounds.push((Coverage, 0.95));
    }
    bounds
}

/// The bounds of a case.
#[must_use]
pub fn of(case: &Case) -> Vec<Bound> {
    let own = TABLE.iter().find(|(name, _)| *name == case.name);
    let own = own.map_or(&[][..], |(_, bounds)| bounds).iter().copied();
    own.chain(everywhere(case))
        .map(|(quantity, limit)| Bound { quantity, limit })
        .collect()
}

/// Judges a case by all its bounds.
#[must_use]
pub fn judge(figures: &Figures) -> Vec<Verdict> {
    of(figures.case)
        .into_iter()
        .map(|bound| {
            let measured = bound.quantity.of(figures);
            let holds = if bound.quantity.is_at_least() {
                measured >= bound.limit
            } else {
                measured <= bound.limit
            };
            Verdict {
                bound,
                measured,
                holds,
            }
        })
        .collect()
}

impl Quantity {
    /// Whether a larger one is better.
    #[must_use]
    pub const fn is_at_least(self) -> bool {
        matches!(
            self,
            PaperOverMean | ConvergedBy(_) | Coverage | CoverageUtc
        )
    }

    /// What it is in `figures`; not a number, which no bound allows, where it has no
    /// meaning.
    #[must_use]
    pub fn of(self, figures: &Figures) -> f64 {
        let ours = figures.ours();
        let spread = &ours.spread;
        let grown = figures.grown;
        let best = |figure: fn(&crate::figures::Row) -> f64| {
            figures.best_baseline(figure).unwrap_or(f64::NAN)
        };
        match self {
            Mean => spread.mean,
            P95 => f64::from(spread.p95),
            P99 => f64::from(spread.p99),
            Max => f64::from(spread.max),
            WorstMean => ours.worst_mean,
            GrownP95 => grown.map_or(f64::NAN, |grown| f64::from(grown.p95)),
            GrownMax => grown.map_or(f64::NAN, |grown| f64::from(grown.max)),
            Rate => figures
                .rates
                .map_or(f64::NAN, |rates| f64::from(rates.p99) * 1e-3),
            MeanOverBaselines => spread.mean / best(|row| row.spread.mean),
            P99OverBaselines => f64::from(spread.p99) / best(|row| f64::from(row.spread.p99)),
            PaperOverMean => {
                let paper = figures.rows.iter().find(|row| row.name == "paper");
                paper.map_or(f64::NAN, |paper| paper.spread.mean) / spread.mean
            }
            MeanOverFloors => spread.mean / figures.floors.mean,
            P99OverFloors => f64::from(spread.p99) / f64::from(figures.floors.p99),
            EverOverFloors => figures.ever_over_floors,
            ConvergedBy(s) => ours.converged_by(s),
            Coverage => figures.coverage,
            CoverageUtc => figures.coverage_utc,
            Width => figures.width,
            Violations => f64::from(figures.violations),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_the_table_is_of_a_case() {
        for (name, bounds) in TABLE {
            assert!(crate::case::find(name).is_some(), "{name}");
            assert!(!bounds.is_empty());
        }
    }
}
