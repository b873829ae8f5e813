//! The envelope among receivers that are late, early, silent and wander.

use super::*;

const MS: i64 = 1_000_000;
const PERIOD_US: i64 = 200_000;

/// A receiver at 5 Hz on a board whose crystal is so fast, and its last mark.
struct Marks {
    envelope: Envelope,
    crystal_ppb: i64,
    number: i64,
    chance: u64,
}

impl Marks {
    fn new(crystal_ppb: i64) -> Self {
        Self {
            envelope: Envelope::new(0.0, 25_000.0),
            crystal_ppb,
            number: 0,
            chance: 1,
        }
    }

    /// Even between 0 and 30 ms.
    fn jitter(&mut self) -> i64 {
        self.chance = self
            .chance
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.chance >> 33) as i64 * 30 * MS) >> 31
    }

    /// The next mark, so late by true time.
    fn handle(&mut self, late_ns: i64) -> EnvelopeVerdict {
        let epoch_us = self.number * PERIOD_US;
        self.number += 1;
        let arrival_us = epoch_us + late_ns / 1_000;
        let crystal_ns = arrival_us * self.crystal_ppb / 1_000_000;
        let at_us = arrival_us + crystal_ns / 1_000;
        self.envelope
            .update(at_us as u64, (late_ns + crystal_ns) as u32, false)
    }

    /// Marks for so many seconds; the last floor.
    fn feed_for(&mut self, s: i64, floor_ns: impl Fn(f64) -> f64) -> EnvelopeEstimate {
        let mut last = None;
        for _ in 0..s * 5 {
            let at_s = self.number as f64 / 5.0;
            let late_ns = 50 * MS + floor_ns(at_s) as i64 + self.jitter();
            if let EnvelopeVerdict::Estimate(floor) = self.handle(late_ns) {
                last = Some(floor);
            }
        }
        last.unwrap()
    }
}

#[test]
fn floor_and_frequency_are_found() {
    for crystal_ppb in [-50_000, 0, 44_000] {
        let mut marks = Marks::new(crystal_ppb);
        let floor = marks.feed_for(180, |_| 0.0);
        assert!(
            (floor.crystal_ppb - crystal_ppb as f32).abs() < 5_000.0,
            "{floor:?}"
        );
        // The next mark is so late as we know, so that its excess is the line's error.
        let EnvelopeVerdict::Estimate(floor) = marks.handle(60 * MS) else {
            panic!("a good mark");
        };
        let off_ns = i64::from(floor.excess_ns) - 10 * MS;
        assert!(off_ns.abs() < MS / 2, "{off_ns}");
        assert!(floor.uncertainty_ns < MS as f32);
    }
}

#[test]
fn a_crystal_at_the_edge_of_what_they_are_is_found_too() {
    for crystal_ppb in [-97_000, 97_000] {
        let mut marks = Marks::new(crystal_ppb);
        let floor = marks.feed_for(180, |_| 0.0);
        let off_ppb = (floor.crystal_ppb - crystal_ppb as f32).abs();
        assert!(off_ppb < 5_000.0, "{floor:?}");
    }
}

#[test]
fn what_is_too_late_is_left_alone() {
    let mut marks = Marks::new(20_000);
    marks.feed_for(200, |_| 0.0);
    for _ in 0..20 {
        assert_eq!(marks.handle(160 * MS), EnvelopeVerdict::Late);
    }
    let EnvelopeVerdict::Estimate(floor) = marks.handle(51 * MS) else {
        panic!("a good mark");
    };
    assert!((i64::from(floor.excess_ns) - MS).abs() < MS / 2);
}

#[test]
fn what_is_too_early_has_to_be_confirmed() {
    let mut marks = Marks::new(20_000);
    marks.feed_for(200, |_| 0.0);
    for _ in 0..9 {
        for _ in 0..2 {
            assert_eq!(marks.handle(20 * MS), EnvelopeVerdict::Early);
        }
        for _ in 0..2 {
            assert!(matches!(
                marks.handle(60 * MS),
                EnvelopeVerdict::Estimate(_)
            ));
        }
    }
    // They are alone from then on, for 75 s in all.
    for _ in 9 * 4..75 * 5 {
        assert_eq!(marks.handle(20 * MS), EnvelopeVerdict::Early);
    }
    let EnvelopeVerdict::Moved(floor) = marks.handle(20 * MS) else {
        panic!("confirmed");
    };
    assert!((floor.excess_ns).abs() < 1_000_000, "{floor:?}");
    assert!((floor.crystal_ppb - 20_000.0).abs() < 3_000.0);
}

#[test]
fn a_floor_that_wanders_is_noticed_and_is_no_frequency() {
    let mut marks = Marks::new(30_000);
    let wandering = |s: f64| 4e6 * (s * core::f64::consts::TAU / 120.0).sin();
    let floor = marks.feed_for(900, wandering);
    assert!(floor.uncertainty_ns > 2e6, "{floor:?}");
    assert!((floor.crystal_ppb - 30_000.0).abs() < 2_000.0, "{floor:?}");
    let floor = marks.feed_for(900, |_| 0.0);
    assert!(floor.uncertainty_ns < 1e6, "{floor:?}");
}

#[test]
fn the_first_mark_after_silence_draws_nothing_after_it() {
    let mut marks = Marks::new(30_000);
    marks.feed_for(300, |_| 0.0);
    marks.number += 5 * 600;
    let EnvelopeVerdict::Estimate(floor) = marks.handle(80 * MS) else {
        panic!("a good mark");
    };
    // 10 min at 1 ppm a minute are 3 ms, and the frequency's own uncertainty.
    assert!(floor.excess_ns > 20 * MS as i32, "{floor:?}");
}
