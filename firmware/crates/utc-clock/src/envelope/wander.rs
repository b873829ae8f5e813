//! Wander: whether the floor itself moves.
//!
//! *Purpose.* The floors of real receivers wander by ms over minutes. Whatever learns a crystal's
//! frequency in a minute reads that as drift, and is worse than without a frequency.
//!
//! *Design.* 64 bins of 7.5 s, eight minutes. A parabola is fitted to their lowest points: a
//! crystal that drifts. When they scatter about it by more than their edge explains,
//! the floor wanders: for as long as that lasts, the frequency is the average of the straight
//! line's slope, over many minutes, so that the wander's own slope averages out; and the
//! scatter is uncertainty.
//!
//! *Limits.* Wander slower than some 15 minutes is a parabola to it. It has no opinion before
//! the ring is three quarters full.

use crate::float::sqrt;

use super::bins::Bins;
use super::density::ArrivalDensity;
use super::trend::{Point, Trend, seconds};

const BIN_US: u32 = 7_500_000;
const BINS: usize = 64;
/// The ring is asked when it is so full: 6 minutes.
const ENOUGH: usize = 48;
/// So many points are looked at for one mark.
const AT_ONCE: usize = 12;
/// The whole ring, in s.
const FULL_S: f32 = 480.0;

/// A floor that rises by more over the ring is on its way to somewhere else, as no crystal's is: 125 ppm.
/// \[ns\]
const BEYOND_CRYSTALS_NS: f32 = 60e6;

/// The slow frequency averages so many opinions of a full ring: 50 minutes of them.
const SLOW_WEIGHTS: f32 = 400.0;

/// The floor wanders when its points scatter so many times as much, in variance, as the edge
/// explains: exponential noise, each point's part capped at [`CAP`] standard deviations, has 0.85,
/// and on 64 points exceeds this once in some 10⁵ judgements. Tuned.
const SURE: f32 = 2.4;
/// Less is enough to go on believing it.
const STILL_SURE: f32 = 1.1;
const CAP: f32 = 3.0;

/// Whether the floor wanders, and the frequency if it does.
#[derive(Clone, Debug)]
pub(super) struct Wander {
    bins: Bins<BINS>,
    is_due: bool,
    judging: Option<(Frame, Step)>,
    slow_ppb: f32,
    weight: f32,
    /// About the long line while the floor wanders, in ns; else 0.
    scatter_ns: f32,
}

impl Wander {
    pub(super) const fn new(crystal_ppb: f32) -> Self {
        Self {
            bins: Bins::new(BIN_US),
            is_due: false,
            judging: None,
            slow_ppb: crystal_ppb,
            weight: 0.0,
            scatter_ns: 0.0,
        }
    }

    /// A new floor: the frequency stays.
    pub(super) const fn begin(&mut self, at_us: u32) {
        self.bins.begin(at_us);
        self.is_due = false;
        self.judging = None;
        self.scatter_ns = 0.0;
    }

    /// Forgets the frequency of many minutes.
    pub(super) const fn forget(&mut self) {
        self.weight = 0.0;
    }

    /// Takes a point in.
    pub(super) fn fill(&mut self, point: Point, excess_ns: i32, line: &Trend) {
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

    /// Does a piece of the judgement, [`AT_ONCE`] points; whether that was the last one.
    pub(super) fn judge(&mut self, at_us: u32, line: &Trend, edge: &ArrivalDensity) -> bool {
        let points = self.bins.full();
        let (frame, step) = match self.judging.take() {
            Some(judging) => judging,
            None => {
                self.is_due = false;
                if points.len() < ENOUGH {
                    return true;
                }
                let oldest = self.bins.oldest().unwrap_or_default();
                let frame = Frame::new(at_us, line, oldest);
                (frame, Step::Fit(0, Sums::default()))
            }
        };
        let next = match step {
            Step::Fit(done, mut sums) => {
                for point in points.iter().skip(done).take(AT_ONCE) {
                    sums.add(frame.place(*point));
                }
                if done + AT_ONCE < points.len() {
                    Step::Fit(done + AT_ONCE, sums)
                } else {
                    let fit = Parabola::fit(&sums);
                    self.learn(&frame, &fit);
                    Step::Weigh(0, fit, 0.0)
                }
            }
            Step::Weigh(done, fit, mut capped) => {
                let explained = explained(edge);
                let most = CAP * CAP * explained;
                for point in points.iter().skip(done).take(AT_ONCE) {
                    let ns = fit.residual(frame.place(*point));
                    capped += (ns * ns).min(most);
                }
                if done + AT_ONCE >= points.len() {
                    self.conclude(capped / (explained * (points.len() as f32 - 3.0)), &fit);
                    return true;
                }
                Step::Weigh(done + AT_ONCE, fit, capped)
            }
        };
        self.judging = Some((frame, next));
        false
    }

    fn learn(&mut self, frame: &Frame, fit: &Parabola) {
        if 2.0 * fit.slope.abs() > BEYOND_CRYSTALS_NS {
            return;
        }
        let part = 2.0 * frame.half_s / FULL_S;
        let weight = part * part * part;
        self.weight = (self.weight + weight).min(SLOW_WEIGHTS);
        let crystal_ppb = frame.line.crystal_ppb + fit.slope / frame.half_s;
        self.slow_ppb += weight / self.weight * (crystal_ppb - self.slow_ppb);
    }

    fn conclude(&mut self, excess: f32, fit: &Parabola) {
        let sure = if self.scatter_ns > 0.0 {
            STILL_SURE
        } else {
            SURE
        };
        self.scatter_ns = if excess > sure {
            sqrt(fit.scatter)
        } else {
            0.0
        };
    }
}

/// The variance about a parabola that the edge alone explains, in ns².
fn explained(edge: &ArrivalDensity) -> f32 {
    let edge_ns = edge.gap_in(BIN_US as f32 * 1e-6) * EXPONENTIAL;
    edge_ns * edge_ns + BEND_NS * BEND_NS
}

/// How far a judgement has come: points that are done, and what came of them.
#[derive(Clone, Copy, Debug)]
enum Step {
    Fit(usize, Sums),
    /// With the sum of the squares about the parabola, each capped.
    Weigh(usize, Parabola, f32),
}

/// From where a judgement looks at the points.
#[derive(Clone, Copy, Debug)]
struct Frame {
    line: Trend,
    /// Half of the time from the oldest point to now, in s.
    half_s: f32,
}

impl Frame {
    fn new(at_us: u32, line: &Trend, oldest: Point) -> Self {
        Self {
            line: line.moved_to(at_us),
            half_s: (seconds(at_us, oldest.at_us) / 2.0).max(1.0),
        }
    }

