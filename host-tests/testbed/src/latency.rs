//! From a PING's leaving the host to its stamp.
//!
//! *Purpose.* [`Latency`] of each link, where the truth is known.
//!
//! *Design.* A board's time at a PING less the truth at its leaving: the link, and what the board's clock is off by.
//! Two links are compared PING by PING on boards that are equal in all else, which takes the clock out.
//!
//! *Limits.* The pulse's clock is off by some 30 ns, and by messages alone by some 60 ms: rows of the latter say
//! nothing of a link by themselves.

use comparison::spread::quantile;

use crate::case::Case;
use crate::link::Link;
use crate::record::Sample;
use crate::run::Experiment;

/// How much later some moments were than others. \[ns\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latency {
    /// How many.
    pub count: usize,
    /// The least.
    pub least: i64,
    /// The mean.
    pub mean: f64,
    /// 95 % are no greater.
    pub p95: i64,
    /// The greatest.
    pub greatest: i64,
    /// The standard deviation: the jitter.
    pub deviation: f64,
}

impl Latency {
    /// Of these values; none of nothing.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = i64>) -> Option<Self> {
        let mut values: Vec<i64> = values.into_iter().collect();
        values.sort_unstable();
        let p95 = quantile(&values, 0.95)?;
        let count = values.len() as f64;
        let mean = values.iter().map(|&value| value as f64).sum::<f64>() / count;
        let squares = values.iter().map(|&value| (value as f64 - mean).powi(2));
        Some(Self {
            count: values.len(),
            least: *values.first()?,
            mean,
            p95,
            greatest: *values.last()?,
            deviation: (squares.sum::<f64>() / count).sqrt(),
        })
    }
}

/// From the moments at which the PINGs of a row left to the stamps in the boards' logs, board by board; empty where UTC
/// is not known.
#[must_use]
pub fn latencies(experiment: &Experiment, case: Case) -> Vec<Latency> {
    let boards = experiment.runs_of(case).map(|run| run.records.len()).max();
    let of_board = |board: usize| {
        let records = experiment
            .runs_of(case)
            .filter_map(move |run| run.records.get(board));
        let late = |sample: &Sample| Some(sample.error_ns? + case.link.constant_ns());
        Latency::of(records.flat_map(|record| record.good().filter_map(late)))
    };
    (0..boards.unwrap_or(0)).filter_map(of_board).collect()
}

/// How much later the boards of a row stamped the same PINGs than over TELEM1, by their own logs and the truth; none
/// where TELEM1 was not run.
#[must_use]
pub fn beyond_telem1(experiment: &Experiment, case: Case) -> Option<Latency> {
    let twin = Case {
        link: Link::Telem1,
        ..case
    };
    let mut beyond = Vec::new();
    for run in experiment.runs_of(case) {
        let other = experiment
            .runs_of(twin)
            .find(|other| other.seed == run.seed)?;
        for (ours, theirs) in run.records.iter().zip(&other.records) {
            let mut theirs = theirs.good().filter(|sample| sample.is_from_log).peekable();
            for sample in ours.good().filter(|sample| sample.is_from_log) {
                while theirs
                    .next_if(|other| other.sequence < sample.sequence)
                    .is_some()
                {}
                let same = theirs.next_if(|other| other.sequence == sample.sequence);
                if let Some((at, before)) = sample.error_ns.zip(same.and_then(|same| same.error_ns))
                {
                    let constant = case.link.constant_ns() - twin.link.constant_ns();
                    beyond.push(at - before + constant);
                }
            }
        }
    }
    Latency::of(beyond)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latency_has_its_ends_its_mean_and_its_jitter() {
        let latency = Latency::of([30, -10, 10, 10]).unwrap();
        assert_eq!((latency.least, latency.greatest), (-10, 30));
        assert_eq!((latency.mean, latency.count), (10.0, 4));
        assert!((latency.deviation - 200_f64.sqrt()).abs() < 1e-9);
        assert_eq!(Latency::of([]), None);
    }
}
