//! A track: where a route leads, in metres.

use route::ellipsoid::scale;
use route::{Curve, Place};

/// North and east. \[m\]
pub type Point = [f64; 2];

/// From sample to sample. \[m\]
const STEP_M: f64 = 0.5;
/// How close straight pieces stay to a curve. \[m\]
const FLAT_M: f64 = 0.001;

/// The section that waypoints are counted on: straight lengths \[m\], or arcs of a radius \[m\] and an
/// angle, to the left where the radius is positive. \[°\]
const SECTION: [(f64, f64); 12] = [
    (120.0, 0.0),
    (45.0, 110.0),
    (60.0, 0.0),
    (-30.0, 90.0),
    (40.0, 0.0),
    (25.0, 160.0),
    (90.0, 0.0),
    (-60.0, 70.0),
    (-35.0, 80.0),
    (100.0, 0.0),
    (20.0, 120.0),
    (80.0, 0.0),
];

/// A place on a track.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Where.
    pub at: Point,
    /// From the track's beginning. \[m\]
    pub along_m: f64,
    /// The direction in which one arrives, of length 1.
    pub arriving: Point,
    /// The direction in which one leaves: another one at a corner.
    pub leaving: Point,
}

/// A track: samples at most half a metre apart.
#[derive(Clone, Debug, Default)]
pub struct Track(pub Vec<Sample>);

impl Track {
    /// The section of 857 m that the study's claim is checked on.
    pub fn section() -> Self {
        let mut track = Self::default();
        let (mut at, mut heading) = ([0.0, 0.0], 0.0_f64);
        track.push(at, direction(heading), direction(heading));
        for (size, degrees) in SECTION {
            let length_m = if degrees > 0.0 {
                size.abs() * degrees.to_radians()
            } else {
                size
            };
            // Per metre; to the left is against the compass.
            let bend = if degrees > 0.0 { -1.0 / size } else { 0.0 };
            let steps = (length_m / STEP_M).ceil();
            for _ in 0..steps as u32 {
                let turn = bend * length_m / steps;
                // The chord of the step, exactly.
                let chord_m = match turn {
                    0.0 => length_m / steps,
                    _ => 2.0 / bend.abs() * (turn.abs() / 2.0).sin(),
                };
                let way = direction(heading + turn / 2.0);
                at = [at[0] + chord_m * way[0], at[1] + chord_m * way[1]];
                heading += turn;
                track.push(at, direction(heading), direction(heading));
            }
        }
        track
    }

    /// The track of a mission: straight pieces through `legs`, and curves. `None` without a leg of
    /// some length.
    pub fn of_legs(first: Place, legs: &[Leg]) -> Option<Self> {
        let here = scale(first.latitude.radians());
        let metres = |it: Place| {
            let north = it.latitude.from(first.latitude).radians() * here.north_m;
            [
                north,
                it.longitude.from(first.longitude).radians() * here.east_m,
            ]
        };
        let mut corners = vec![metres(first)];
        for leg in legs {
            match leg {
                Leg::Straight(to) => corners.push(metres(*to)),
                Leg::Curved(curve) => {
                    let pieces = curve.pieces(FLAT_M)?;
                    corners.extend(curve.flattened(pieces).skip(1).map(metres));
                }
            }
        }
        corners.dedup();
        let ways: Vec<_> = corners
            .windows(2)
            .map(|pair| unit(less(pair[1], pair[0])))
            .collect();
        let mut track = Self::default();
        track.push(corners[0], *ways.first()?, *ways.first()?);
        for (n, pair) in corners.windows(2).enumerate() {
            let steps = (length(less(pair[1], pair[0])) / STEP_M).ceil() as u32;
            for step in 1..=steps {
                let leaving = if step == steps { ways.get(n + 1) } else { None };
                let share = f64::from(step) / f64::from(steps);
                let at = [0, 1].map(|k| pair[0][k] + share * (pair[1][k] - pair[0][k]));
                track.push(at, ways[n], *leaving.unwrap_or(&ways[n]));
            }
        }
        Some(track)
    }

    fn push(&mut self, at: Point, arriving: Point, leaving: Point) {
        let before = self.0.last();
        let along_m = before.map_or(0.0, |it| it.along_m + length(less(at, it.at)));
        self.0.push(Sample {
            at,
            along_m,
            arriving,
            leaving,
        });
    }

    /// Its length, by its chords: 1 mm short on 100 m of the narrowest bend. \[m\]
    pub fn length_m(&self) -> f64 {
        self.0.last().map_or(0.0, |it| it.along_m)
    }

    /// The place after `along_m`; straight on beyond the ends.
    pub fn at(&self, along_m: f64) -> Point {
        let behind = self.0.partition_point(|it| it.along_m <= along_m);
        let before = &self.0[behind.saturating_sub(1)];
        let rest = along_m - before.along_m;
        let way = match self.0.get(behind) {
            Some(next) => unit(less(next.at, before.at)),
            None => before.leaving,
        };
        [before.at[0] + rest * way[0], before.at[1] + rest * way[1]]
    }
}

/// What leads on from a waypoint.
#[derive(Clone, Debug)]
pub enum Leg {
    /// A straight line to the next.
    Straight(Place),
    /// A curve to it.
    Curved(Curve),
}

/// The direction of a heading. \[rad\]
fn direction(heading: f64) -> Point {
    [heading.cos(), heading.sin()]
}

/// `a` less `b`.
pub fn less(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

/// How long it is. \[m\]
pub fn length(a: Point) -> f64 {
    a[0].hypot(a[1])
}

fn unit(a: Point) -> Point {
    let length = length(a);
    if length > 0.0 {
        [a[0] / length, a[1] / length]
    } else {
        [0.0, 0.0]
    }
}

/// How far `p` is from the straight piece between `a` and `b`. \[m\]
pub fn apart_m(p: Point, a: Point, b: Point) -> f64 {
    let (p, d) = (less(p, a), less(b, a));
    let square = d[0] * d[0] + d[1] * d[1];
    let share = if square > 0.0 {
        (p[0] * d[0] + p[1] * d[1]) / square
    } else {
        0.0
    };
    let share = share.clamp(0.0, 1.0);
    length([p[0] - share * d[0], p[1] - share * d[1]])
}
