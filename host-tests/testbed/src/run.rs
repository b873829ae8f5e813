//! Runs of the experiment, and all of them together.
//!
//! *Purpose.* [`Run`]: one method, one seed, all boards. [`Experiment`]: every run that was
//! made, and how.
//!
//! *Design.* Plain data with the figures that files and report have in common.
//!
//! *Limits.* The figures of a method whose runs have no pair of good samples are not there.

use crate::case::Case;
use crate::method::Method;
use crate::pairing::{Difference, differences};
use crate::record::{Anomaly, Record};
use crate::statistics::{Estimate, Spread};

/// One method of keeping time, once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// The method, the load, the receivers and the link.
    pub case: Case,
    /// Where its chance came from.
    pub seed: u64,
    /// How long it lasted, in s: less than was asked for if it was cut short.
    pub lasted_s: u32,
    /// Each board's part.
    pub records: Vec<Record>,
    /// Round trips up to which a sample is used, in ns, board by board; empty where none
    /// is late.
    pub late_ns: Vec<i64>,
}

impl Run {
    /// How far the boards were apart at each PING.
    #[must_use]
    pub fn differences(&self) -> Vec<Difference> {
        differences(&self.records)
    }

    /// The spread of the differences.
    #[must_use]
    pub fn spread(&self) -> Option<Spread> {
        Spread::of(self.differences().iter().map(|difference| difference.ns))
    }

    /// PINGs that no answer came to, over all boards.
    #[must_use]
    pub fn missing(&self) -> usize {
        let of = |record: &Record| (record.asked as usize).saturating_sub(record.samples.len());
        self.records.iter().map(of).sum()
    }

    /// Frames that the boards counted as not sent because their line was full; none where
    /// they were not asked.
    #[must_use]
    pub fn line_full(&self) -> Option<u32> {
        self.records.iter().map(|record| record.line_full).sum()
    }

    /// Ticks that the boards lost during the test, over all boards; none where that is not known.
    #[must_use]
    pub fn lost_ticks(&self) -> Option<u32> {
        self.records.iter().map(|record| record.lost_ticks).sum()
    }

    /// Bytes that the boards' lines lost, over all boards; none where that is not known.
    #[must_use]
    pub fn overruns(&self) -> Option<u32> {
        self.records.iter().map(|record| record.overruns).sum()
    }

    /// Each anomaly with the name of its board.
    pub fn anomalies(&self) -> impl Iterator<Item = (&str, &Anomaly)> {
        self.records.iter().flat_map(|record| {
            let name = record.name.as_str();
            record.anomalies.iter().map(move |anomaly| (name, anomaly))
        })
    }
}

/// Where the boards are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the process, with the truth known.
    Virtual,
    /// On QEMU.
    Qemu,
    /// On lines of this host.
    Lines,
    /// All of them on one line of this host.
    OneLine,
}

/// Every run, and how it was made.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The command that repeats it.
    pub command: String,
    /// PINGs a second.
    pub rate_hz: u32,
    /// Where the boards are.
    pub place: Place,
    /// The conditions of the experiment in the report: name and value.
    pub conditions: Vec<(&'static str, String)>,
    /// The runs, method by method.
    pub runs: Vec<Run>,
    /// Why it ended before its time, if it did.
    pub cut_short: Option<String>,
}

impl Experiment {
    /// The rows: what was run, in its order.
    #[must_use]
    pub fn cases(&self) -> Vec<Case> {
        let mut cases: Vec<Case> = self.runs.iter().map(|run| run.case).collect();
        cases.dedup();
        cases
    }

    /// The row of a method without a load, with the first of the receivers and links, if it was run.
    #[must_use]
    pub fn plain(&self, method: Method) -> Option<Case> {
        let cases = self.cases().into_iter();
        cases
            .filter(|case| case.method == method && case.load == 0)
            .min_by_key(|case| (case.receivers, case.link))
    }

    /// The runs of a row.
    pub fn runs_of(&self, case: Case) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.case == case)
    }

    /// The mean difference of a row in ns, over its runs.
    #[must_use]
    pub fn estimate(&self, case: Case) -> Option<Estimate> {
        let spreads = self.runs_of(case).filter_map(Run::spread);
        Estimate::of(&spreads.map(|spread| spread.mean).collect::<Vec<_>>())
    }

    /// By how much less than the default's the mean difference of one of the paper's methods is, under the same load
    /// and with the same receivers: a share. The paper's own is 84.1 %, from 21.64 ms to 3.44.
    #[must_use]
    pub fn reduction(&self, case: Case) -> Option<f64> {
        let of_default = |method| {
            let default = Case { method, ..case };
            self.estimate(default).map(|estimate| estimate.mean)
        };
        let default =
            of_default(Method::PaperDefaultMixed).or_else(|| of_default(Method::PaperDefault))?;
        Some(1.0 - self.estimate(case)?.mean / default)
    }

    /// The spread of a row's differences, all its runs together.
    #[must_use]
    pub fn spread(&self, case: Case) -> Option<Spread> {
        let all = self.runs_of(case).flat_map(Run::differences);
        Spread::of(all.map(|difference| difference.ns))
    }

    /// Whether every difference has nanoseconds, and not whole µs.
    #[must_use]
    pub fn is_to_the_ns(&self) -> bool {
        let records = self.runs.iter().flat_map(|run| &run.records);
        let mut good = records.flat_map(Record::good).peekable();
        good.peek().is_some() && good.all(|sample| sample.is_from_log)
    }

    /// The spread of each board's error to UTC in a row, all its runs together;
    /// empty where UTC is not known.
    #[must_use]
    pub fn errors(&self, case: Case) -> Vec<Spread> {
        let boards = self.runs_of(case).map(|run| run.records.len()).max();
        let of_board = |board: usize| {
            let records = self
                .runs_of(case)
                .filter_map(move |run| run.records.get(board));
            Spread::of(records.flat_map(|record| record.good().filter_map(|s| s.error_ns)))
        };
        (0..boards.unwrap_or(0)).filter_map(of_board).collect()
    }
}
