//! As few waypoints as an error allows, with straight lines and with curves between them.
//!
//! *Design.* Greedy: from each waypoint as far along the track as the error allows. Waypoints are on
//! the track, handles along its tangents; their two lengths are fitted so that the greatest distance is
//! small. A length that no fit was found for may lie before one that has a fit, so all are tried from
//! ten metres to ten metres, and to the half metre behind the longest.
//!
//! *Limits.* Greedy is not the optimum, and a fit is a search that may stop early: counts are those that
//! this finds.

use super::track::{Point, Sample, Track, apart_m, length, less};

/// Samples between lengths that are tried: 10 m.
const COARSE: usize = 20;
/// No piece is tried that is longer. \[m\]
const LONGEST_M: f64 = 400.0;
/// Straight pieces that a curve is judged by.
const JUDGED: u32 = 64;
/// Steps of the search for handles.
const STEPS: u32 = 60;

/// What stands between two waypoints.
#[derive(Clone, Copy, Debug)]
pub enum Between {
    /// A straight line.
    Straight,
    /// A curve with these handles.
    Curve([Point; 2]),
}

/// A piece of a route.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// The waypoint that it begins at.
    pub from: Point,
    /// What leads to the next.
    pub between: Between,
    /// The waypoint that it ends at.
    pub to: Point,
}

impl Piece {
    /// The place at `t` from 0 to 1.
    pub fn at(&self, t: f64) -> Point {
        let [p2, p3] = match self.between {
            Between::Straight => return mix(self.from, self.to, t),
            Between::Curve(handles) => handles,
        };
        let [a, b, c] = [mix(self.from, p2, t), mix(p2, p3, t), mix(p3, self.to, t)];
        mix(mix(a, b, t), mix(b, c, t), t)
    }
}

fn mix(a: Point, b: Point, t: f64) -> Point {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

/// A route that stays within `error_m` of the track by straight lines.
pub fn straight(track: &Track, error_m: f64) -> Vec<Piece> {
    greedy(track, |samples| {
        let [first, .., last] = samples else {
            return None;
        };
        let is_near = |it: &Sample| apart_m(it.at, first.at, last.at) <= error_m;
        samples.iter().all(is_near).then_some(Between::Straight)
    })
}

/// A route that stays within `error_m` of the track by curves.
pub fn curved(track: &Track, error_m: f64) -> Vec<Piece> {
    greedy(track, |samples| fit(samples, error_m).map(Between::Curve))
}

/// The least error for which `route` needs no more than `waypoints` of them, to 1 %. \[m\]
pub fn least_error_m(waypoints: usize, route: impl Fn(f64) -> Vec<Piece>) -> f64 {
    let (mut low, mut high) = (1e-3_f64, 100.0);
    while high > 1.01 * low {
        let middle = (low * high).sqrt();
        if route(middle).len() < waypoints {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// From each waypoint as far as `reach` allows.
fn greedy(track: &Track, reach: impl Fn(&[Sample]) -> Option<Between>) -> Vec<Piece> {
    let samples = &track.0;
    let mut pieces = Vec::new();
    let mut begin = 0;
    while begin + 1 < samples.len() {
        let limit_m = samples[begin].along_m + LONGEST_M;
        let limit = samples.partition_point(|it| it.along_m <= limit_m) - 1;
        let try_to = |end: usize| Some((end, reach(&samples[begin..=end])?));
        // From sample to sample something straight always leads.
        let mut best = (begin + 1, Between::Straight);
        let coarse = (begin + COARSE..=limit).step_by(COARSE);
        if let Some(found) = coarse.filter_map(try_to).last() {
            best = found;
        }
        let fine = (best.0 + 1)..=(best.0 + COARSE).min(limit);
        for found in fine.map_while(try_to) {
            best = found;
        }
        let (end, between) = best;
        pieces.push(Piece {
            from: samples[begin].at,
            between,
            to: samples[end].at,
        });
        begin = end;
    }
    pieces
}

/// Handles with which a curve stays within `error_m` of the samples, if the search finds some.
fn fit(samples: &[Sample], error_m: f64) -> Option<[Point; 2]> {
    let [first, .., last] = samples else {
        return None;
    };
    let handles = |[a, b]: Point| {
        let p2 = [0, 1].map(|k| first.at[k] + a * first.leaving[k]);
        [p2, [0, 1].map(|k| last.at[k] - b * last.arriving[k])]
    };
    let judge = |lengths: Point| {
        let piece = Piece {
            from: first.at,
            between: Between::Curve(handles(lengths)),
            to: last.at,
        };
        // Turned about, a curve meets no track of ours.
        let penalty = lengths.iter().map(|&it| (-it).max(0.0)).sum::<f64>();
        worst_m(&piece, samples) + penalty
    };
    let along_m = last.along_m - first.along_m;
    let third = along_m / 3.0;
    // Nelder and Mead's, with one triangle.
    let mut triangle = [[1.0, 1.0], [1.3, 1.0], [1.0, 1.3]].map(|[a, b]| {
        let lengths = [a * third, b * third];
        (judge(lengths), lengths)
    });
    for _ in 0..STEPS {
        triangle.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [best, middle, worst] = triangle;
        if best.0 <= error_m {
            return Some(handles(best.1));
        }
        if length(less(worst.1, best.1)) < 1e-3 {
            return None;
        }
        let centre = mix(best.1, middle.1, 0.5);
        let tried = |factor: f64| {
            let lengths = mix(worst.1, centre, factor);
            (judge(lengths), lengths)
        };
        let reflected = tried(2.0);
        triangle[2] = if reflected.0 < best.0 {
            let expanded = tried(3.0);
            if expanded.0 < reflected.0 {
                expanded
            } else {
                reflected
            }
        } else if reflected.0 < middle.0 {
            reflected
        } else {
            let inside = tried(if reflected.0 < worst.0 { 1.5 } else { 0.5 });
            if inside.0 >= worst.0.min(reflected.0) {
                // Towards the best one.
                for corner in &mut triangle[1..] {
                    let lengths = mix(best.1, corner.1, 0.5);
                    *corner = (judge(lengths), lengths);
                }
                continue;
            }
            inside
        };
    }
    None
}

/// The greatest distance of the piece from the samples' line. Both are walked in one direction. \[m\]
fn worst_m(piece: &Piece, samples: &[Sample]) -> f64 {
    let apart = |p: Point, n: usize| apart_m(p, samples[n].at, samples[n + 1].at);
    let last = samples.len() - 2;
    let (mut n, mut worst_m) = (0, 0.0_f64);
    for step in 1..JUDGED {
        let p = piece.at(f64::from(step) / f64::from(JUDGED));
        let mut here = apart(p, n);
        while n < last {
            let next = apart(p, n + 1);
            if next > here {
                break;
            }
            (n, here) = (n + 1, next);
        }
        worst_m = worst_m.max(here);
    }
    worst_m
}
