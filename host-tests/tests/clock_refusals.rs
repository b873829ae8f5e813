//! The clock behind receivers that stall, jump and run away.
//!
//! *Design.* An M8 in the simulated world goes wrong after ten minutes, under the invariants
//! of `board-model`. Errors are against floor time. Checked are the error of the phase and
//! of the frequency, the counters, and that the clock follows its receiver again in the end.
//!
//! *Limits.* Five seeds.

use std::ops::Range;

use board_model::{MS, Run, SECOND, Scenario, US, at_s, worst_ns};
use host_tests::checks::{Checks, each_seed};
use utc_clock::{ClockState, Counters, Outcome, Refusal, UtcClock};
use world::{Latency, Stall, TimeFault, WorldNanos};

const SEEDS: Range<u64> = 300..305;
/// When it happens. \[s\]
const THEN_S: i64 = 600;
const THEN: WorldNanos = at_s(600);
/// The largest difference of two M8s.
const MAX_NS: i64 = MS;
/// Its 99th percentile.
const P99_NS: i64 = 400 * US;
/// What that makes of the frequency over half a window.
const FREQUENCY_PPB: f64 = 16_000.0;
/// After a floor has moved the clock is within the receiver's floor and so much: what `integrity`
/// demands of a clock without a pulse.
const MOVED_NS: i64 = 30 * MS;
/// What a crystal within ±50 ppm can do: a receiver is believed to drift that fast.
const BELIEVED_PPB: f64 = 50_000.0;
/// The same in ten minutes, and floors that wander by 10 ms to either side: a receiver is
/// believed to drift that far.
const BELIEVED_NS: i64 = 600 * 50 * US + 20 * MS;

/// A run of an M8 that goes wrong, until it does, and the counters then.
fn run(seed: u64, go_wrong: impl FnOnce(&mut Scenario)) -> (Run, Counters) {
    let mut scenario = Scenario::new(Latency::m8(), seed);
    go_wrong(&mut scenario);
    let mut run = scenario.start();
    run.until(THEN_S * SECOND);
    let before = run.board.clock.counters();
    (run, before)
}

/// Steps forward and back.
fn steps(counters: &Counters) -> (u32, u32) {
    (counters.steps_forward, counters.steps_back)
}

/// The steps from `from_s` on. \[ns\]
fn stepped_by(run: &Run, from_s: i64) -> Vec<i64> {
    let since = run.marks.iter().filter(|(at, _)| *at >= from_s * SECOND);
    since
        .filter_map(|(_, outcome)| match outcome {
            Outcome::Stepped { by_ns } => Some(*by_ns),
            _ => None,
        })
        .collect()
}

/// Demands one step from `from_s` on, `near_ns` of `expected_ns`.
fn check_step(checks: &mut Checks, run: &Run, from_s: i64, expected_ns: i64, near_ns: i64) {
    let by_ns = stepped_by(run, from_s);
    checks.that(
        matches!(by_ns[..], [by_ns] if (by_ns - expected_ns).abs() <= near_ns),
        format_args!("stepped by {by_ns:?} after {from_s} s"),
    );
}

/// The largest change of the error since it went wrong. \[ns\]
fn moved_ns(run: &Run, before_ns: i64) -> i64 {
    let since = run.since(THEN_S * SECOND);
    let moved = since.map(|sample| (sample.error_ns - before_ns).abs());
    moved.max().unwrap_or(i64::MAX)
}

