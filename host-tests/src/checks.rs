//! Conditions on many runs.
//!
//! *Purpose.* A test over seeds and cases reports every condition that failed, with its seed and
//! its case, and not only the first.

use std::fmt::{Debug, Display};

use board_model::{Sample, coverage};

/// What failed so far, and the run that is being checked.
#[derive(Debug, Default)]
pub struct Checks {
    run: String,
    failed: Vec<String>,
}

impl Checks {
    /// Demands that `holds`; `what` describes what was found.
    pub fn that(&mut self, holds: bool, what: impl Display) {
        if !holds {
            self.failed.push(format!("{}: {what}", self.run));
        }
    }

    /// Demands that `value` is no more than `limit`.
    pub fn at_most<T: PartialOrd + Display>(&mut self, what: &str, value: T, limit: T) {
        let holds = value <= limit;
        self.that(holds, format_args!("{what}: {value}, at most {limit}"));
    }

    /// Demands that `value` is no less than `limit`.
    pub fn at_least<T: PartialOrd + Display>(&mut self, what: &str, value: T, limit: T) {
        let holds = value >= limit;
        self.that(holds, format_args!("{what}: {value}, at least {limit}"));
    }

    /// Demands that `value` is `expected`.
    pub fn equal<T: PartialEq + Debug>(&mut self, what: &str, value: T, expected: T) {
        let holds = value == expected;
        self.that(holds, format_args!("{what}: {value:?}, not {expected:?}"));
    }

    /// Demands that 95 % of the errors are within their uncertainty.
    pub fn covered(&mut self, samples: impl IntoIterator<Item = Sample>) {
        self.at_least("coverage", coverage(samples), 0.95);
    }

    fn finish(self) {
        assert!(self.failed.is_empty(), "{:#?}", self.failed);
    }
}

/// Runs `check` for each of `cases`; they name themselves in what is reported.
///
/// # Panics
///
/// At the end, if a condition failed.
pub fn each<C: Debug>(cases: impl IntoIterator<Item = C>, mut check: impl FnMut(&mut Checks, &C)) {
    let mut checks = Checks::default();
    for case in cases {
        checks.run = format!("{case:?}");
        check(&mut checks, &case);
    }
    checks.finish();
}

/// Runs `check` for each of `cases` with each of `seeds`.
///
/// # Panics
///
/// As [`each`].
pub fn each_seed<C: Copy + Debug>(
    seeds: impl IntoIterator<Item = u64>,
    cases: impl AsRef<[C]>,
    mut check: impl FnMut(&mut Checks, u64, C),
) {
    let mut checks = Checks::default();
    for seed in seeds {
        for case in cases.as_ref() {
            checks.run = format!("seed {seed}, {case:?}");
            check(&mut checks, seed, *case);
        }
    }
    checks.finish();
}
