//! What a clock's readings were worth over a span.
//!
//! *Purpose.* Counts of readings that held what they claimed, and the misleading
//! ones: set, and beyond the published uncertainty for more than 1 s on end.
//!
//! *Design.* A [`Tally`] takes readings in the order of their time, and knows nothing
//! of the clock. A run lasts from its first reading beyond to its last; an unset
//! reading ends it.

use std::collections::BTreeMap;

use world::WorldPicos;

use crate::Reading;

/// Beyond the claim for so long is not yet misleading.
pub const TOLERATED: WorldPicos = WorldPicos::from_millis(1_000);

/// The least and the most of something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range<T> {
    /// The least.
    pub min: T,
    /// The most.
    pub max: T,
}

impl<T: Ord + Copy> Range<T> {
    fn widen(range: &mut Option<Self>, value: T) {
        let range = range.get_or_insert(Self {
            min: value,
            max: value,
        });
        range.min = range.min.min(value);
        range.max = range.max.max(value);
    }
}

/// A run of readings beyond their claim.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    since: WorldPicos,
    /// From its first reading to its last, in ps.
    lasts: i64,
}

/// The readings of a span, counted.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// All of them.
    pub readings: u64,
    /// Those that were set.
    pub set: u64,
    /// Those that were set and within their uncertainty.
    pub held: u64,
    /// The clock less the truth while it was set, in ns.
    pub error_ns: Option<Range<i64>>,
    /// What was claimed, in ns.
    pub uncertainty_ns: Option<Range<u64>>,
    /// How many readings each state had.
    pub states: BTreeMap<&'static str, u64>,
    /// How many readings each source had.
    pub sources: BTreeMap<&'static str, u64>,
    run: Option<Run>,
    longest: i64,
    misleading: i64,
    first_misleading: Option<WorldPicos>,
}

impl Tally {
    /// Takes the next reading, beside true UTC in ns since 1970.
    pub fn push(&mut self, reading: &Reading, true_utc_ns: i64) {
        self.readings += 1;
        *self.states.entry(reading.state).or_default() += 1;
        *self.sources.entry(reading.source).or_default() += 1;
        let Some((utc_ns, uncertainty_ns)) = reading.claim() else {
            self.run = None;
            return;
        };
        self.set += 1;
        let error_ns = utc_ns.saturating_sub(true_utc_ns);
        Range::widen(&mut self.error_ns, error_ns);
        Range::widen(&mut self.uncertainty_ns, uncertainty_ns);
        if utc_ns.abs_diff(true_utc_ns) <= uncertainty_ns {
            self.held += 1;
            self.run = None;
        } else {
            self.extend_run(reading.at);
        }
    }

    fn extend_run(&mut self, at: WorldPicos) {
        let run = self.run.get_or_insert(Run {
            since: at,
            lasts: 0,
        });
        let before = run.lasts;
        run.lasts = at.0 - run.since.0;
        self.longest = self.longest.max(run.lasts);
        if run.lasts > TOLERATED.0 {
            // The whole run counts once it is too long.
            let counted = if before > TOLERATED.0 { before } else { 0 };
            self.misleading += run.lasts - counted;
            self.first_misleading.get_or_insert(run.since);
        }
    }

    /// How long it was misleading: the runs of more than 1 s, together.
    #[must_use]
    pub const fn misleading(&self) -> WorldPicos {
        WorldPicos(self.misleading)
    }

    /// The longest run beyond the claim, misleading or not.
    #[must_use]
    pub const fn longest_beyond(&self) -> WorldPicos {
        WorldPicos(self.longest)
    }

    /// When the first run began that was misleading.
    #[must_use]
    pub const fn first_misleading(&self) -> Option<WorldPicos> {
        self.first_misleading
    }

    /// Whether the clock misled.
    #[must_use]
    pub const fn is_misleading(&self) -> bool {
        self.misleading > 0
    }

    /// The largest error to either side while it was set, in ns.
    #[must_use]
    pub fn worst_ns(&self) -> u64 {
        self.error_ns.map_or(0, |error| {
            error.min.unsigned_abs().max(error.max.unsigned_abs())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(k: i64, claim: Option<(i64, u64)>) -> Reading {
        let at = WorldPicos::from_millis(37 * k);
        match claim {
            None => Reading::unset(at, "nothing"),
            Some((utc_ns, uncertainty_ns)) => Reading {
                at,
                utc_ns: Some(utc_ns),
                uncertainty_ns: Some(uncertainty_ns),
                state: "set",
                source: "pulse",
            },
        }
    }

    /// Readings that are beyond, within or unset, judged.
    fn tally(kinds: &str) -> Tally {
        let mut tally = Tally::default();
        for (k, kind) in (0..).zip(kinds.chars()) {
            let claim = match kind {
                'b' => Some((-1_001, 1_000)),
                'w' => Some((1_000, 1_000)),
                _ => None,
            };
            tally.push(&reading(k, claim), 0);
        }
        tally
    }

    #[test]
    fn a_second_beyond_the_claim_is_tolerated_and_a_reading_more_is_not() {
        // 28 readings on end span 999 ms.
        assert!(!tally(&"b".repeat(28)).is_misleading());
        let beyond = tally(&"b".repeat(29));
        assert_eq!(beyond.misleading(), WorldPicos::from_millis(28 * 37));
        assert_eq!(beyond.held, 0);
        // What is not on end does not add up.
        for gap in ["w", "u"] {
            let twice = ["b".repeat(28), "b".repeat(28)].join(gap);
            assert!(!tally(&twice).is_misleading(), "{gap}");
        }
        let two = tally(&["b".repeat(29), "b".repeat(30)].join("w"));
        assert_eq!(two.misleading(), WorldPicos::from_millis((28 + 29) * 37));
        assert_eq!(two.longest_beyond(), WorldPicos::from_millis(29 * 37));
        assert_eq!(two.first_misleading(), Some(WorldPicos(0)));
    }

    #[test]
    fn a_tally_counts_what_was_said() {
        let tally = tally("uwbw");
        assert_eq!((tally.readings, tally.set, tally.held), (4, 3, 2));
        assert_eq!(
            tally.error_ns,
            Some(Range {
                min: -1_001,
                max: 1_000
            })
        );
        assert_eq!(tally.worst_ns(), 1_001);
        assert_eq!(tally.states["set"], 3);
        assert_eq!(tally.sources["nothing"], 1);
    }

    #[test]
    fn claims_of_any_size_are_judged() {
        let mut tally = Tally::default();
        tally.push(&reading(0, Some((i64::MIN, u64::MAX))), i64::MAX);
        tally.push(&reading(1, Some((i64::MIN, 0))), i64::MAX);
        assert_eq!((tally.set, tally.held), (2, 1));
    }
}
