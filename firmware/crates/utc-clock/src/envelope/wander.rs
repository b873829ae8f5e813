//! Wander: whether the floor itself moves.
//!
//! *Purpose.* The floors of real receivers wander by ms over minutes. Whatever learns a crystal's
//! frequency in a minute reads that as drift, and is worse than without a frequency.
//!
//! *Design.* 64 bins of 7.5 s, eight minutes. A parabola is fitted to their lowest points: a
//! crystal that drifts. When they scatter about it by more than their edge explains,
//! the floor wanders: for as long as that lasts, the frequency is the average of the straight
//! line's slope, over many minutes, so that the wander's own slope averages out; and the
//! scatter is doubt.
//!
//! *Limits.* Wander slower than some 15 minutes is a parabola to it. It has no opinion before
//! the ring is three quarters full.

use super::bins::Bins;
use super::edge::Edge;
use super::line::{Line, Point, seconds};

const BIN_US: u32 = 7_500_000;
const BINS: usize = 64;
/// The ring is asked when it is so full: 6 minutes.
const ENOUGH: usize = 48;
/// The whole ring, in s.
const FULL_S: f32 = 480.0;

/// The slow frequency averages so many opinions of a full ring: 50 minutes of them.
const SLOW_WEIGHTS: f32 = 400.0;

/// The floor wanders when its points scatter so many times as much, in variance, as the edge explains:
/// exponential noise, each point's part capped at [`CAP`] standard deviations, has 0.85, and
/// on 64 points exceeds this once in some 10⁵ judgements. Tuned.
const SURE: f32 = 2.6;
/// Less is enough to go on believing it.
const STILL_SURE: f32 = 1.1;
const CAP: f32 = 3.0;

/// Whether the floor wanders, and the frequency if it does.
#[derive(Clone, Debug)]
pub(super) struct Wander {
    bins: Bins<BINS>,
    is_due: bool,
    slow_ppb: f32,
    weight: f32,
    /// About the long line while the floor wanders, in ns; else 0.
    scatter_ns: f32,
}

impl Wander {
    pub(super) const fn new(fast_ppb: f32) -> Self {
        Self {
            bins: Bins::new(BIN_US),
            is_due: false,
            slow_ppb: fast_ppb,
            weight: 0.0,
            scatter_ns: 0.0,
        }
    }

    /// A new floor: the frequency stays.
    pub(super) const fn begin(&mut self, at_us: u32) {
        self.bins.begin(at_us);
        self.is_due = false;
        self.scatter_ns = 0.0;
    }

    /// Takes a point in.
    pub(super) fn fill(&mut self, point: Point, excess_ns: i32, line: &Line) {
        if self.bins.is_over(point.at_us) {
            self.is_due |= self.bins.close(point.at_us).is_some();
        }
        self.bins.fill(point, excess_ns, line);
    }

    /// Whether [`Self::judge`] has something new to judge.
    pub(super) const fn is_due(&self) -> bool {
        self.is_due
    }

    /// Whether the floor wanders; by how much, in ns, or 0.
    pub(super) const fn scatter_ns(&self) -> f32 {
        self.scatter_ns
    }

    /// The frequency of many minutes, in ppb.
    pub(super) fn slow_ppb(&self) -> Option<f32> {
        (self.weight > 0.0).then_some(self.slow_ppb)
    }

    /// The lowest points of the full bins.
    pub(super) fn points(&self) -> &[Point] {
        self.bins.full()
    }

    /// Fits a straight line to the ring, and judges by it.
    pub(super) fn judge(&mut self, at_us: u32, line: &Line, edge: &Edge) {
        self.is_due = false;
        let points = self.bins.full();
        if points.len() < ENOUGH {
            return;
        }
        let line = line.moved_to(at_us);
        let span_s = points
            .iter()
            .map(|point| seconds(at_us, point.at_us))
            .fold(0.0, f32::max);
        let place = |point: &Point| {
            let ns = line.excess_ns(*point) as f32;
            (-seconds(at_us, point.at_us), ns)
        };
        let fit = Parabola::fit(points, span_s, place);
        let part = fit.span_s / FULL_S;
        let weight = part * part * part;
        self.weight = (self.weight + weight).min(SLOW_WEIGHTS);
        self.slow_ppb += weight / self.weight * (line.fast_ppb + fit.slope_ppb - self.slow_ppb);

        let edge_ns = edge.gap_in(BIN_US as f32 * 1e-6) * EXPONENTIAL;
        let explained = edge_ns * edge_ns + BEND_NS * BEND_NS;
        let most = CAP * CAP * explained;
        let capped: f32 = points
            .iter()
            .map(|point| fit.residual(place(point)))
            .map(|ns| (ns * ns).min(most))
            .sum();
        let sure = if self.scatter_ns > 0.0 {
            STILL_SURE
        } else {
            SURE
        };
        self.scatter_ns = if capped > sure * explained * (points.len() as f32 - 3.0) {
            libm::sqrtf(fit.scatter)
        } else {
            0.0
        };
    }
}