/// The trace of a real Pixhawk has the second: 1.56 s late, then a flush of the backlog
/// and a duplicate.
#[test]
fn a_stall_and_its_backlog_leave_the_clock_where_it_was() {
    each_seed(SEEDS, [400, 1_560, 5_000], |checks, seed, lasts_ms| {
        let (mut run, before) = run(seed, |scenario| {
            scenario.receiver.stalls.push(Stall {
                from: THEN,
                lasts_ns: lasts_ms * 1_000_000,
            });
        });
        let error_ns = run.floor_error_ns();
        let frequency_ppb = run.frequency_until_ppb(THEN_S + 60);
        let counters = run.board.clock.counters();
        checks.equal("steps", steps(&counters), steps(&before));
        let duplicates = counters.duplicate_epoch - before.duplicate_epoch;
        checks.equal("duplicates", duplicates, 1);
        // Outliers are those of the backlog that are more than half a second late, each by less
        // than the one before: a fifth less its time on the wire.
        let outliers = i64::from(counters.outlier - before.outlier);
        let expected = (lasts_ms as i64 - 500).max(0) * 10 / 1_913;
        checks.at_most("outliers", outliers, expected + 1);
        checks.at_least("outliers", outliers, expected - 1);
        // And some are later than any jitter.
        checks.at_least("late", counters.late - before.late, 1);
        let silences = u32::from(lasts_ms > 2_000);
        checks.equal("holdovers", counters.holdovers, silences);
        checks.at_most("moved, ns", moved_ns(&run, error_ns), P99_NS);
        checks.at_most("frequency error, ppb", frequency_ppb, FREQUENCY_PPB);
    });
}

#[test]
fn a_jump_that_is_over_in_less_than_a_second_is_refused() {
    each_seed(SEEDS, [-18, -1, 1, 18], |checks, seed, jump_s| {
        // Four marks: at 5 Hz the fifth is the first that could agree with four others.
        let until = THEN.plus(790 * MS.unsigned_abs());
        let fault = TimeFault::jump(THEN, jump_s * SECOND).until(until);
        let (mut run, before) = run(seed, |scenario| scenario.receiver.time_faults.push(fault));
        let frequency_ppb = run.frequency_until_ppb(THEN_S + 120);
        let counters = run.board.clock.counters();
        checks.equal("steps", steps(&counters), steps(&before));
        let refused = counters.outlier + counters.epoch_back;
        checks.at_least("refused", refused, 4);
        let worst = worst_ns(run.since(THEN_S * SECOND));
        checks.at_most("error, ns", worst, MAX_NS);
        checks.at_most("frequency error, ppb", frequency_ppb, FREQUENCY_PPB);
    });
}

#[test]
fn a_jump_of_seconds_is_in_the_uncertainty_and_believed_when_it_has_stood_for_five_minutes() {
    let cases = [-18, -1, 1, 18].map(|jump_s| [(jump_s, "no pulse"), (jump_s, "pulse")]);
    each_seed(SEEDS, cases.concat(), |checks, seed, (jump_s, pulse)| {
        let is_pulse = pulse == "pulse";
        let jump_ns = jump_s * SECOND;
        let (mut run, before) = run(seed, |scenario| {
            scenario
                .receiver
                .time_faults
                .push(TimeFault::jump(THEN, jump_ns));
            if is_pulse {
                *scenario = scenario.clone().with_pulse();
            }
        });
        let error_ns = run.board.error_ns();
        run.until((THEN_S + 295) * SECOND);
        let refusing = run.board.clock.counters();
        checks.equal("steps at first", steps(&refusing), steps(&before));
        let moved = (run.board.error_ns() - error_ns).abs();
        // The crystal alone for five minutes, of a frequency that is known to 16 ppm.
        let most_ns = if is_pulse { US } else { 300 * 16 * US };
        checks.at_most("moved before a step, ns", moved, most_ns);
        // From the third mark on it says so, and holds both numbers.
        let reading = run.board.read();
        checks.equal("state", reading.state, ClockState::Unproved);
        let both_ns = jump_ns.unsigned_abs();
        checks.at_least("uncertainty, ns", reading.uncertainty_ns, both_ns);
        run.until((THEN_S + 420) * SECOND);
        if is_pulse {
            // A pulse supports its phase, not its number: neither wins.
            checks.equal("steps", steps(&run.board.clock.counters()), steps(&before));
            checks.equal("state", run.board.read().state, ClockState::Unproved);
        } else {
            check_step(checks, &run, THEN_S, jump_ns, 10 * MS);
            checks.equal("state", run.board.read().state, ClockState::Set);
            let off_ns = (run.board.error_ns() - error_ns - jump_ns).abs();
            checks.at_most("off the jump, ns", off_ns, MAX_NS);
        }
    });
}

