//! Marks apart from the line: whether the floor has moved.
//!
//! *Purpose.* Tells a floor that is somewhere else from labels that are wrong for a minute, a queue
//! that stands for two, and a floor that is still on its way.
//!
//! *Design.* Marks on one side of the line, all of them or, where they are early, without a
//! pause. After long enough the floor is where the lowest of the second half of that time are, if
//! it stands: those are not farther away than the lowest of the first half. Otherwise it is looked
//! at for as long again, and a frequency that was learnt wrong is an explanation then, too: one that
//! goes away faster than crystals differ is nobody's floor.
//!
//! *Limits.* A floor that moves by less than marks may be from the line is the line's.

use super::elapsed::elapsed_s;
use crate::holdover::CRYSTAL_PPB;

/// A floor that has moved stands: over half of the time its lowest marks go away by no more. \[ns\]
const STANDS_NS: i32 = 2_000_000;

/// Marks on one side of the line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Apart {
    since_us: u64,
    last_us: u64,
    /// The least excess of the first half of the time, and of the second. \[ns\]
    first_ns: i32,
    second_ns: i32,
    /// It did not stand the time before.
    again: bool,
}

/// Where the floor is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// Where it was, as far as is known.
    Unmoved,
    /// So far above the line, or below. \[ns\]
    At(i32),
    /// Nowhere along the line, whose frequency is wrong.
    Drifted,
}

impl Apart {
    /// The first mark.
    pub(super) const fn new(at_us: u64, excess_ns: i32) -> Self {
        Self {
            since_us: at_us,
            last_us: at_us,
            first_ns: excess_ns,
            second_ns: i32::MAX,
            again: false,
        }
    }

    /// For how long there have been such marks. \[s\]
    pub(super) fn lasts_s(&self, at_us: u64) -> f32 {
        elapsed_s(at_us, self.since_us)
    }

    /// Since the last of them. \[s\]
    pub(super) fn pause_s(&self, at_us: u64) -> f32 {
        elapsed_s(at_us, self.last_us)
    }

    /// The lowest of them. \[ns\]
    pub(super) fn lowest_ns(&self) -> i32 {
        self.first_ns.min(self.second_ns)
    }

    /// Whether they have gone away farther and farther.
    pub(super) const fn is_moving(&self) -> bool {
        self.again
    }

    /// Takes the next mark; `after_s` is how long a floor has to be somewhere else, and the line's
    /// frequency may be off by `off_ppb`.
    pub(super) fn push(
        &mut self,
        at_us: u64,
        excess_ns: i32,
        after_s: f32,
        off_ppb: f32,
    ) -> Standing {
        self.last_us = at_us;
        let lasts_s = self.lasts_s(at_us);
        let half_s = after_s / 2.0;
        if lasts_s < half_s {
            self.first_ns = self.first_ns.min(excess_ns);
        } else {
            self.second_ns = self.second_ns.min(excess_ns);
        }
        if lasts_s < after_s {
            return Standing::Unmoved;
        }
        // What is learnt of the frequency may be wrong, by as much as two crystals differ.
        let drift_ppb = if self.again {
            2.0 * CRYSTAL_PPB
        } else {
            off_ppb
        };
        let stands_ns = STANDS_NS.saturating_add((drift_ppb * half_s) as i32);
        let away_ns = if self.second_ns < 0 {
            self.first_ns.saturating_sub(self.second_ns)
        } else {
            self.second_ns.saturating_sub(self.first_ns)
        };
        if away_ns > stands_ns {
            *self = Self {
                again: true,
                ..Self::new(at_us, excess_ns)
            };
            Standing::Unmoved
        } else if self.again {
            Standing::Drifted
        } else {
            Standing::At(self.second_ns)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i32 = 1_000_000;

    /// Marks at 5 Hz for `lasts_s`, each as far from the line as `excess_ns` says for its s.
    fn push(
        apart: &mut Apart,
        from_s: u64,
        lasts_s: u64,
        excess_ns: impl Fn(u64) -> i32,
    ) -> Standing {
        let marks = from_s * 5..(from_s + lasts_s) * 5;
        marks.fold(Standing::Unmoved, |before, mark| match before {
            Standing::Unmoved => {
                let late_ns = (mark % 7) as i32 * MS;
                apart.push(mark * 200_000, excess_ns(mark / 5) + late_ns, 80.0, 1_000.0)
            }
            standing => standing,
        })
    }

    #[test]
    fn a_floor_that_stands_is_where_its_lowest_marks_are() {
        for floor_ms in [-300, -30, 30, 300] {
            let mut apart = Apart::new(0, (floor_ms + 6) * MS);
            assert_eq!(
                push(&mut apart, 0, 80, |_| floor_ms * MS),
                Standing::Unmoved
            );
            let standing = push(&mut apart, 80, 1, |_| floor_ms * MS);
            assert_eq!(standing, Standing::At(floor_ms * MS));
        }
    }

    #[test]
    fn one_that_goes_away_faster_than_crystals_differ_is_not_believed() {
        for ppm in [-500_i32, 500] {
            let mut apart = Apart::new(0, ppm.signum() * 20 * MS);
            let at = |s: u64| ppm.signum() * 20 * MS + ppm * 1_000 * s as i32;
            assert_eq!(push(&mut apart, 0, 500, at), Standing::Unmoved);
        }
    }

    #[test]
    fn one_that_goes_farther_away_says_that_the_frequency_is_wrong() {
        for ppm in [-150_i32, 150] {
            let mut apart = Apart::new(0, ppm.signum() * 20 * MS);
            let at = |s: u64| ppm.signum() * 20 * MS + ppm * 1_000 * s.min(160) as i32;
            assert_eq!(push(&mut apart, 0, 160, at), Standing::Unmoved);
            assert!(apart.is_moving());
            assert_eq!(push(&mut apart, 160, 200, at), Standing::Drifted);
        }
    }
}
