//! A board's clock, looked at once a second.
//!
//! *Purpose.* [`Sample`] is what a row of the screen shows of one board; [`Sizes`] sums up a column.

use timebase::ClockState;

/// What a board's clock showed at a whole second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The state of the clock.
    pub state: ClockState,
    /// The clock less the reference of all boards, in ns. `None` while it is unset.
    pub offset_ns: Option<i64>,
    /// What the clock claims: UTC is at most so far from it to either side, in ns. Nothing is
    /// claimed while it is unset.
    pub uncertainty_ns: u64,
}

impl Sample {
    /// A clock that was never set.
    pub const UNSET: Self = Self {
        state: ClockState::Unset,
        offset_ns: None,
        uncertainty_ns: u64::MAX,
    };

    /// The clock is further off than it claims.
    pub(crate) fn is_misleading(&self) -> bool {
        let is_beyond = |ns: i64| ns.unsigned_abs() > self.uncertainty_ns;
        self.state != ClockState::Unset && self.offset_ns.is_some_and(is_beyond)
    }
}

/// A sample, and what steered the clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cell {
    pub(crate) sample: Sample,
    /// The time pulse, not the messages.
    pub(crate) follows_pulse: bool,
}

/// What the two of these clocks that differ most disagree by, in ns; `None` if fewer than two are
/// set.
pub(crate) fn apart_ns(cells: &[Option<Cell>]) -> Option<u64> {
    let cells = cells.iter().flatten();
    let offsets = || cells.clone().filter_map(|cell| cell.sample.offset_ns);
    if offsets().count() < 2 {
        return None;
    }
    Some(offsets().max()?.abs_diff(offsets().min()?))
}

/// The mean and the largest of sizes that come once a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sizes {
    pub(crate) count: u64,
    sum_ns: u128,
    pub(crate) largest_ns: u64,
    /// The second of the largest.
    pub(crate) largest_at_s: u64,
    pub(crate) last_ns: u64,
}

impl Sizes {
    /// Adds the size of second `at_s`.
    pub(crate) fn push(&mut self, at_s: u64, ns: u64) {
        if self.count == 0 || ns > self.largest_ns {
            (self.largest_ns, self.largest_at_s) = (ns, at_s);
        }
        self.count += 1;
        self.sum_ns += u128::from(ns);
        self.last_ns = ns;
    }

    /// The mean, in ns; `None` of nothing.
    pub(crate) fn mean_ns(&self) -> Option<u64> {
        // A mean is no larger than the largest.
        let mean = self.sum_ns.checked_div(self.count.into())?;
        Some(u64::try_from(mean).unwrap_or(self.largest_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(offset_ns: i64) -> Sample {
        Sample {
            state: ClockState::Set,
            offset_ns: Some(offset_ns),
            uncertainty_ns: 100,
        }
    }

    #[test]
    fn boards_are_as_far_apart_as_the_two_that_differ_most() {
        let cell = |sample| {
            let follows_pulse = false;
            Some(Cell {
                sample,
                follows_pulse,
            })
        };
        let cells = [-61, -20, -35].map(|ns| cell(set(ns)));
        assert_eq!(apart_ns(&cells), Some(41));
        assert_eq!(apart_ns(&cells[..1]), None);
        assert_eq!(apart_ns(&[cells[0], cell(Sample::UNSET), None]), None);
    }

    #[test]
    fn a_clock_is_misleading_beyond_what_it_claims() {
        assert!(!set(-100).is_misleading());
        assert!(set(-101).is_misleading());
        assert!(!Sample::UNSET.is_misleading());
    }

    #[test]
    fn sizes_have_a_mean_and_a_largest() {
        let mut sizes = Sizes::default();
        assert_eq!(sizes.mean_ns(), None);
        for (at_s, ns) in [(1, 10), (2, 30), (3, 30), (4, 2)] {
            sizes.push(at_s, ns);
        }
        assert_eq!(sizes.mean_ns(), Some(18));
        assert_eq!((sizes.largest_ns, sizes.largest_at_s), (30, 2));
        assert_eq!(sizes.last_ns, 2);
    }
}
