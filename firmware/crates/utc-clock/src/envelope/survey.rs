//! The survey: one look over the window, a piece at a time.
//!
//! *Purpose.* What the frequency and the edge are learnt from: the lowest points of the
//! window's two halves, and the lowest of all.
//!
//! *Design.* The points are looked at along one line, as it was when the survey began, so
//! many for each mark that comes.
//!
//! *Limits.* A bin that is overwritten meanwhile counts as it is then.

use super::density::Lowest;
use super::trend::{Point, Trend, seconds};

/// So many points are looked at for one mark.
const AT_ONCE: usize = 12;

/// A look over the window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Survey {
    line: Trend,
    span_s: f32,
    done: usize,
    lowest: Lowest,
    /// How far above the line the lowest of the older half is, in ns, and how old, in s.
    older: Option<(i32, f32)>,
    newer: Option<(i32, f32)>,
}

impl Survey {
    /// A survey of the last `span_s` before the moment that `line` begins at.
    pub(super) const fn new(line: Trend, span_s: f32) -> Self {
        Self {
            line,
            span_s,
            done: 0,
            lowest: Lowest::new(),
            older: None,
            newer: None,
        }
    }

    /// Looks at some more of the points; whether those were the last.
    pub(super) fn look(&mut self, points: &[Point]) -> bool {
        for point in points.iter().skip(self.done).take(AT_ONCE) {
            let age_s = seconds(self.line.at_us, point.at_us);
            if age_s > self.span_s {
                continue;
            }
            let excess_ns = self.line.excess_ns(*point);
            self.lowest.add(excess_ns);
            let half = if age_s > self.span_s / 2.0 {
                &mut self.older
            } else {
                &mut self.newer
            };
            if half.is_none_or(|(least, _)| excess_ns < least) {
                *half = Some((excess_ns, age_s));
            }
        }
        self.done += AT_ONCE;
        self.done >= points.len()
    }

    /// The lowest of all.
    pub(super) const fn lowest(&self) -> &Lowest {
        &self.lowest
    }

    /// How long a time it looked at, in s.
    pub(super) const fn span_s(&self) -> f32 {
        self.span_s
    }

    /// The slope between the lowest points of the halves, in ppb, with the time between them, in s.
    pub(super) fn slope(&self) -> Option<(f32, f32)> {
        let ((older_ns, older_age_s), (newer_ns, newer_age_s)) = (self.older?, self.newer?);
        let apart_s = (older_age_s - newer_age_s).max(self.span_s / 4.0).max(1.0);
        let rise_ns = newer_ns.wrapping_sub(older_ns) as f32;
        Some((rise_ns / apart_s, apart_s))
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn pieces_make_the_whole() {
        let line = Trend {
            at_us: 100_000_000,
            ..Trend::default()
        };
        // A point each 2 s, 1 000 ns a second up, and one low point in each half.
        let points: Vec<Point> = (0..50_u32)
            .map(|i| Point {
                at_us: i * 2_000_000,
                lateness_ns: 100_000 + i * 2_000 - if i == 20 || i == 40 { 90_000 } else { 0 },
            })
            .collect();
        let mut survey = Survey::new(line, 90.0);
        let pieces = (1..).find(|_| survey.look(&points));
        assert_eq!(pieces, Some(points.len().div_ceil(AT_ONCE)));
        let (slope_ppb, apart_s) = survey.slope().unwrap();
        assert_eq!((slope_ppb, apart_s), (1_000.0, 40.0));
    }

    #[test]
    fn a_half_without_points_has_no_slope() {
        let mut survey = Survey::new(Trend::default(), 10.0);
        assert!(survey.look(&[]));
        assert_eq!(survey.slope(), None);
    }
}