#[test]
fn a_jump_of_seconds_that_is_over_leaves_nothing() {
    let cases = [-18, -1, 1, 18].map(|jump_s| [(jump_s, "no pulse"), (jump_s, "pulse")]);
    each_seed(SEEDS, cases.concat(), |checks, seed, (jump_s, pulse)| {
        let fault = TimeFault::jump(THEN, jump_s * SECOND).until(at_s(720));
        let (mut run, before) = run(seed, |scenario| {
            scenario.receiver.time_faults.push(fault);
            if pulse == "pulse" {
                *scenario = scenario.clone().with_pulse();
            }
        });
        run.until(900 * SECOND);
        checks.equal("steps", steps(&run.board.clock.counters()), steps(&before));
        let reading = run.board.read();
        checks.equal("state", reading.state, ClockState::Set);
        let worst = if pulse == "pulse" {
            worst_ns(run.utc_since(840 * SECOND))
        } else {
            worst_ns(run.since(840 * SECOND))
        };
        let settled_ns = if pulse == "pulse" { US } else { MAX_NS };
        checks.at_most("error in the end, ns", worst, settled_ns);
    });
}

#[test]
fn a_jump_of_a_fraction_of_a_second_never_moves_it_faster_than_a_slew() {
    let jumps_ms = [-400, -250, -120, -80, -30, 30, 80, 120, 250, 400];
    each_seed(SEEDS, jumps_ms, |checks, seed, jump_ms| {
        let jump_ns = jump_ms * MS;
        let fault = TimeFault::jump(THEN, jump_ns);
        let (mut run, before) = run(seed, |scenario| scenario.receiver.time_faults.push(fault));
        run.board.invariants.margin_ppb = f64::INFINITY;
        // A single mark, or four, do nothing that a late one would not.
        run.until(THEN_S * SECOND + 800 * MS);
        let moved = worst_ns(run.since(THEN_S * SECOND));
        checks.at_most("error at once, ns", moved, MAX_NS);
        // Ten minutes to be sure that it is one, and the time to slew it.
        let slewing_s = jump_ns.abs() / i64::from(UtcClock::MAX_SLEW.0) + 1;
        let end_s = THEN_S + slewing_s + 600;
        let frequency_ppb = run.frequency_until_ppb(end_s);
        run.pass_s(60);
        // What comes later than before has another latency now; what comes earlier is nearer to the
        // truth than anything was.
        let followed_ns = jump_ns.max(0);
        let since = run.since(end_s * SECOND);
        let off_ns = since
            .map(|sample| (sample.error_ns - followed_ns).abs())
            .max();
        let off_ns = off_ns.unwrap_or(i64::MAX);
        checks.at_most("off in the end, ns", off_ns, MOVED_NS);
        // No crystal has the slope from the old to the new floor.
        checks.at_most("frequency error, ppb", frequency_ppb, 100_000.0);
        let forward = run.board.clock.counters().steps_forward;
        checks.equal("steps forward", forward, before.steps_forward);
        let is_refused = |outcome: &Outcome| {
            matches!(
                outcome,
                Outcome::Refused(
                    Refusal::Late | Refusal::Early | Refusal::Outlier | Refusal::Drift
                )
            )
        };
        if jump_ms.abs() > 100 {
            let refused = run.count_marks(THEN_S * SECOND, is_refused);
            checks.at_least("refused", refused, 4);
        }
    });
}

