//! The best smooth line through a trace of arrivals.
//!
//! *Purpose.* Where the true time is not known: the line with which published times are
//! compared.
//!
//! *Design.* A message can be late but never early, and a crystal bends slowly. So
//! the line goes through the least late arrival of each [`BIN_S`], by LOESS
//! (Cleveland, "Robust locally weighted regression", 1979): a straight line at each
//! place, weighted by nearness within [`REACH_S`], and twice more with less weight
//! for what lies off. It knows the future, which no clock does, and no candidate's
//! opinion.
//!
//! What is later than another arrival by more than a crystal makes in the time between was late:
//! a queue that stands for minutes is no part of the line. Without that the line goes half of the
//! way after such a queue, and the clock that follows it passes for the best.
//!
//! *Limits.* A floor that wanders more slowly than its reach bends it, too. At the
//! ends it rests on half as much.

use crate::spread::quantile;

/// Of each bin one arrival counts. \[s\]
pub const BIN_S: f64 = 10.0;
/// Arrivals farther away than this do not count: longer than stalls and jitter, and
/// shorter than what 1 ppm/min bends by more than a few ms.
pub const REACH_S: f64 = 120.0;
/// Residuals of more than this many medians do not count at all.
const OUTLYING: f64 = 6.0;

/// No crystal of these boards is farther off: 110 ppm. \[ns/s\]
const CRYSTAL_NS_PER_S: f64 = 110e3;
/// And floors wander by less beside it. \[ns\]
const WANDERS_NS: f64 = 20e6;

/// A smooth line, of time in s.
#[derive(Clone, Debug)]
pub struct Smooth {
    /// (time, value, robust weight).
    points: Vec<(f64, f64, f64)>,
}

impl Smooth {
    /// The line over the largest of each bin of `values`, (time in s, value in ns) in the
    /// order of their time.
    #[must_use]
    pub fn over(values: &[(f64, f64)]) -> Self {
        let mut points: Vec<(f64, f64, f64)> = Vec::new();
        let bin = |t: f64| (t / BIN_S).floor();
        for &(t, value) in values {
            match points.last_mut() {
                Some(last) if bin(last.0) == bin(t) => {
                    if value > last.1 {
                        *last = (t, value, 1.0);
                    }
                }
                _ => points.push((t, value, 1.0)),
            }
        }
        let mut line = Self { points };
        line.leave_out_late();
        line.weigh();
        line.weigh();
        line
    }

    /// Leaves out what no crystal explains beside the other points, before and after it.
    fn leave_out_late(&mut self) {
        let supported = self.supported();
        let least = |forward: bool| {
            let mut least = vec![f64::NEG_INFINITY; supported.len()];
            let mut last: Option<(f64, f64)> = None;
            for step in 0..supported.len() {
                let index = if forward {
                    step
                } else {
                    supported.len() - 1 - step
                };
                let (at, value) = supported[index];
                let fallen = last.map_or(f64::NEG_INFINITY, |(then, before)| {
                    before - CRYSTAL_NS_PER_S * (at - then).abs()
                });
                least[index] = value.max(fallen);
                last = Some((at, least[index]));
            }
            least
        };
        let least: Vec<f64> = least(true)
            .into_iter()
            .zip(least(false))
            .map(|(before, after)| before.max(after) - WANDERS_NS)
            .collect();
        let mut least = least.into_iter();
        self.points
            .retain(|&(_, value, _)| least.next().is_none_or(|least| value >= least));
    }

    /// The points, none above both of its neighbours: a single one is a label that was wrong.
    fn supported(&self) -> Vec<(f64, f64)> {
        let value = |index: Option<usize>| {
            let point = index.and_then(|index| self.points.get(index));
            point.map_or(f64::NEG_INFINITY, |&(_, value, _)| value)
        };
        let supported = self
            .points
            .iter()
            .enumerate()
            .map(|(index, &(at, own, _))| {
                let beside = value(index.checked_sub(1)).max(value(Some(index + 1)));
                (at, own.min(beside))
            });
        supported.collect()
    }

    /// Its value at `t`; 0 for a line through nothing.
    #[must_use]
    pub fn at(&self, t: f64) -> f64 {
        let near = |reach: f64| {
            self.points.iter().filter_map(move |&(at, value, robust)| {
                let distance = ((at - t) / reach).abs();
                let weight = robust * (1.0 - distance.min(1.0).powi(3)).powi(3);
                (weight > 0.0).then_some((at - t, value, weight))
            })
        };
        // A pause longer than the reach is bridged from its ends.
        let reach = [1.0, 4.0, 16.0, 1e9].map(|factor| factor * REACH_S);
        let enough = reach.into_iter().find(|&reach| near(reach).count() >= 2);
        let (mut w, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (at, value, weight) in near(enough.unwrap_or(f64::MAX)) {
            w += weight;
            x += weight * at;
            y += weight * value;
            xx += weight * at * at;
            xy += weight * at * value;
        }
        let determinant = w * xx - x * x;
        if determinant > 1e-9 * w * xx {
            (xx * y - x * xy) / determinant
        } else if w > 0.0 {
            y / w
        } else {
            0.0
        }
    }

    fn weigh(&mut self) {
        let off: Vec<f64> = self
            .points
            .iter()
            .map(|&(t, value, _)| (value - self.at(t)).abs())
            .collect();
        let mut sorted = off.clone();
        sorted.sort_by(f64::total_cmp);
        let Some(median) = quantile(&sorted, 0.5).filter(|median| *median > 0.0) else {
            return;
        };
        for (point, off) in self.points.iter_mut().zip(off) {
            let outlying = (off / (OUTLYING * median)).min(1.0);
            point.2 = (1.0 - outlying * outlying).powi(2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 5 Hz for 300 s along a line of 40 a second.
    fn along(late: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        (0..1_500)
            .map(|i| (i as f64 / 5.0, 40.0 * i as f64 / 5.0 - late(i)))
            .collect()
    }

    #[test]
    fn it_follows_the_least_late_and_no_stall() {
        // Late by 0 to 30 000; for 25 s by a million.
        let line = Smooth::over(&along(|i| {
            let jitter = (i * 7_919 % 50) as f64 * 600.0;
            let stalled = (750..875).contains(&i);
            jitter + if stalled { 1e6 } else { 0.0 }
        }));
        for t in [0.0, 60.0, 150.0, 165.0, 299.0] {
            let off = line.at(t) - 40.0 * t;
            assert!(off.abs() < 200.0, "{off} at {t}");
        }
    }

    #[test]
    fn a_queue_of_minutes_bends_it_nowhere_and_one_early_label_neither() {
        let line = Smooth::over(&along(|i| {
            let queued = if (500..1_300).contains(&i) {
                100e6
            } else {
                0.0
            };
            let early = if i == 200 { 85e6 } else { 0.0 };
            queued - early
        }));
        for t in [0.0, 90.0, 100.0, 180.0, 260.0, 299.0] {
            let off = line.at(t) - 40.0 * t;
            assert!(off.abs() < 1e6, "{off} at {t}");
        }
    }

    #[test]
    fn few_points_and_long_pauses_are_bridged() {
        assert!(Smooth::over(&[]).at(3.0).abs() < 1e-9);
        assert!((Smooth::over(&[(0.0, 7.0)]).at(3.0) - 7.0).abs() < 1e-9);
        let two = Smooth::over(&[(0.0, 0.0), (1_000.0, 1_000.0)]);
        assert!((two.at(500.0) - 500.0).abs() < 1e-6);
    }
}
