//! Which samples belong together, and how far they are apart.
//!
//! *Purpose.* The difference between two boards' times at the same PING.
//!
//! *Design.* Samples are paired by the PING's number. Where a host sends, two PINGs of
//! one number do not leave at quite the same moment: the difference of their sending
//! times is taken off. Where one of the two times has whole µs, whole µs are compared.
//! A PING whose round trip was long may have waited on its way to the board, so that its
//! moment of arrival is not known: [`discard_late`] takes those out, board by board.
//! Every board is held against the first.
//!
//! *Limits.* A delay in both directions alike, and a constant difference between the two
//! boards' lines, show in no round trip.

use comparison::spread::quantile;

use crate::record::{Record, Sample, Verdict};

/// A round trip is late when it exceeds the least by more than this many times the median's
/// excess.
const LATE: i64 = 4;
/// A round trip this close to the least is never late: the time that a byte takes at 115200
/// baud. \[ns\]
const NEVER_LATE_NS: i64 = 86_806;

/// How far a board was from the first at one PING.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The PING's number.
    pub sequence: u32,
    /// When it left for the first board, in ns since the test's start.
    pub at_ns: i64,
    /// The board, counted from 0; never 0.
    pub board: usize,
    /// Its time less the first's. \[ns\]
    pub ns: i64,
}

/// Every difference between good samples, in the order of their PINGs.
#[must_use]
pub fn differences(records: &[Record]) -> Vec<Difference> {
    let Some((first, others)) = records.split_first() else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for (board, other) in (1..).zip(others) {
        let mut theirs = other.good().peekable();
        for ours in first.good() {
            while theirs.next_if(|s| s.sequence < ours.sequence).is_some() {}
            if let Some(theirs) = theirs.next_if(|s| s.sequence == ours.sequence) {
                found.push(difference(board, ours, theirs));
            }
        }
    }
    found.sort_by_key(|difference| (difference.sequence, difference.board));
    found
}

fn difference(board: usize, ours: &Sample, theirs: &Sample) -> Difference {
    let are_fine = ours.is_from_log && theirs.is_from_log;
    let unit = if are_fine { 1 } else { 1_000 };
    let apart = theirs.board_ns / unit - ours.board_ns / unit;
    Difference {
        sequence: ours.sequence,
        at_ns: ours.sent_ns,
        board,
        ns: apart * unit - (theirs.sent_ns - ours.sent_ns),
    }
}

/// Marks the samples whose round trip was too long, and returns the limit; none without a
/// sample. \[ns\]
pub fn discard_late(record: &mut Record) -> Option<i64> {
    let mut trips: Vec<i64> = record.good().map(|sample| sample.round_trip_ns).collect();
    trips.sort_unstable();
    let least = *trips.first()?;
    let median = quantile(&trips, 0.5)?;
    let limit = least + (LATE * (median - least)).max(NEVER_LATE_NS);
    for sample in &mut record.samples {
        if sample.verdict == Verdict::Good && sample.round_trip_ns > limit {
            sample.verdict = Verdict::Late;
        }
    }
    Some(limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(sequence: u32, sent_ns: i64, board_us: i64) -> Sample {
        Sample {
            sequence,
            sent_ns,
            board_ns: board_us * 1_000,
            is_from_log: false,
            round_trip_ns: 1_000_000,
            error_ns: None,
            verdict: Verdict::Good,
        }
    }

    fn record(samples: Vec<Sample>) -> Record {
        Record {
            samples,
            ..Record::default()
        }
    }

    #[test]
    fn pairs_are_those_of_one_number_whatever_is_missing_elsewhere() {
        let first = record([0, 1, 3, 4].map(|n| sample(n, 0, 1_000)).to_vec());
        let mut second = record([1, 2, 3, 5].map(|n| sample(n, 0, 1_010)).to_vec());
        let third = record([4, 5].map(|n| sample(n, 0, 990)).to_vec());
        second.samples[2].verdict = Verdict::NotSet;
        let found: Vec<_> = differences(&[first, second, third])
            .iter()
            .map(|d| (d.sequence, d.board, d.ns))
            .collect();
        assert_eq!(found, [(1, 1, 10_000), (4, 2, -10_000)]);
        assert_eq!(differences(&[]), []);
    }

    #[test]
    fn what_left_later_was_expected_to_be_later() {
        let first = record(vec![sample(0, 0, 5_000)]);
        let second = record(vec![sample(0, 250_000, 5_260)]);
        assert_eq!(differences(&[first, second])[0].ns, 10_000);
    }

    #[test]
    fn nanoseconds_count_where_both_boards_have_them() {
        let fine = |board_ns| Sample {
            board_ns,
            is_from_log: true,
            ..sample(0, 0, 0)
        };
        let apart = |one, other| differences(&[record(vec![one]), record(vec![other])])[0].ns;
        assert_eq!(apart(fine(5_000_990), fine(5_001_020)), 30);
        // The answer 5.001 ms may be of up to 5.001999 ms.
        assert_eq!(apart(fine(5_000_990), sample(0, 0, 5_001)), 1_000);
    }

    #[test]
    fn the_slow_ones_are_discarded_and_a_steady_line_loses_nothing() {
        let mut steady = record((0..100).map(|n| sample(n, 0, 0)).collect());
        for (n, sample) in steady.samples.iter_mut().enumerate() {
            sample.round_trip_ns += n as i64 * 800;
        }
        assert_eq!(discard_late(&mut steady), Some(1_156_800));
        assert_eq!(steady.good().count(), 100);
        for sample in steady.samples.iter_mut().step_by(10) {
            sample.round_trip_ns += 5_000_000;
        }
        discard_late(&mut steady);
        assert_eq!(steady.good().count(), 90);
        assert_eq!(discard_late(&mut record(Vec::new())), None);
    }
}
