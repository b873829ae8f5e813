//! The clock without marks, and when the receiver is back.
//!
//! *Design.* An M8 in the simulated world falls silent, for a second or for hours, under
//! the invariants of `board-model`. The crystal stays at one temperature, or is driven by
//! 1 ppm a minute. Errors are against floor time.
//!
//! *Limits.* A crystal that drifts on for longer than half an hour leaves ±50 ppm: longer
//! ramps are turned.

use std::ops::Range;

use board_model::{MS, Run, SECOND, Scenario, US, worst_ns};
use host_tests::checks::{each, each_seed};
use utc_clock::{ClockState, Outcome, Ppb, Settings, Source, UtcClock};
use world::{Latency, Ramp};

const SEEDS: Range<u64> = 400..405;
/// The silence begins. \[s\]
const LOST_S: i64 = 600;

/// A run of an M8 that is silent for that long, until the silence begins.
fn run(seed: u64, ramp: Ramp, silent_s: i64) -> Run {
    let mut scenario = Scenario::new(Latency::m8(), seed);
    scenario.crystal.ramp = ramp;
    let back_s = LOST_S + silent_s;
    scenario
        .messages_lost
        .push(LOST_S * SECOND..back_s * SECOND);
    let mut run = scenario.start();
    run.until(LOST_S * SECOND);
    if silent_s > 600 {
        run.board.read_every_ns = Some(SECOND + 37);
    }
    run
}

#[test]
fn after_two_seconds_without_a_mark_it_is_in_holdover() {
    each(SEEDS, |checks, &seed| {
        let mut run = run(seed, Ramp::None, 60);
        let last_ns = run.marks.last().expect("many").0;
        run.until(last_ns + 1_999 * MS);
        let state = (run.board.read().state, run.board.clock.source());
        checks.equal("before", state, (ClockState::Set, Source::Message));
        run.until(last_ns + 2_003 * MS);
        let state = (run.board.read().state, run.board.clock.source());
        checks.equal("after", state, (ClockState::Holdover, Source::Nothing));
        run.until((LOST_S + 61) * SECOND);
        checks.that(run.is_set(), "not set again");
        checks.equal("holdovers", run.board.clock.counters().holdovers, 1);
    });
}

#[test]
fn the_frequency_is_kept() {
    each(SEEDS, |checks, &seed| {
        let mut run = run(seed, Ramp::None, 3_600);
        run.until((LOST_S + 3) * SECOND);
        let kept = run.board.clock.frequency();
        let error_ns = run.floor_error_ns();
        run.until((LOST_S + 60) * SECOND);
        checks.equal("frequency", run.board.clock.frequency(), kept);
        // As good as two boards have to be, 60 s after their messages were lost.
        let grown_ns = (run.floor_error_ns() - error_ns).abs();
        checks.at_most("grown in 57 s, ns", grown_ns, 200 * US);
        run.until((LOST_S + 3_600) * SECOND);
        checks.equal("frequency", run.board.clock.frequency(), kept);
    });
}

#[test]
fn the_uncertainty_covers_the_error_however_long_the_silence() {
    let ramps = [Ramp::None, Ramp::TURNING, Ramp::UP];
    let short = ramps.map(|ramp| [60, 600, 1_800].map(|silent_s| (ramp, silent_s)));
    let long = [3_600, 36_000].map(|silent_s| (Ramp::None, silent_s));
    let cases = short.into_iter().flatten().chain(long);
    each(cases, |checks, &(ramp, silent_s)| {
        let samples = SEEDS.flat_map(|seed| {
            let mut run = run(seed, ramp, silent_s);
            run.until((LOST_S + silent_s) * SECOND);
            // It never shrinks without a mark; that of seconds is rounded.
            let silent: Vec<_> = run.since((LOST_S + 1) * SECOND).collect();
            let known = silent
                .iter()
                .filter(|sample| sample.state != ClockState::Unproved);
            assert!(known.is_sorted_by_key(|sample| sample.uncertainty_ns));
            silent
        });
        checks.covered(samples);
    });
}

#[test]
fn a_minute_after_the_first_marks_the_uncertainty_covers_the_error() {
    each([1, 5, 20, 60], |checks, &marks_s| {
        let samples = (400..420).flat_map(|seed| {
            let mut scenario = Scenario::new(Latency::m8(), seed);
            scenario.messages_lost.push(marks_s * SECOND..i64::MAX);
            let mut run = scenario.start();
            run.until((marks_s + 120) * SECOND);
            run.since(0).collect::<Vec<_>>()
        });
        checks.covered(samples);
    });
}

#[test]
fn on_return_it_slews_and_never_steps() {
    let ramps = [Ramp::None, Ramp::TURNING];
    let cases: Vec<_> = [1, 60, 600, 3_600, 36_000]
        .into_iter()
        .flat_map(|silent_s| ramps.map(|ramp| (silent_s, ramp)))
        // It could be more than half a second off, which is a jump for the clock.
        .filter(|&(silent_s, ramp)| ramp == Ramp::None || silent_s <= 3_600)
        .collect();
    each_seed(SEEDS, cases, |checks, seed, (silent_s, ramp)| {
        let mut run = run(seed, ramp, silent_s);
        let back_s = LOST_S + silent_s;
        run.until(back_s * SECOND);
        let off_ns = run.floor_error_ns().abs();
        run.board.read_every_ns = Some(37_000_100);
        // The error is slewed, and two windows find the floor again.
        let end_s = back_s + off_ns / i64::from(UtcClock::MAX_SLEW.0) + 240;
        run.until(end_s * SECOND);
        let slews = |outcome: &Outcome| matches!(outcome, Outcome::Slewed { .. });
        let steps = |outcome: &Outcome| matches!(outcome, Outcome::Stepped { .. } | Outcome::Set);
        checks.equal("steps", run.count_marks(back_s * SECOND, steps), 0);
        checks.at_least("slews", run.count_marks(back_s * SECOND, slews), 1);
        run.pass_s(60);
        let end_ns = worst_ns(run.since(end_s * SECOND));
        checks.at_most("error in the end, ns", end_ns, MS);
        let frequency_ppb = run.board.frequency_error_ppb().abs();
        checks.at_most("frequency error, ppb", frequency_ppb, 16_000.0);
        // The first mark back may be late, and the clock does not follow late marks; except, by
        // the jitter of an M8, after hours in which the frequency was lost.
        let limit_ns = if silent_s > 600 { 6_500 * US } else { MS };
        let worst_ns = worst_ns(run.since(back_s * SECOND));
        checks.at_most("error after the return, ns", worst_ns, off_ns + limit_ns);
    });
}

#[test]
fn a_stored_frequency_serves_a_holdover_from_the_first_mark() {
    each(SEEDS, |checks, &seed| {
        let mut scenario = Scenario::new(Latency::m8(), seed);
        scenario.settings = Settings {
            frequency: Ppb(-scenario.crystal.offset_ppb.round() as i32),
            frequency_uncertainty: Ppb(500),
            ..scenario.settings
        };
        scenario.messages_lost.push(SECOND..i64::MAX);
        let mut run = scenario.start();
        run.until(3 * SECOND);
        let error_ns = run.floor_error_ns();
        let off_ppb = run.board.frequency_error_ppb().abs();
        checks.at_most("frequency error, ppb", off_ppb, 500.0);
        run.until(63 * SECOND);
        // Half a ppm of a minute.
        let grown_ns = (run.floor_error_ns() - error_ns).abs();
        checks.at_most("grown in a minute, ns", grown_ns, 30 * US);
    });
}
