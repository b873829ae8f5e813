//! A flight played once, and everything that was asked about it.
//!
//! *Design.* One pass: each reading goes to the windows, to the demands, to the
//! picture's points, and to whoever else wants it.

use world::WorldPicos;

use crate::demands::{Demand, Judged};
use crate::judge::Tally;
use crate::player::{self, Setup, Totals};
use crate::{Flight, Reading, Window};

/// Limit of the picture's points.
const POINTS: i64 = 1_200;

/// A flight with its readings judged.
#[derive(Debug)]
pub struct Replayed<'a> {
    /// Each of the flight's windows; one over all of it, if it has none.
    pub windows: Vec<(Window, Tally)>,
    /// Each demand that was made.
    pub demands: Vec<Judged<'a>>,
    /// For a picture.
    pub points: Vec<Point>,
    /// What the clock counted.
    pub totals: Totals,
}

/// What was worst in a piece of the flight: of its set readings the one whose error is
/// the largest beside its claim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Since the flight's start, in s.
    pub at_s: f64,
    /// Error, without its sign, and claim, in ns; `None` where no reading was set.
    pub worst: Option<(u64, u64)>,
}

/// Plays `flight` and judges it; `also` sees each reading, too.
pub fn replay<'a>(
    flight: &Flight,
    setup: &Setup,
    demands: &'a [Demand],
    mut also: impl FnMut(&Reading),
) -> Replayed<'a> {
    let header = &flight.header;
    let mut windows: Vec<(Window, Tally)> = header
        .windows
        .iter()
        .map(|window| (window.clone(), Tally::default()))
        .collect();
    if windows.is_empty() {
        let all = Window {
            from_s: f64::NEG_INFINITY,
            until_s: f64::INFINITY,
            name: "all".to_owned(),
        };
        windows.push((all, Tally::default()));
    }
    let mut demands: Vec<_> = demands.iter().map(Judged::new).collect();
    let mut points = Points::over(flight.end());
    let totals = player::play(flight, setup, |reading| {
        let truth = header.utc_ns(reading.at);
        for (window, tally) in &mut windows {
            if window.has(reading.at) {
                tally.push(reading, truth);
            }
        }
        for demand in &mut demands {
            demand.push(reading, truth);
        }
        points.push(reading, truth);
        also(reading);
    });
    Replayed {
        windows,
        demands,
        points: points.points,
        totals,
    }
}

/// Gathers the picture's points.
struct Points {
    /// How long a point stands for, in ps.
    every: i64,
    points: Vec<Point>,
}

impl Points {
    fn over(end: WorldPicos) -> Self {
        Self {
            every: end.0 / POINTS + 1,
            points: Vec::new(),
        }
    }

    fn push(&mut self, reading: &Reading, truth: i64) {
        let index = usize::try_from(reading.at.0 / self.every).unwrap_or(0);
        while self.points.len() <= index {
            let at = self.points.len() as i64 * self.every;
            self.points.push(Point {
                at_s: WorldPicos(at).as_secs(),
                worst: None,
            });
        }
        let Some((utc_ns, claim_ns)) = reading.claim() else {
            return;
        };
        let error_ns = utc_ns.abs_diff(truth);
        let worst = &mut self.points[index].worst;
        // error / claim compared without a division.
        let is_worse = worst.is_none_or(|(error, claim)| {
            u128::from(error_ns) * u128::from(claim) > u128::from(error) * u128::from(claim_ns)
        });
        if is_worse {
            *worst = Some((error_ns, claim_ns));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UNSET;

    #[test]
    fn a_point_is_the_worst_of_its_readings() {
        let mut points = Points::over(WorldPicos::from_millis(2_400_000));
        let mut push = |ms, claim: Option<(i64, u64)>| {
            points.push(
                &Reading {
                    at: WorldPicos::from_millis(ms),
                    utc_ns: claim.map(|claim| claim.0),
                    uncertainty_ns: claim.map(|claim| claim.1),
                    state: if claim.is_some() { "set" } else { UNSET },
                    source: "nothing",
                },
                0,
            );
        };
        push(0, None);
        push(2_100, Some((-10, 100)));
        push(2_200, Some((9, 10)));
        push(2_300, Some((50, 100)));
        push(6_100, Some((1, 0)));
        let worst: Vec<_> = points.points.iter().map(|point| point.worst).collect();
        assert_eq!(worst, [None, Some((9, 10)), None, Some((1, 0))]);
        assert!((points.points[3].at_s - 6.0).abs() < 1e-6);
    }
}
