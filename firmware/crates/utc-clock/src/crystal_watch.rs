//! The crystal's promise: whether it is farther off than any crystal of these boards.
//!
//! *Purpose.* All uncertainties rest on a crystal within [`CRYSTAL_PPB`]. One that is broken, by
//! 300 ppm for example, would lead a clock out of its claim in minutes. This notices it by the
//! messages; `train` does by the pulses.
//!
//! *Design.* Of each [`BLOCK_US`] the least lateness is kept. When [`ENOUGH`] blocks on end are
//! farther from the one before than a crystal makes them, all to the same side, it is the crystal:
//! floors that step, ramp or breathe do so for less long. As many blocks on end that are not end it.
//!
//! *Limits.* Between 110 and some 170 ppm it may notice nothing; the claim is wide enough there.

use crate::holdover::CRYSTAL_PPB;

/// A block. \[µs\]
const BLOCK_US: u32 = 50_000_000;
/// So many on end are enough.
const ENOUGH: i8 = 4;
/// What a crystal makes in a block, and what its jitter may add. \[ns\]
const CRYSTALS_NS: i32 = (CRYSTAL_PPB as i32) * 50 + 3_000_000;
/// What no crystal does, however broken: 2 000 ppm. \[ns\]
const LABELS_NS: i32 = 2_000_000 * 50;

/// The floors of the blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrystalWatch {
    begun_us: u32,
    /// The least lateness of the block that is being filled, and of the one before. \[ns\]
    lowest_ns: Option<u32>,
    before_ns: Option<u32>,
    /// Blocks on end that are too far away: later ones count up, earlier ones down.
    away: i8,
    /// Blocks on end that are not.
    within: i8,
    is_beyond: bool,
}

impl CrystalWatch {
    pub(crate) const fn new() -> Self {
        Self {
            begun_us: 0,
            lowest_ns: None,
            before_ns: None,
            away: 0,
            within: 0,
            is_beyond: false,
        }
    }

    /// Whether the crystal is beyond its promise.
    pub(crate) const fn is_beyond(&self) -> bool {
        self.is_beyond
    }

    /// Takes a mark that came at `at_us` by the board's counter, which wraps, and was so late.
    /// Whether a block is over with which enough of them are within the promise.
    pub(crate) fn push(&mut self, at_us: u32, lateness_ns: u32) -> bool {
        let Some(lowest_ns) = self.lowest_ns else {
            self.begun_us = at_us;
            self.lowest_ns = Some(lateness_ns);
            return false;
        };
        let lasts_us = at_us.wrapping_sub(self.begun_us);
        if lasts_us < BLOCK_US {
            if apart_ns(lateness_ns, lowest_ns) < 0 {
                self.lowest_ns = Some(lateness_ns);
            }
            return false;
        }
        if lasts_us < 2 * BLOCK_US {
            if let Some(before_ns) = self.before_ns {
                self.judge(apart_ns(lowest_ns, before_ns));
            }
            self.before_ns = Some(lowest_ns);
            self.begun_us = self.begun_us.wrapping_add(BLOCK_US);
        } else {
            // A silence: neither before nor after it is known how long the floor took.
            self.before_ns = None;
            self.away = 0;
            self.begun_us = at_us;
        }
        self.lowest_ns = Some(lateness_ns);
        self.within >= ENOUGH
    }

    fn judge(&mut self, apart_ns: i32) {
        let is_away = apart_ns.abs() > CRYSTALS_NS && apart_ns.abs() < LABELS_NS;
        let is_same_side = self.away.signum() != -apart_ns.signum() as i8;
        self.away = match (is_away, is_same_side) {
            (false, _) => 0,
            (true, true) => self.away.saturating_add(apart_ns.signum() as i8),
            (true, false) => apart_ns.signum() as i8,
        };
        self.within = if is_away {
            0
        } else {
            self.within.saturating_add(1)
        };
        if self.away.unsigned_abs() >= ENOUGH.unsigned_abs() {
            self.is_beyond = true;
        } else if self.within >= ENOUGH {
            self.is_beyond = false;
        }
    }
}

fn apart_ns(lateness_ns: u32, from_ns: u32) -> i32 {
    lateness_ns.wrapping_sub(from_ns).cast_signed()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Marks at 5 Hz with 30 ms of jitter, from `from_s` for `lasts_s`.
    fn feed(watch: &mut CrystalWatch, from_s: u32, lasts_s: u32, late_ns: impl Fn(u32) -> i64) {
        for mark in from_s * 5..(from_s + lasts_s) * 5 {
            let jitter_ns = i64::from(mark * 7_919 % 101) * 300_000;
            let late_ns = late_ns(mark / 5) + jitter_ns;
            watch.push(mark * 200_000, late_ns as u32);
        }
    }

    #[test]
    fn a_crystal_beyond_its_promise_is_noticed_in_both_directions() {
        for ppm in [-500_i64, -300, -190, 190, 300, 500] {
            let mut watch = CrystalWatch::new();
            feed(&mut watch, 0, 249, |s| i64::from(s) * ppm * 1_000);
            assert!(!watch.is_beyond(), "{ppm}: too soon");
            feed(&mut watch, 249, 4, |s| i64::from(s) * ppm * 1_000);
            assert!(watch.is_beyond(), "{ppm}");
            // It is cold again.
            let then_ns = 253 * ppm * 1_000;
            feed(&mut watch, 253, 300, |_| then_ns);
            assert!(!watch.is_beyond(), "{ppm}");
        }
    }

    #[test]
    fn what_crystals_and_floors_do_is_no_reason() {
        for ppm in [-110_i64, 97, 110] {
            let mut watch = CrystalWatch::new();
            feed(&mut watch, 0, 2_000, |s| i64::from(s) * ppm * 1_000);
            assert!(!watch.is_beyond(), "{ppm}");
        }
        let mut watch = CrystalWatch::new();
        // 60 ms in 100 s, a label of an hour, and a floor that breathes by 35 ms.
        feed(&mut watch, 0, 300, |s| i64::from(s.min(100)) * 600_000);
        feed(&mut watch, 300, 100, |_| 3_600_000_000_000);
        feed(&mut watch, 400, 900, |s| {
            (35e6 * (f64::from(s) * core::f64::consts::TAU / 240.0).sin()) as i64
        });
        assert!(!watch.is_beyond());
    }
}
