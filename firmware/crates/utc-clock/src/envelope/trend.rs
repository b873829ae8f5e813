//! Points and the straight line among them, on the board's own counter.
//!
//! *Purpose.* What the envelope's parts have in common.
//!
//! *Design.* Times are µs, latenesses ns, both in 32 bits that wrap: 8 bytes a point, and
//! differences are exact. A level is a lateness; a frequency is how fast it rises.
//!
//! *Limits.* Two points are at most 35 minutes and 2.1 s of lateness apart.

/// A mark: when it arrived, and how late it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Point {
    /// When it arrived, in µs.
    pub(super) at_us: u32,
    /// Its arrival by the board's counter less its epoch, in ns.
    pub(super) lateness_ns: u32,
}

/// The straight line that the floor follows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Trend {
    pub(super) at_us: u32,
    pub(super) level_ns: u32,
    /// Its rise in ns a second: the crystal's error.
    pub(super) crystal_ppb: f32,
}

impl Trend {
    /// How far above the line a point is, in ns.
    pub(super) fn excess_ns(&self, point: Point) -> i32 {
        let rise_ns = self.crystal_ppb * seconds(point.at_us, self.at_us);
        point
            .lateness_ns
            .wrapping_sub(self.level_ns)
            .wrapping_sub(rise_ns as i32 as u32)
            .cast_signed()
    }

    /// The same line, seen from another moment.
    pub(super) fn moved_to(&self, at_us: u32) -> Self {
        let rise_ns = self.crystal_ppb * seconds(at_us, self.at_us);
        self.raised(rise_ns as i32).at(at_us)
    }

    /// The line through a point, with the same rise.
    pub(super) const fn through(&self, point: Point) -> Self {
        Self {
            at_us: point.at_us,
            level_ns: point.lateness_ns,
            crystal_ppb: self.crystal_ppb,
        }
    }

    /// The line `ns` above this one.
    pub(super) const fn raised(&self, ns: i32) -> Self {
        Self {
            level_ns: self.level_ns.wrapping_add(ns as u32),
            ..*self
        }
    }

    const fn at(&self, at_us: u32) -> Self {
        Self { at_us, ..*self }
    }
}

/// From `earlier` to `later`, in s; negative the other way round.
pub(super) fn seconds(later_us: u32, earlier_us: u32) -> f32 {
    later_us.wrapping_sub(earlier_us).cast_signed() as f32 * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_line_is_the_same_line_across_the_wraps() {
        let line = Trend {
            at_us: u32::MAX - 5_000_000,
            level_ns: u32::MAX - 100,
            crystal_ppb: 40_000.0,
        };
        let point = Point {
            at_us: 5_000_000,
            lateness_ns: 1_000_000,
        };
        // 10 s and 1 µs at 40 ppm are 400 000 ns.
        assert_eq!(line.excess_ns(point), 1_000_101 - 400_000);
        let moved = line.moved_to(7_000_000);
        assert!((moved.excess_ns(point) - line.excess_ns(point)).abs() <= 1);
        assert_eq!(line.through(point).excess_ns(point), 0);
        assert_eq!(line.through(point).raised(7).excess_ns(point), -7);
    }
}
