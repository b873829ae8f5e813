//! Wander: whether the floor itself moves.
//!
//! *Purpose.* The floors of real receivers wander by ms over minutes. Whatever learns a crystal's
//! frequency in a minute reads that as drift, and is worse than without a frequency.
//!
//! *Design.* 64 bins of 7.5 s, eight minutes. A straight line is fitted to their lowest points. When they
//! scatter about it by more than their edge and any crystal explain, the floor wanders: for
//! as long as that lasts, the frequency is the average of what the long line said, over many minutes, so
//! that the wander's own slope averages out; and the scatter is doubt.
//!
//! *Limits.* Wander slower than some 20 minutes is a straight line to it. It has no opinion before
//! the ring is three quarters full.

use super::bins::Bins;
use super::edge::Edge;
use super::line::{Line, Point, seconds};
use crate::holdover::DRIFT_PPB_PER_S;

const BIN_US: u32 = 7_500_000;
const BINS: usize = 64;
/// The ring is asked when it is so full: 6 minutes.
const ENOUGH: usize = 48;
/// The whole ring, in s.
const FULL_S: f32 = 480.0;

/// The slow frequency averages so many opinions of a full ring: 50 minutes of them.
const SLOW_WEIGHTS: f32 = 400.0;

/// How sure it has to be that a floor wanders: by so many standard deviations of the
/// variance of as many points of exponential noise, √(8/n) of it each.
const SURE: f32 = 7.0;
/// Less is enough to go on believing it.
const STILL_SURE: f32 = 0.64;

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
    pub(super) const fn begin(&mut self, point: Point) {
        self.bins.begin(point);
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
        let n = points.len() as f32;
        let (mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let mut span_s = 0.0_f32;
        for point in points {
            let age_s = seconds(at_us, point.at_us);
            let ns = line.excess_ns(*point) as f32;
            x -= age_s;
            y += ns;
            xx += age_s * age_s;
            xy -= age_s * ns;
            yy += ns * ns;
            span_s = span_s.max(age_s);
        }
        let (sxx, sxy, syy) = (xx - x * x / n, xy - x * y / n, yy - y * y / n);
        if sxx < 1.0 {
            return;
        }
        let slope_ppb = sxy / sxx;
        let part = span_s / FULL_S;
        let weight = part * part * part;
        self.weight = (self.weight + weight).min(SLOW_WEIGHTS);
        self.slow_ppb += weight / self.weight * (line.fast_ppb + slope_ppb - self.slow_ppb);

        let scatter = ((syy - slope_ppb * sxy) / (n - 2.0)).max(0.0);
        // A parabola's standard deviation about its line: d/2 · T²/(6√5).
        let bend_ns = DRIFT_PPB_PER_S * span_s * span_s / 26.8;
        let edge_ns = edge.gap_in(BIN_US as f32 * 1e-6) * EXPONENTIAL;
        let explained = edge_ns * edge_ns + bend_ns * bend_ns;
        let surely = explained * (1.0 + SURE * libm::sqrtf(8.0 / n));
        let held = if self.scatter_ns > 0.0 {
            STILL_SURE
        } else {
            1.0
        };
        self.scatter_ns = if scatter > surely * held {
            libm::sqrtf(scatter)
        } else {
            0.0
        };
    }
}

/// Room for what the gaps of an edge that is not quite even leave out. Tuned.
const EXPONENTIAL: f32 = 2.0 / 1.4;