/// A parabola fitted to points: what a crystal that drifts steadily makes of them.
struct Parabola {
    span_s: f32,
    /// The slope of the straight line through the same points, in ppb.
    slope_ppb: f32,
    /// In u, from −1 to 1: height, slope and bend, in ns.
    in_u: [f32; 3],
    /// The variance about the parabola, in ns².
    scatter: f32,
}

impl Parabola {
    /// Fits by least squares; `place` tells a point's time in s, from −`span_s` to 0, and its height in ns.
    fn fit(points: &[Point], span_s: f32, place: impl Fn(&Point) -> (f32, f32)) -> Self {
        // Times from −1 to 1, where 1, u and u² − ⅓ are all but orthogonal for points that are spread evenly.
        let half_s = (span_s / 2.0).max(1.0);
        let n = points.len() as f32;
        let (mut y0, mut y1, mut y2, mut yy) = (0.0, 0.0, 0.0, 0.0);
        let (mut u1, mut u2, mut u3, mut u4) = (0.0, 0.0, 0.0, 0.0);
        for point in points {
            let (at_s, ns) = place(point);
            let u = at_s / half_s + 1.0;
            let uu = u * u;
            y0 += ns;
            y1 += u * ns;
            y2 += uu * ns;
            yy += ns * ns;
            u1 += u;
            u2 += uu;
            u3 += u * uu;
            u4 += uu * uu;
        }
        // Gram and Schmidt: less the mean, less the slope, less the bend.
        let (a11, a12, a22) = (u2 - u1 * u1 / n, u3 - u1 * u2 / n, u4 - u2 * u2 / n);
        let (b1, b2) = (y1 - u1 * y0 / n, y2 - u2 * y0 / n);
        let slope = quotient(b1, a11);
        let bend = quotient(b2 - a12 * slope, a22 - a12 * quotient(a12, a11));
        let bent = bend * (b2 - a12 * slope);
        let bent_slope = slope - bend * quotient(a12, a11);
        let height = (y0 - bent_slope * u1 - bend * u2) / n;
        let left = yy - y0 * y0 / n - slope * b1 - bent;
        Self {
            span_s,
            slope_ppb: slope / half_s,
            in_u: [height, bent_slope, bend],
            scatter: (left / (n - 3.0)).max(0.0),
        }
    }

    /// How far above the parabola a place is, in ns.
    fn residual(&self, (at_s, ns): (f32, f32)) -> f32 {
        let u = at_s / (self.span_s / 2.0).max(1.0) + 1.0;
        let [height, slope, bend] = self.in_u;
        ns - (height + u * (slope + u * bend))
    }
}

/// 0 where there is nothing to divide by.
fn quotient(dividend: f32, divisor: f32) -> f32 {
    if divisor > 0.0 {
        dividend / divisor
    } else {
        0.0
    }
}

/// What a crystal does beyond a steady drift, in ns: a drift of 1 ppm a minute that turns round in
/// the middle of the ring is a cubic of so much about its parabola.
const BEND_NS: f32 = 60_000.0;

/// Room for what the gaps of an edge that is not quite even leave out. Tuned.
const EXPONENTIAL: f32 = 2.0 / 1.4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_and_leaves_nothing() {
        let points = [Point::default(); 50];
        let places: [(f32, f32); 50] = core::array::from_fn(|i| {
            let at_s = -(i as f32) * (10.0 - 0.05 * i as f32);
            (at_s, 1_000.0 + 30.0 * at_s + 0.2 * at_s * at_s)
        });
        let row = core::cell::Cell::new(0);
        let place = |_: &Point| {
            let place = places[row.get() % 50];
            row.set(row.get() + 1);
            place
        };
        let span_s = -places[49].0;
        let fit = Parabola::fit(&points, span_s, place);
        // f32: of heights of 30 000 ns.
        assert!(fit.scatter < 4.0, "{}", fit.scatter);
        for place in places {
            assert!(fit.residual(place).abs() < 1.0);
        }
        // The straight line's slope is that of the chord, nearly.
        assert!((fit.slope_ppb - (30.0 - 0.2 * span_s)).abs() < 0.05 * span_s);
    }
}
