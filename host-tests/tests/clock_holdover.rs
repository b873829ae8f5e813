//! The clock while nothing is heard, and when the receiver is back.
//!
//! *Design.* An M8 in the simulated world falls silent, for a second or for hours,
//! under the referee of `clock_board`. The crystal stays at one temperature, or is
//! driven by 1 ppm a minute. Errors are against floor time.
//!
//! *Limits.* A crystal that drifts on for longer than half an hour is none of ±50 ppm
//! any more: ramps are turned.

use host_tests::clock_board::{MS, SECOND, US};
use host_tests::clock_scene::{Faults, Play, Scene, covered, worst_ns};
use utc_clock::{ClockState, Outcome, Ppb, Published, Settings, Source, UtcClock};
use world::{Latency, Ramp};

const SEEDS: std::ops::Range<u64> = 400..405;
/// The last mark but for what comes after the silence, in s.
const LOST_S: i64 = 600;

const TURNING: Ramp = Ramp::Random {
    ppb_per_min: 1_000.0,
    every_ns: 120_000_000_000,
};
/// All one way.
const UP: Ramp = Ramp::Constant {
    ppb_per_min: 1_000.0,
};

/// An M8 that is not heard for so long.
fn scene(seed: u64, ramp: Ramp, silent_s: i64) -> Scene {
    let mut scene = Scene::new(Latency::m8(), seed);
    scene.crystal.ramp = ramp;
    let back_s = LOST_S + silent_s;
    scene.deaf.push(LOST_S * SECOND..back_s * SECOND);
    scene
}

/// Of marks since a moment: whether it stepped, and the first error that was slewed.
fn since(play: &Play<'_>, from_s: i64) -> (bool, Option<i64>) {
    let mut outcomes = play
        .marks
        .iter()
        .filter(|(at, _)| *at >= from_s * SECOND)
        .map(|(_, outcome)| *outcome);
    let stepped = outcomes
        .clone()
        .any(|outcome| matches!(outcome, Outcome::Stepped { .. } | Outcome::Set));
    let slewed = outcomes.find_map(|outcome| match outcome {
        Outcome::Slewed { error_ns } => Some(error_ns),
        _ => None,
    });
    (stepped, slewed)
}

#[test]
fn after_two_seconds_without_a_mark_it_says_so() {
    for seed in SEEDS {
        let line = Published::new();
        let mut play = scene(seed, Ramp::None, 60).play(&line);
        play.until(LOST_S * SECOND);
        let last = play.marks.last().expect("many").0;
        play.until(last + 1_999 * MS);
        assert!(play.is_set() && play.board.clock.source() == Source::Message);
        play.until(last + 2_003 * MS);
        assert_eq!(play.board.read().state, ClockState::Holdover);
        assert_eq!(play.board.clock.source(), Source::Nothing);
        play.until((LOST_S + 61) * SECOND);
        assert!(play.is_set());
        assert_eq!(play.board.clock.counters().holdovers, 1);
    }
}

#[test]
fn the_frequency_is_kept() {
    let mut faults = Faults::default();
    for seed in SEEDS {
        let line = Published::new();
        let mut play = scene(seed, Ramp::None, 3_600).play(&line);
        play.until((LOST_S + 3) * SECOND);
        let kept = play.board.clock.frequency();
        let error = play.floor_error_ns();
        let off = play.board.frequency_error_ppb();
        play.until((LOST_S + 60) * SECOND);
        assert_eq!(play.board.clock.frequency(), kept);
        // As good as two boards have to be, 60 s after their messages were lost.
        let grown = (play.floor_error_ns() - error).abs();
        faults.unless(
            grown <= 200 * US,
            format!("seed {seed}: {grown} ns in 57 s, {off:.0} ppb"),
        );
        play.until((LOST_S + 3_600) * SECOND);
        assert_eq!(play.board.clock.frequency(), kept);
    }
    faults.none();
}

/// In specification's worst case: so many readings of so many boards as are held.
fn held_in_silence(ramp: Ramp, silent_s: i64) -> f64 {
    let plays = SEEDS.flat_map(|seed| {
        let line = Published::new();
        let mut play = scene(seed, ramp, silent_s).play(&line);
        play.until(LOST_S * SECOND);
        if silent_s > 600 {
            play.board.read_every_ns = SECOND + 37;
        }
        play.until((LOST_S + silent_s) * SECOND);
        // It never shrinks while nothing is heard.
        let silent: Vec<_> = play.since((LOST_S + 1) * SECOND).collect();
        assert!(silent.is_sorted_by_key(|sample| sample.uncertainty_ns));
        silent
    });
    covered(plays)
}

