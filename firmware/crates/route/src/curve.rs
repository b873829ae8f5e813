//! A cubic Bézier segment on the ellipsoid.

use core::f64::consts::{PI, TAU};

use lyon_geom::euclid::default::{Point2D, Vector2D};
use lyon_geom::{CubicBezierSegment, point};

use crate::bam::Bam;
use crate::ellipsoid::{Scale, scale};
use crate::integral::integral;
use crate::place::Place;
use crate::refusal::Refusal;

/// The greatest latitude of any of a curve's points, north and south. \[rad\]
const MAX_LATITUDE: f64 = 85.0 / 180.0 * PI;
/// Equal parts of t over which the length is integrated: within 0.01 mm on curves of 3 km, and
/// exact where a cusp is at ½.
const PARTS: u32 = 4;
/// More pieces than this are not made. At 1 mm they suffice for handles 85 km away.
const MAX_PIECES: u32 = 1 << 16;
/// A derivative that is shorter than the hull by this factor has no direction: it is what rounding
/// leaves of 0.
const NO_DIRECTION: f64 = 1e-9;
/// So is one that is shorter than this, 6 nm on the ground: points of 32 bits are 9 mm apart. \[rad\]
const NO_WAY: f64 = 1e-15;
/// Halvings of t until what is left is below the rounding of f64.
const HALVINGS: u32 = 52;

/// A cubic Bézier segment: P1, its handle P2, P4's handle P3, P4.
///
/// `t` runs from 0 to 1; what is outside of that continues the polynomial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// P1's longitude, from which those below are counted. \[rad\]
    origin: f64,
    /// x is the latitude, y the longitude from `origin`. \[rad\]
    segment: CubicBezierSegment<f64>,
}

/// The box that a curve does not leave: that of its four points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least and greatest latitude. \[rad\]
    pub latitudes: [f64; 2],
    /// Least and greatest longitude. The greatest is above π where the box spans the antimeridian.
    /// \[rad\]
    pub longitudes: [f64; 2],
}

impl Curve {
    /// The curve through these points: P1, P2, P3, P4.
    ///
    /// # Errors
    ///
    /// `Latitude` when one of them is beyond 85°.
    pub fn new(points: [Place; 4]) -> Result<Self, Refusal> {
        let [p1, _, _, _] = points;
        let [from, ctrl1, ctrl2, to] = points.map(|it| {
            let longitude = it.longitude.from(p1.longitude);
            point(it.latitude.radians(), longitude.radians())
        });
        let latitudes = [from.x, ctrl1.x, ctrl2.x, to.x];
        if latitudes.iter().any(|it| it.abs() > MAX_LATITUDE) {
            return Err(Refusal::Latitude);
        }
        let segment = CubicBezierSegment {
            from,
            ctrl1,
            ctrl2,
            to,
        };
        Ok(Self {
            origin: p1.longitude.radians(),
            segment,
        })
    }

    /// Latitude and longitude at `t`, the longitude from −π to below π. \[rad\]
    #[must_use]
    pub fn at(&self, t: f64) -> (f64, f64) {
        let here = self.segment.sample(t);
        (here.x, wrapped(self.origin + here.y))
    }

    /// The nearest place of 32 bits at `t`.
    #[must_use]
    pub fn place(&self, t: f64) -> Place {
        let (latitude, longitude) = self.at(t);
        Place {
            latitude: Bam::from_radians(latitude),
            longitude: Bam::from_radians(longitude),
        }
    }

    /// How fast the place moves with t: |B'| on the ellipsoid. \[m\]
    #[must_use]
    pub fn speed_m(&self, t: f64) -> f64 {
        self.metres(t, self.segment.derivative(t)).length()
    }

    /// From north over east, −π to π, at `t`. \[rad\]
    ///
    /// At an end without a handle and at a cusp it is that of what follows, or of what came before at
    /// t = 1. A point has none.
    #[must_use]
    pub fn heading(&self, t: f64) -> Option<f64> {
        let CubicBezierSegment {
            from,
            ctrl1,
            ctrl2,
            to,
        } = self.segment;
        let bend1 = from.to_vector() - ctrl1.to_vector() * 2.0 + ctrl2.to_vector();
        let bend2 = ctrl1.to_vector() - ctrl2.to_vector() * 2.0 + to.to_vector();
        let second = bend1 * (1.0 - t) + bend2 * t;
        let ahead = if t < 1.0 { 1.0 } else { -1.0 };
        let size = [ctrl1, ctrl2, to]
            .map(|it| (it - from).length())
            .into_iter()
            .fold(0.0, f64::max);
        [self.segment.derivative(t), second * ahead, to - from]
            .into_iter()
            .find(|it| it.length() > (size * NO_DIRECTION).max(NO_WAY))
            .map(|it| {
                let metres = self.metres(t, it);
                libm::atan2(metres.y, metres.x)
            })
    }

