//! How far two nodes are apart.
//!
//! *Purpose.* Two nodes that are asked at the same time disagree by what their clocks disagree by,
//! and by what this host does not know about the moments at which its requests arrived.
//!
//! *Design.* Each answer has a [`Window`](super::answer::Window) for that moment. The middles give
//! the difference; half of both windows together is its uncertainty, which is proved: half the sum
//! of the round trips, less the bytes' own time where it is known. If a request takes the same share
//! of its round trip on both lines, what is not known is the same for both and cancels, but for half
//! the difference of the round trips. Nothing here shows that this is so: it is an assumption, and
//! is called one.
//!
//! *Limits.* A virtual board that is behind this host's clock is a node whose clock is late.

use std::fmt;

use console::units;
use serde_json::{Value, json};

use super::answer::Answer;

/// The difference of two nodes in one round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Apart {
    /// The number of the request.
    pub seq: u32,
    /// The first node's clock less the second's, in ns.
    pub ns: i64,
    /// How far that may be off at most, in ns.
    pub proved_ns: u64,
    /// How far if both ways are alike, in ns.
    pub if_alike_ns: u64,
}

impl Apart {
    /// Of two answers to requests of one round; `None` while a clock is not set.
    pub fn of(first: &Answer, second: &Answer) -> Option<Self> {
        let (one, other) = (first.window(), second.window());
        let of_nodes = first.utc_ns()? - second.utc_ns()?;
        Some(Self {
            seq: first.seq,
            ns: of_nodes - (one.middle_ns - other.middle_ns),
            proved_ns: one.half_ns + other.half_ns,
            if_alike_ns: one.half_ns.abs_diff(other.half_ns),
        })
    }

    pub fn to_json(self) -> Value {
        json!({
            "seq": self.seq,
            "apart_ns": self.ns,
            "proved_ns": self.proved_ns,
            "if_alike_ns": self.if_alike_ns,
        })
    }
}

impl fmt::Display for Apart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "apart {}, ± {} proved, ± {} if both ways are alike",
            units::difference(self.ns),
            units::magnitude(self.proved_ns),
            units::magnitude(self.if_alike_ns),
        )
    }
}

/// All rounds of two nodes.
#[derive(Clone, Debug, Default)]
pub struct Pair {
    rounds: Vec<Apart>,
}

impl Pair {
    /// Adds a round.
    pub fn push(&mut self, apart: Apart) {
        self.rounds.push(apart);
    }

    /// The round that proves most.
    fn best(&self) -> Option<Apart> {
        self.rounds
            .iter()
            .copied()
            .min_by_key(|apart| apart.proved_ns)
    }

    /// The median of the differences, in ns.
    fn median_ns(&self) -> Option<i64> {
        let mut differences: Vec<_> = self.rounds.iter().map(|apart| apart.ns).collect();
        differences.sort_unstable();
        differences.get(differences.len() / 2).copied()
    }

    pub fn to_json(&self) -> Value {
        let rounds: Vec<_> = self.rounds.iter().map(|apart| apart.to_json()).collect();
        json!({
            "median_ns": self.median_ns(),
            "best": self.best().map(Apart::to_json),
            "rounds": rounds,
        })
    }
}

/// The summary: the median, and the round that proves most.
impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.median_ns(), self.best()) {
            (Some(median), Some(best)) => write!(
                f,
                "{} rounds, median {}; shortest round trips (seq {}): {best}",
                self.rounds.len(),
                units::difference(median),
                best.seq
            ),
            _ => f.write_str("no round in which both clocks were set"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ping::answer::Bytes;
    use mavlink_node::Version;
    use std::time::Duration;

    const UTC_US: i64 = 1_795_320_000_000_000;

    /// A node whose clock is `ahead_us`, whose request was sent at `sent_us`, took `there_us` and
    /// came back in `back_us`.
    fn answer(ahead_us: i64, sent_us: i64, there_us: i64, back_us: i64) -> Answer {
        Answer {
            seq: 1,
            node_us: (UTC_US + sent_us + there_us + ahead_us).unsigned_abs(),
            round_trip: Duration::from_micros((there_us + back_us).unsigned_abs()),
            sent_utc_ns: (UTC_US + sent_us) * 1_000,
            bytes: Bytes {
                request: 24,
                answer: Version::V2,
                baud: None,
            },
        }
    }

    #[test]
    fn whatever_the_ways_take_the_truth_is_within_what_is_proved() {
        for (there, back) in [(0, 6_000), (6_000, 0), (3_000, 3_000), (10, 200)] {
            for (other_there, other_back) in [(0, 9_000), (9_000, 0), (2_000, 500)] {
                let first = answer(-61_030, 0, there, back);
                let second = answer(-60_984, 150, other_there, other_back);
                let apart = Apart::of(&first, &second).unwrap();
                let error = apart.ns.abs_diff(-46_000);
                assert!(error <= apart.proved_ns, "{apart}");
                let half_sum = (there + back + other_there + other_back) * 500;
                assert_eq!(apart.proved_ns, half_sum.unsigned_abs() + 1_000);
            }
        }
    }

    #[test]
    fn if_both_ways_are_alike_the_truth_is_within_half_the_difference() {
        for share in [0, 1, 2, 5, 9, 10] {
            let ways = |round_trip_us: i64| {
                let there = round_trip_us * share / 10;
                (there, round_trip_us - there)
            };
            let ((there, back), (other_there, other_back)) = (ways(6_000), ways(9_000));
            let first = answer(20, 0, there, back);
            let second = answer(-20, -70, other_there, other_back);
            let apart = Apart::of(&first, &second).unwrap();
            assert!(apart.ns.abs_diff(40_000) <= apart.if_alike_ns, "{apart}");
            assert_eq!(apart.if_alike_ns, 1_500_000);
        }
    }

    #[test]
    fn a_clock_that_is_not_set_is_no_pair() {
        let unset = Answer {
            node_us: 12_000_000,
            ..answer(0, 0, 10, 10)
        };
        assert_eq!(Apart::of(&unset, &answer(0, 0, 10, 10)), None);
    }

    #[test]
    fn the_summary_has_the_median_and_the_round_that_proves_most() {
        let mut pair = Pair::default();
        assert_eq!(pair.to_string(), "no round in which both clocks were set");
        for (seq, ns, proved_ns) in [
            (1, 900_000, 9_000_000),
            (2, 46_000, 4_310_000),
            (3, -5, 5_000_000),
        ] {
            pair.push(Apart {
                seq,
                ns,
                proved_ns,
                if_alike_ns: 120_000,
            });
        }
        assert_eq!(
            pair.to_string(),
            "3 rounds, median +46.00 µs; shortest round trips (seq 2): apart +46.00 µs, ± 4.31 ms \
             proved, ± 120 µs if both ways are alike"
        );
    }
}
