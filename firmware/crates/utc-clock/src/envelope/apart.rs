//! Marks apart from the line: whether the floor has moved.
//!
//! *Purpose.* Tells a floor that is somewhere else from labels that are wrong for a minute, a queue
//! that stands for two, and a floor that is still on its way.
//!
//! *Design.* Marks on one side of the line, all of them or, where they are early, without a
//! pause. After long enough the floor is where the lowest of the second half of that time are, if
//! it stands: those are not farther away than the lowest of the first half. Otherwise it is looked
//! at for as long again, and if it does not stand then, the frequency was learnt wrong.
//!
//! *Limits.* A floor that moves by less than marks may be from the line is the line's.

use super::elapsed_s;

/// A floor that has moved stands: over half of the time its lowest marks go away by no more. [ns]
const STANDS_NS: i32 = 2_000_000;

/// Marks on one side of the line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Apart {
    since_us: u64,
    last_us: u64,
    /// The least excess of the first half of the time, and of the second. [ns]
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
    /// So far above the line, or below. [ns]
    At(i32),
    /// There, because the line's frequency is wrong. [ns]
    Drifted(i32),
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

    /// For how long there have been such marks. [s]
    pub(super) fn lasts_s(&self, at_us: u64) -> f32 {
        elapsed_s(at_us, self.since_us)
    }

    /// Since the last of them. [s]
    pub(super) fn pause_s(&self, at_us: u64) -> f32 {
        elapsed_s(at_us, self.last_us)
    }

    /// The lowest of them. [ns]
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
        let stands_ns = STANDS_NS.saturating_add((off_ppb * half_s) as i32);
        let away_ns = if self.second_ns < 0 {
            self.first_ns.saturating_sub(self.second_ns)
        } else {
            self.second_ns.saturating_sub(self.first_ns)
        };
        if away_ns > stands_ns && !self.again {
            *self = Self {
                again: true,
                ..Self::new(at_us, excess_ns)
            };
            Standing::Unmoved
        } else if self.again {
            Standing::Drifted(self.second_ns)
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
    fn one_that_goes_farther_away_is_not_believed_before_it_stands() {
        for ppm in [-300_i32, 300] {
            let mut apart = Apart::new(0, ppm.signum() * 20 * MS);
            let at = |s: u64| ppm.signum() * 20 * MS + ppm * 1_000 * s.min(160) as i32;
            assert_eq!(push(&mut apart, 0, 160, at), Standing::Unmoved);
            assert!(apart.is_moving());
            let standing = push(&mut apart, 160, 200, at);
            assert_eq!(standing, Standing::Drifted(at(160)));
        }
    }
}