    /// Its length, within 0.01 mm on curves of 3 km; where a curve all but stops on its way, within
    /// 1 %. \[m\]
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.length_to_m(1.0)
    }

    /// The length from P1 to `t`. \[m\]
    #[must_use]
    pub fn length_to_m(&self, t: f64) -> f64 {
        let part = 1.0 / f64::from(PARTS);
        let parts = (0..PARTS).map(|n| f64::from(n) * part);
        parts
            .filter(|&from| from < t)
            .map(|from| integral(from, (from + part).min(t), |t| self.speed_m(t)))
            .sum()
    }

    /// Where one is after `length_m` from P1, as t from 0 to 1: for one who flies at `v`, after v times
    /// the time.
    #[must_use]
    pub fn t_at_length(&self, length_m: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        if length_m >= self.length_m() {
            return high;
        }
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            if self.length_to_m(middle) < length_m {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// The curves before and behind `t`: de Casteljau's.
    #[must_use]
    pub fn split(&self, t: f64) -> (Self, Self) {
        let (before, behind) = self.segment.split(t);
        let with = |segment| Self { segment, ..*self };
        (with(before), with(behind))
    }

    /// The same curve flown from P4 to P1.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let CubicBezierSegment {
            from,
            ctrl1,
            ctrl2,
            to,
        } = self.segment;
        let segment = CubicBezierSegment {
            from: to,
            ctrl1: ctrl2,
            ctrl2: ctrl1,
            to: from,
        };
        Self { segment, ..*self }
    }

    /// In how many equal steps of t straight pieces stay within `tolerance_m` of it: ⌈√(¾ m/ε)⌉, m
    /// being the longer of the second differences. \[m\]
    ///
    /// `None` for a tolerance of 0 or less, and when it takes more than 65 536.
    #[must_use]
    pub fn pieces(&self, tolerance_m: f64) -> Option<u32> {
        let widest = self.widest();
        let [p1, p2, p3, p4] = self.points().map(Point2D::to_vector);
        let bend = [p1 - p2 * 2.0 + p3, p2 - p3 * 2.0 + p4]
            .map(|it| in_metres(widest, it).length())
            .into_iter()
            .fold(0.0, f64::max);
        let pieces = libm::ceil(libm::sqrt(0.75 * bend / tolerance_m)).max(1.0);
        (tolerance_m > 0.0 && pieces <= f64::from(MAX_PIECES)).then_some(pieces as u32)
    }

    /// The ends of those straight pieces, from P1 to P4.
    pub fn flattened(&self, pieces: u32) -> impl Iterator<Item = Place> + use<> {
        let curve = *self;
        (0..=pieces).map(move |n| curve.place(f64::from(n) / f64::from(pieces.max(1))))
    }

    /// The box that it does not leave.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let points = self.points();
        let span = |of: fn(&Point2D<f64>) -> f64| {
            let values = points.iter().map(of);
            let least = values.clone().fold(f64::INFINITY, f64::min);
            [least, values.fold(f64::NEG_INFINITY, f64::max)]
        };
        let [west, east] = span(|it| it.y);
        let begin = wrapped(self.origin + west);
        Bounds {
            latitudes: span(|it| it.x),
            longitudes: [begin, begin + (east - west)],
        }
    }

    fn points(&self) -> [Point2D<f64>; 4] {
        let it = self.segment;
        [it.from, it.ctrl1, it.ctrl2, it.to]
    }

    /// A difference at `t` in metres: x north, y east.
    fn metres(&self, t: f64, radians: Vector2D<f64>) -> Vector2D<f64> {
        in_metres(scale(self.segment.sample(t).x), radians)
    }

    /// At least as many metres to the radian as anywhere between its points.
    fn widest(&self) -> Scale {
        let [south, north] = self.bounds().latitudes;
        let at_equator = if south < 0.0 && north > 0.0 {
            0.0
        } else {
            south
        };
        let scales = [south, north, at_equator].map(scale);
        let widest = |of: fn(&Scale) -> f64| scales.iter().map(of).fold(0.0, f64::max);
        Scale {
            north_m: widest(|it| it.north_m),
            east_m: widest(|it| it.east_m),
        }
    }
}

fn in_metres(scale: Scale, radians: Vector2D<f64>) -> Vector2D<f64> {
    Vector2D::new(radians.x * scale.north_m, radians.y * scale.east_m)
}

/// A longitude of at most a few turns, from −π to below π. \[rad\]
fn wrapped(longitude: f64) -> f64 {
    longitude - libm::floor((longitude + PI) / TAU) * TAU
}