/// Demands that a receiver which drifted by `ppm` for ten minutes was followed no farther than a
/// crystal can go, and without a step back.
fn check_drift(
    checks: &mut Checks,
    ppm: i32,
    worst_ns: i64,
    frequency_ppb: f64,
    [before, after]: [Counters; 2],
) {
    let drifted_ns = i64::from(ppm) * 600 * US;
    let limit_ns = (drifted_ns + MAX_NS).min(BELIEVED_NS);
    checks.at_most("error, ns", worst_ns, limit_ns);
    let limit_ppb = (f64::from(ppm) * 1e3 + FREQUENCY_PPB).min(BELIEVED_PPB);
    checks.at_most("frequency error, ppb", frequency_ppb, limit_ppb);
    checks.equal("steps back", after.steps_back, before.steps_back);
}

#[test]
fn a_receiver_that_drifts_away_is_followed_no_farther_than_a_crystal_goes() {
    let cases = [1, 10, 100].map(|ppm| [(ppm, -1), (ppm, 1)]);
    each_seed(SEEDS, cases.concat(), |checks, seed, (ppm, sign)| {
        let drift = TimeFault::drift(THEN, sign * ppm * 1_000).until(at_s(1_200));
        let (mut run, before) = run(seed, |scenario| scenario.receiver.time_faults.push(drift));
        run.board.invariants.margin_ppb = f64::INFINITY;
        let frequency_ppb = run.frequency_until_ppb(1_200);
        let after = run.board.clock.counters();
        let worst = worst_ns(run.since(THEN_S * SECOND));
        check_drift(checks, ppm, worst, frequency_ppb, [before, after]);
        // One that falls behind is late.
        let refused = after.drift + after.late - before.drift - before.late;
        if ppm >= 100 {
            checks.at_least("refused", refused, 1);
        }
        // It comes back, and is believed again.
        run.until(1_800 * SECOND);
        let end = worst_ns(run.since(1_790 * SECOND));
        // On its way back it is late, for good: that is another latency.
        let ahead_ns = match (sign, ppm) {
            (1, ..=100) => i64::from(ppm) * 600 * US,
            // Away from the line of the whole lock by no more than floors wander.
            (1, _) => 20 * MS,
            _ => 0,
        };
        checks.at_most("error in the end, ns", end, ahead_ns + MOVED_NS);
    });
}

/// By messages alone it cannot be distinguished from a crystal beyond its promise.
#[test]
fn a_receiver_that_drifts_by_500_ppm_leaves_the_clock_unset() {
    each_seed(SEEDS, [-500, 500], |checks, seed, ppm| {
        let drift = TimeFault::drift(THEN, ppm * 1_000).until(at_s(1_200));
        let (mut run, _) = run(seed, |scenario| scenario.receiver.time_faults.push(drift));
        run.board.invariants.margin_ppb = f64::INFINITY;
        run.until(1_190 * SECOND);
        let crystal = run.board.clock.counters().crystal;
        checks.at_least("refused for the crystal", crystal, 1);
    });
}

#[test]
fn a_receiver_that_drifts_away_with_its_pulse_is_followed_no_farther_either() {
    each_seed(SEEDS, [1, 10, 100, 500], |checks, seed, ppm| {
        let (mut run, before) = run(seed, |scenario| {
            let drift = TimeFault::drift(THEN, ppm * 1_000);
            scenario.receiver.time_faults.push(drift);
            *scenario = scenario.clone().with_pulse();
        });
        let frequency_ppb = run.frequency_until_ppb(1_200);
        let after = run.board.clock.counters();
        let worst = worst_ns(run.utc_since(THEN_S * SECOND));
        check_drift(checks, ppm, worst, frequency_ppb, [before, after]);
        // A jump of the pulse's frequency beyond what a crystal does in a second.
        if ppm >= 10 {
            let followed = after.pulses - before.pulses;
            checks.at_most("pulses followed", followed, 600 - 60);
        }
        if ppm >= 100 {
            // The first one is where it would be without a drift.
            checks.at_most("pulses followed", after.pulses, before.pulses + 1);
        }
    });
}