#[test]
fn the_uncertainty_holds_the_error_however_long_the_silence() {
    let mut faults = Faults::default();
    for ramp in [Ramp::None, TURNING, UP] {
        for silent_s in [60, 600, 1_800] {
            let held = held_in_silence(ramp, silent_s);
            faults.unless(held >= 0.95, format!("{ramp:?}, {silent_s} s: {held:.3}"));
        }
    }
    for silent_s in [3_600, 36_000] {
        let held = held_in_silence(Ramp::None, silent_s);
        faults.unless(held >= 0.95, format!("{silent_s} s: {held:.3}"));
    }
    faults.none();
}

#[test]
fn a_minute_after_the_first_marks_it_still_knows_how_little_it_knows() {
    let mut faults = Faults::default();
    for heard_s in [1, 5, 20, 60] {
        let samples = (400..420).flat_map(|seed| {
            let mut scene = Scene::new(Latency::m8(), seed);
            scene.deaf.push(heard_s * SECOND..i64::MAX);
            let line = Published::new();
            let mut play = scene.play(&line);
            play.until((heard_s + 120) * SECOND);
            play.since(0).collect::<Vec<_>>()
        });
        let held = covered(samples);
        faults.unless(held >= 0.95, format!("{heard_s} s: {held:.3}"));
    }
    faults.none();
}

#[test]
fn on_return_it_slews_and_never_steps() {
    let mut faults = Faults::default();
    for silent_s in [1, 60, 600, 3_600, 36_000] {
        for (seed, ramp) in SEEDS.flat_map(|seed| [Ramp::None, TURNING].map(|ramp| (seed, ramp))) {
            if ramp == TURNING && silent_s > 3_600 {
                // It could be more than half a second off: a jump, as far as it can tell.
                continue;
            }
            let name = format!("{silent_s} s, {ramp:?}, seed {seed}");
            let line = Published::new();
            let mut play = scene(seed, ramp, silent_s).play(&line);
            play.until(LOST_S * SECOND);
            if silent_s > 600 {
                play.board.read_every_ns = SECOND + 37;
            }
            let back_s = LOST_S + silent_s;
            play.until(back_s * SECOND);
            let off = play.floor_error_ns();
            play.board.read_every_ns = 37_000_100;
            // What is left is slewed, and two windows find the floor again.
            let end_s = back_s + off.abs() / i64::from(UtcClock::MAX_SLEW.0) + 240;
            play.until(end_s * SECOND);
            let (stepped, slewed) = since(&play, back_s);
            faults.unless(!stepped && slewed.is_some(), format!("{name}: {off} ns"));
            play.pass_s(60);
            let end = worst_ns(play.since(end_s * SECOND));
            let frequency = play.board.frequency_error_ppb().abs();
            faults.unless(
                end <= MS && frequency <= 16_000.0,
                format!("{name}: {off} ns, then {end} ns, {frequency:.0} ppb"),
            );
            // The first mark back may be late, and late marks do not draw it after them,
            // but for what an M8's are late by after hours of which nothing is known.
            let most = if silent_s > 600 { 6_500 * US } else { MS };
            let drawn = play
                .since(back_s * SECOND)
                .map(|sample| sample.error_ns.abs() - off.abs())
                .max();
            faults.unless(
                drawn.is_some_and(|ns| ns <= most),
                format!("{name}: {off} ns, drawn away by {drawn:?} ns"),
            );
        }
    }
    faults.none();
}

#[test]
fn a_stored_frequency_serves_a_holdover_from_the_first_mark() {
    let mut faults = Faults::default();
    for seed in SEEDS {
        let mut scene = Scene::new(Latency::m8(), seed);
        scene.settings = Settings {
            frequency: Ppb(-scene.crystal.offset_ppb.round() as i32),
            frequency_uncertainty: Ppb(500),
            ..scene.settings
        };
        scene.deaf.push(SECOND..i64::MAX);
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(3 * SECOND);
        let error = play.floor_error_ns();
        let off = play.board.frequency_error_ppb().abs();
        play.until(63 * SECOND);
        let grown = (play.floor_error_ns() - error).abs();
        // Half a ppm of a minute.
        faults.unless(
            grown <= 30 * US && off <= 500.0,
            format!("seed {seed}: {grown} ns, {off:.0} ppb"),
        );
    }
    faults.none();
}
