//! The discipline: what a mark says about the clock's error.
//!
//! *Purpose.* The one place that decides how far a mark is to be followed;
//! [`Discipline::update`] is its only call.
//!
//! *Design.* The mark's whole residual (what it told, less what the clock said
//! at its arrival) is the error to be absorbed, at a constant frequency. The
//! clock bounds how fast that is done, so a late mark drags it no farther than
//! one interval at the slew limit. A residual beyond [`OUTLIER_NS`] is no error
//! but a stall, a backlog or a jump: it is refused, until [`AGREEING`] of them in
//! a row say the same to within [`AGREEMENT_NS`]; then the clock is wrong and has
//! to step. Of those the least late, the largest, tells by how much.
//!
//! *Limits.* No memory beyond a run of outliers: it follows the middle of the
//! receiver's jitter, not its lower envelope, and learns no frequency.

use crate::{Ppb, UtcNanos};

/// A residual beyond this is an outlier: more than any latency measured on a
/// receiver that was not stalled (185 ms), less than the second that jumps.
pub const OUTLIER_NS: i64 = 500_000_000;

/// So many outliers in a row have to agree before the clock steps: a second of
/// a 5 Hz receiver. A backlog that is flushed does not agree with itself.
pub const AGREEING: u8 = 5;

/// How far agreeing outliers may lie apart: the widest spread of latencies
/// measured on one receiver was 91 ms (LEA-M8T at 9600 baud).
pub const AGREEMENT_NS: i64 = 100_000_000;

/// One mark beside the clock that it corrects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Observation {
    /// UTC at the mark's arrival as the mark tells it: epoch and latency.
    pub told: UtcNanos,
    /// UTC at the mark's arrival as the clock had it.
    pub published: UtcNanos,
    /// The receiver's own accuracy, in ns.
    pub t_acc_ns: u32,
}

/// What is to be done about an observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// Absorb an error while running at a frequency.
    Slew {
        /// UTC less the clock, in ns: positive when the clock is behind.
        error_ns: i32,
        /// How much faster than the crystal the clock has to run anyway.
        frequency: Ppb,
        /// How far UTC at the arrival may be from the clock, in ns, the
        /// receiver's latency apart.
        uncertainty_ns: u32,
    },
    /// Step; the clock is wrong beyond doubt.
    Step {
        /// What to add to the clock, in ns.
        by_ns: i64,
        /// As above, after the step.
        uncertainty_ns: u32,
    },
    /// Leave the clock alone: an outlier.
    Ignore,
}

/// The estimator of the clock's error.
#[derive(Clone, Copy, Debug)]
pub struct Discipline {
    frequency: Ppb,
    run: Run,
}

/// Outliers in a row that agree.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    length: u8,
    smallest_ns: i64,
    largest_ns: i64,
}

impl Discipline {
    /// A discipline of a crystal that `frequency` would make right.
    #[must_use]
    pub const fn new(frequency: Ppb) -> Self {
        Self {
            frequency,
            run: Run {
                length: 0,
                smallest_ns: 0,
                largest_ns: 0,
            },
        }
    }

    /// Hears one observation.
    pub fn update(&mut self, observation: &Observation) -> Correction {
        let Observation {
            told,
            published,
            t_acc_ns,
        } = *observation;
        let residual_ns = told.since(published);
        if residual_ns.unsigned_abs() <= OUTLIER_NS.unsigned_abs() {
            self.run = Run::default();
            // What a mark is off by may be the mark's fault: count it in full.
            let error_ns = residual_ns as i32;
            return Correction::Slew {
                error_ns,
                frequency: self.frequency,
                uncertainty_ns: t_acc_ns.saturating_add(error_ns.unsigned_abs()),
            };
        }
        self.run.add(residual_ns);
        if self.run.length < AGREEING {
            return Correction::Ignore;
        }
        let Run {
            smallest_ns,
            largest_ns,
            ..
        } = self.run;
        self.run = Run::default();
        // Within AGREEMENT_NS of each other, so it fits.
        let spread_ns = largest_ns.wrapping_sub(smallest_ns) as u32;
        Correction::Step {
            by_ns: largest_ns,
            uncertainty_ns: t_acc_ns.saturating_add(spread_ns),
        }
    }
}

impl Run {
    fn add(&mut self, residual_ns: i64) {
        let joined = Self {
            length: self.length.saturating_add(1),
            smallest_ns: self.smallest_ns.min(residual_ns),
            largest_ns: self.largest_ns.max(residual_ns),
        };
        let agrees =
            self.length > 0 && joined.largest_ns.saturating_sub(joined.smallest_ns) <= AGREEMENT_NS;
        *self = if agrees {
            joined
        } else {
            Self {
                length: 1,
                smallest_ns: residual_ns,
                largest_ns: residual_ns,
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn hear(discipline: &mut Discipline, residual_ns: i64) -> Correction {
        discipline.update(&Observation {
            told: UtcNanos(residual_ns),
            published: UtcNanos(0),
            t_acc_ns: 30,
        })
    }

    #[test]
    fn a_residual_is_the_error() {
        let mut discipline = Discipline::new(Ppb(-40_000));
        for error_ns in [0, 1, -3_000_000, 500_000_000, -500_000_000] {
            assert_eq!(
                hear(&mut discipline, i64::from(error_ns)),
                Correction::Slew {
                    error_ns,
                    frequency: Ppb(-40_000),
                    uncertainty_ns: error_ns.unsigned_abs() + 30,
                }
            );
        }
    }

    #[test]
    fn the_fifth_agreeing_outlier_steps_by_the_least_late() {
        let mut discipline = Discipline::new(Ppb(0));
        for late_ms in [40, 90, 0, 20] {
            let residual = -1_000 * MS - late_ms * MS;
            assert_eq!(hear(&mut discipline, residual), Correction::Ignore);
        }
        assert_eq!(
            hear(&mut discipline, -1_050 * MS),
            Correction::Step {
                by_ns: -1_000 * MS,
                uncertainty_ns: 90_000_030,
            }
        );
        // And it starts to count anew.
        assert_eq!(hear(&mut discipline, -1_050 * MS), Correction::Ignore);
    }

    #[test]
    fn a_good_mark_or_a_dissenter_ends_the_run() {
        let mut discipline = Discipline::new(Ppb(0));
        for between in [10 * MS, 800 * MS] {
            for _ in 0..4 {
                assert_eq!(hear(&mut discipline, 600 * MS), Correction::Ignore);
            }
            hear(&mut discipline, between);
        }
        for _ in 0..4 {
            assert_eq!(hear(&mut discipline, 600 * MS), Correction::Ignore);
        }
        assert!(matches!(
            hear(&mut discipline, 600 * MS),
            Correction::Step { .. }
        ));
    }

    #[test]
    fn the_flush_of_a_backlog_never_agrees() {
        let mut discipline = Discipline::new(Ppb(0));
        // A stall of 10 s at 5 Hz, its frames 8.7 ms apart on the wire.
        for i in 0..50 {
            let residual = -10_000 * MS + i * 191 * MS;
            let said = hear(&mut discipline, residual);
            assert!(!matches!(said, Correction::Step { .. }), "{i}");
        }
    }

    #[test]
    fn the_ends_of_the_scale_are_outliers() {
        let mut discipline = Discipline::new(Ppb(0));
        for _ in 0..4 {
            for residual in [i64::MIN, i64::MAX] {
                assert_eq!(hear(&mut discipline, residual), Correction::Ignore);
            }
        }
    }
}
