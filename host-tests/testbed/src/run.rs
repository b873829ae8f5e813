//! Runs of the experiment, and all of them together.
//!
//! *Purpose.* [`Run`]: one method, one seed, all boards. [`Experiment`]: every run that was
//! made, and how.
//!
//! *Design.* Plain data with the figures that files and report have in common.
//!
//! *Limits.* The figures of a method whose runs have no pair of good samples are not there.

use crate::method::Method;
use crate::pairing::{Difference, differences};
use crate::record::{Anomaly, Record};
use crate::statistics::{Estimate, Spread};

/// One method of keeping time, once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// The method.
    pub method: Method,
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
    /// The methods that were run, in their order.
    #[must_use]
    pub fn methods(&self) -> Vec<Method> {
        let mut methods: Vec<Method> = self.runs.iter().map(|run| run.method).collect();
        methods.dedup();
        methods
    }

    /// The runs of a method.
    pub fn runs_of(&self, method: Method) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.method == method)
    }

    /// The mean difference of a method in ns, over its runs.
    #[must_use]
    pub fn estimate(&self, method: Method) -> Option<Estimate> {
        let spreads = self.runs_of(method).filter_map(Run::spread);
        Estimate::of(&spreads.map(|spread| spread.mean).collect::<Vec<_>>())
    }

    /// The spread of a method's differences, all its runs together.
    #[must_use]
    pub fn spread(&self, method: Method) -> Option<Spread> {
        let all = self.runs_of(method).flat_map(Run::differences);
        Spread::of(all.map(|difference| difference.ns))
    }

    /// Whether every difference has nanoseconds, and not whole µs.
    #[must_use]
    pub fn is_to_the_ns(&self) -> bool {
        let records = self.runs.iter().flat_map(|run| &run.records);
        let mut good = records.flat_map(Record::good).peekable();
        good.peek().is_some() && good.all(|sample| sample.is_from_log)
    }

    /// The spread of each board's error to UTC under a method, all its runs together;
    /// empty where UTC is not known.
    #[must_use]
    pub fn errors(&self, method: Method) -> Vec<Spread> {
        let boards = self.runs_of(method).map(|run| run.records.len()).max();
        let of_board = |board: usize| {
            let records = self
                .runs_of(method)
                .filter_map(move |run| run.records.get(board));
            Spread::of(records.flat_map(|record| record.good().filter_map(|s| s.error_ns)))
        };
        (0..boards.unwrap_or(0)).filter_map(of_board).collect()
    }
}