    /// When a point was, from −1 to 1, and how far above the line, in ns.
    fn place(&self, point: Point) -> (f32, f32) {
        let u = seconds(point.at_us, self.line.at_us) / self.half_s + 1.0;
        (u, self.line.excess_ns(point) as f32)
    }
}

/// What a parabola is fitted to.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f32,
    /// Of u, u², u³, u⁴.
    u: [f32; 4],
    /// Of y, uy, u²y.
    y: [f32; 3],
    yy: f32,
}

impl Sums {
    fn add(&mut self, (u, ns): (f32, f32)) {
        let uu = u * u;
        let [u1, u2, u3, u4] = self.u;
        let [y0, y1, y2] = self.y;
        self.n += 1.0;
        self.u = [u1 + u, u2 + uu, u3 + u * uu, u4 + uu * uu];
        self.y = [y0 + ns, y1 + u * ns, y2 + uu * ns];
        self.yy += ns * ns;
    }
}

/// A parabola fitted to points: what a crystal that drifts steadily makes of them.
#[derive(Clone, Copy, Debug)]
struct Parabola {
    /// The rise of the straight line through the same points, over half of their time, in ns.
    slope: f32,
    /// In u, from −1 to 1: height, slope and bend, in ns.
    in_u: [f32; 3],
    /// The variance about the parabola, in ns².
    scatter: f32,
}

impl Parabola {
    /// By least squares; Gram and Schmidt: less the mean, less the slope, less the bend.
    fn fit(sums: &Sums) -> Self {
        let Sums {
            n,
            u: [u1, u2, u3, u4],
            y: [y0, y1, y2],
            yy,
        } = *sums;
        let (a11, a12, a22) = (u2 - u1 * u1 / n, u3 - u1 * u2 / n, u4 - u2 * u2 / n);
        let (b1, b2) = (y1 - u1 * y0 / n, y2 - u2 * y0 / n);
        let slope = quotient(b1, a11);
        let bend = quotient(b2 - a12 * slope, a22 - a12 * quotient(a12, a11));
        let bent = bend * (b2 - a12 * slope);
        let bent_slope = slope - bend * quotient(a12, a11);
        let height = (y0 - bent_slope * u1 - bend * u2) / n;
        let left = yy - y0 * y0 / n - slope * b1 - bent;
        Self {
            slope,
            in_u: [height, bent_slope, bend],
            scatter: (left / (n - 3.0)).max(0.0),
        }
    }

    /// How far above the parabola a place is, in ns.
    fn residual(&self, (u, ns): (f32, f32)) -> f32 {
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
        let place = |i: u8| {
            let u = -1.0 + 0.04 * f32::from(i) + 0.0001 * f32::from(i) * f32::from(i);
            (u, 1_000.0 + 3_000.0 * u + 2_000.0 * u * u)
        };
        let mut sums = Sums::default();
        for i in 0..45 {
            sums.add(place(i));
        }
        let fit = Parabola::fit(&sums);
        // f32: of heights of 6 000 ns.
        assert!(fit.scatter < 1.0, "{}", fit.scatter);
        for i in 0..45 {
            assert!(fit.residual(place(i)).abs() < 1.0);
        }
        assert!((fit.slope - 3_000.0).abs() < 300.0, "{}", fit.slope);
    }
}
