//! The lowest points of a row of bins.
//!
//! *Purpose.* The envelope's bounded memory: what a minute of marks had at its bottom.
//!
//! *Design.* One bin is being filled, the newest `N` that are full are kept, in a ring: the oldest
//! makes room. A bin keeps the point that was lowest along the line of its time, as it was
//! measured.
//!
//! *Limits.* Full bins come back in no particular order: none is needed here.

use super::trend::{Point, Trend, seconds};

/// The bin that is being filled, and the lowest points of up to `N` full ones.
#[derive(Clone, Debug)]
pub(super) struct Bins<const N: usize> {
    width_us: u32,
    ends_us: u32,
    filling: Option<Point>,
    full: [Point; N],
    length: usize,
    next: usize,
}

impl<const N: usize> Bins<N> {
    /// No bins yet, each to be `width_us` wide.
    pub(super) const fn new(width_us: u32) -> Self {
        const NOTHING: Point = Point {
            at_us: 0,
            lateness_ns: 0,
        };
        Self {
            width_us,
            ends_us: 0,
            filling: None,
            full: [NOTHING; N],
            length: 0,
            next: 0,
        }
    }

    /// Begins anew, without a point.
    pub(super) const fn begin(&mut self, at_us: u32) {
        self.length = 0;
        self.next = 0;
        self.filling = None;
        self.ends_us = at_us.wrapping_add(self.width_us);
    }

    /// Whether the time of the bin that is being filled is over.
    pub(super) const fn is_over(&self, at_us: u32) -> bool {
        at_us.wrapping_sub(self.ends_us).cast_signed() >= 0
    }

    /// For how long the bin has been filled by then, in s.
    pub(super) fn lasted_s(&self, at_us: u32) -> f32 {
        seconds(at_us, self.ends_us.wrapping_sub(self.width_us))
    }

    /// Closes the bin that is being filled and begins the next; the lowest point of the one that is
    /// closed.
    pub(super) fn close(&mut self, at_us: u32) -> Option<Point> {
        self.ends_us = at_us.wrapping_add(self.width_us);
        let lowest = self.filling.take()?;
        self.keep(lowest);
        Some(lowest)
    }

    /// Keeps a point as if it were the lowest of a full bin.
    pub(super) fn keep(&mut self, point: Point) {
        if let Some(place) = self.full.get_mut(self.next) {
            *place = point;
        }
        self.next = if self.next + 1 < N { self.next + 1 } else { 0 };
        self.length = (self.length + 1).min(N);
    }

    /// Puts a point that is `excess_ns` above `line` into the bin that is being filled. Of the two
    /// lowest so far the higher one comes back.
    pub(super) fn fill(&mut self, point: Point, excess_ns: i32, line: &Trend) -> Option<i32> {
        let lowest_ns = self.filling.map(|lowest| line.excess_ns(lowest));
        match lowest_ns {
            Some(lowest_ns) if lowest_ns <= excess_ns => Some(excess_ns),
            _ => {
                self.filling = Some(point);
                lowest_ns
            }
        }
    }

    /// The lowest point of the bin that is being filled.
    pub(super) const fn filling(&self) -> Option<Point> {
        self.filling
    }

    /// The lowest point of the oldest full one.
    pub(super) fn oldest(&self) -> Option<Point> {
        let first = if self.length < N { 0 } else { self.next };
        self.full().get(first).copied()
    }

    /// The lowest points of the full ones.
    pub(super) fn full(&self) -> &[Point] {
        self.full.get(..self.length).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    fn point(at_us: u32, lateness_ns: u32) -> Point {
        Point { at_us, lateness_ns }
    }

    #[test]
    fn the_lowest_of_the_newest_bins_are_kept() {
        let line = Trend::default();
        let mut bins = Bins::<3>::new(10);
        bins.begin(0);
        for bin in 0..7_u32 {
            let at_us = bin * 10 + 5;
            for lateness_ns in [40 + bin, 30 + bin, 60] {
                let point = point(at_us, lateness_ns);
                bins.fill(point, line.excess_ns(point), &line);
            }
            assert!(!bins.is_over(bin * 10 + 9));
            assert!(bins.is_over(bin * 10 + 10));
            assert_eq!(bins.close(bin * 10 + 10), Some(point(at_us, 30 + bin)));
            let mut kept: Vec<u32> = bins.full().iter().map(|p| p.lateness_ns - 30).collect();
            kept.sort_unstable();
            let expected: Vec<u32> = (bin.saturating_sub(2)..=bin).collect();
            assert_eq!(kept, expected);
        }
        assert_eq!(bins.close(80), None);
    }

    #[test]
    fn the_second_lowest_comes_back() {
        let line = Trend::default();
        let mut bins = Bins::<3>::new(10);
        let received: Vec<_> = [7, 9, 3, 5, 1]
            .into_iter()
            .map(|ns| bins.fill(point(0, ns), ns.cast_signed(), &line))
            .collect();
        assert_eq!(received, [None, Some(9), Some(7), Some(5), Some(3)]);
    }
}
