//! The clock under a time pulse: a good one, a bad one, and one that is lost.
//!
//! *Design.* An M8 in the simulated world with its pulse of 30 ns RMS on the capture pin,
//! under the invariants of `board-model`: whatever happens to the pulse, no reading jumps.
//! Errors are against UTC. The pulse begins after a minute, when the clock may not
//! step for its messages any more; it goes wrong after five.
//!
//! *Limits.* Five seeds.

use std::ops::Range;

use board_model::{MS, Run, SECOND, START, Scenario, US, at_s, worst_ns};
use host_tests::checks::{Checks, each, each_seed};
use utc_clock::{Outcome, PulseOutcome, PulseRefusal, Source};
use world::{
    CrystalSettings, Latency, PulseFault, PulseFaultKind, PulseSettings, Ramp, ReceiverSettings,
    Stall, TimeFault, WorldNanos,
};

const SEEDS: Range<u64> = 500..505;
/// When the pulse begins. \[s\]
const FROM_S: i64 = 60;
/// When it goes wrong. \[s\]
const WRONG_S: i64 = 300;
const WRONG: WorldNanos = at_s(300);
/// The largest difference of two boards under their pulses.
const MAX_NS: i64 = 250;
/// The largest error 60 s after the pulse was lost.
const LOST_MAX_NS: i64 = 3 * US;
/// What 250 ns make of the frequency over 2 s, the shortest that a filter sees.
const FREQUENCY_PPB: f64 = 125.0;
const FOR_EVER: WorldNanos = WorldNanos(u64::MAX);

fn scenario(seed: u64) -> Scenario {
    let mut scenario = Scenario::new(Latency::m8(), seed);
    scenario.receiver.pulse.from = at_s(60);
    scenario.with_pulse()
}

/// One with a pulse that has a fault from `from` to `until`.
fn faulty(seed: u64, kind: PulseFaultKind, from: WorldNanos, until: WorldNanos) -> Scenario {
    let mut scenario = scenario(seed);
    let receiver = scenario.pulse.as_mut().expect("wired");
    receiver.pulse.faults.push(PulseFault { from, until, kind });
    scenario
}

/// The largest error against UTC from `from_s` on. \[ns\]
fn worst_since(run: &Run, from_s: i64) -> i64 {
    worst_ns(run.utc_since(from_s * SECOND))
}

/// How many marks and pulses stepped from `from_s` on.
fn steps(run: &Run, from_s: i64) -> usize {
    let mark = |outcome: &Outcome| matches!(outcome, Outcome::Stepped { .. });
    let pulse = |outcome: &PulseOutcome| matches!(outcome, PulseOutcome::Stepped { .. });
    run.count_marks(from_s * SECOND, mark) + run.count_pulses(from_s * SECOND, pulse)
}

fn refused(run: &Run, from_s: i64, refusal: PulseRefusal) -> usize {
    run.count_pulses(from_s * SECOND, |outcome| {
        *outcome == PulseOutcome::Refused(refusal)
    })
}

/// Demands that the clock held phase and frequency under the pulse from `WRONG_S` on.
fn check_held(checks: &mut Checks, run: &Run, frequency_ppb: f64) {
    let worst = worst_since(run, WRONG_S);
    checks.at_most("error, ns", worst, MAX_NS);
    checks.at_most("frequency error, ppb", frequency_ppb, FREQUENCY_PPB);
    checks.equal("steps", steps(run, WRONG_S), 0);
    checks.equal("holdovers", run.board.clock.counters().holdovers, 0);
}

/// Demands that a pulse never was followed, nor the clock drawn off its messages.
fn check_not_followed(checks: &mut Checks, run: &Run, least_refused: u32) {
    let counters = run.board.clock.counters();
    checks.equal("pulses", counters.pulses, 0);
    let refused = counters.pulse_off_second + counters.pulse_unproved + counters.pulse_width;
    checks.at_least("pulses refused", refused, least_refused);
    let worst = worst_ns(run.since(180 * SECOND));
    checks.at_most("error against floor time, ns", worst, MS);
    checks.equal("source", run.board.clock.source(), Source::Message);
}

#[test]
fn it_locks_when_a_train_is_proved_and_steps_forward_over_the_latency() {
    each(SEEDS, |checks, &seed| {
        let scenario = scenario(seed);
        let mut run = scenario.start();
        run.until(FROM_S * SECOND - MS);
        checks.equal("before", run.board.clock.source(), Source::Message);
        let late_ns = -run.board.error_ns();
        run.until((FROM_S + 9) * SECOND);
        let outcomes: Vec<_> = run.pulses.iter().map(|(_, outcome)| *outcome).collect();
        // The first one begins a train, eight more prove it.
        let (unproved, followed) = outcomes.split_at(8);
        let is_unproved =
            |outcome: &PulseOutcome| *outcome == PulseOutcome::Refused(PulseRefusal::Unproved);
        checks.that(
            unproved[0] == PulseOutcome::Candidate
                && unproved[1..].iter().all(is_unproved)
                && matches!(
                    followed[0],
                    PulseOutcome::Stepped { by_ns } if (by_ns - late_ns).abs() <= MS
                ),
            format_args!("{late_ns} ns late, {outcomes:?}"),
        );
        checks.equal("after", run.board.clock.source(), Source::Pulse);
        let counters = run.board.clock.counters();
        let locks = (counters.pulse_locks, counters.steps_back);
        checks.equal("locks and steps back", locks, (1, 0));
        // The rest after the step is gone soon, and the latency is known.
        run.until((FROM_S + 60) * SECOND);
        let soon = worst_since(&run, FROM_S + 30);
        checks.at_most("error after 30 s, ns", soon, MAX_NS);
        let latency_ns = run.board.clock.latency_ns() - scenario.floor_ns();
        checks.at_most("latency off, ns", latency_ns.abs(), MS);
        let uncertainty_ns = run.board.read().uncertainty_ns;
        checks.at_most("uncertainty, ns", uncertainty_ns, 1_000);
    });
}

#[test]
fn a_latency_that_was_set_wrong_does_not_keep_the_pulse_out() {
    let cases = SEEDS.zip([-30, -25, 25, 60, 90]);
    each(cases, |checks, &(seed, wrong_ms)| {
        let wrong_ns = wrong_ms * MS;
        let mut scenario = scenario(seed);
        let set_ns = u32::try_from(scenario.floor_ns() + wrong_ns).expect("no less than 0");
        scenario.settings = scenario.settings.with_latency_ns(set_ns);
        let mut run = scenario.start();
        // With too large a latency it is ahead, and slews that away at 400 ppm.
        let slewed_s = (wrong_ns.max(0) as f64 / 400e-6 / 1e9) as i64;
        let over_s = FROM_S + slewed_s + 60;
        run.until((over_s + 60) * SECOND);
        checks.equal("source", run.board.clock.source(), Source::Pulse);
        checks.at_most("error, ns", worst_since(&run, over_s), MAX_NS);
    });
}

#[test]
fn it_is_followed_in_phase_and_frequency() {
    for (ramp, mean_ns, max_ns) in [
        (Ramp::None, 22, 130),
        (Ramp::UP, 32, MAX_NS),
        (Ramp::TURNING, 32, MAX_NS),
    ] {
        let mut all = Vec::new();
        each_seed(SEEDS, [ramp], |checks, seed, ramp| {
            let mut scenario = scenario(seed);
            scenario.crystal.ramp = ramp;
            let mut run = scenario.start();
            run.until(180 * SECOND);
            let frequency_ppb = run.frequency_until_ppb(780);
            checks.at_most("error, ns", worst_since(&run, 180), max_ns);
            checks.at_most("frequency error, ppb", frequency_ppb, FREQUENCY_PPB);
            let odd = run.count_marks(180 * SECOND, |outcome| *outcome != Outcome::Confirmed);
            checks.equal("marks that did something", odd, 0);
            all.extend(run.utc_since(180 * SECOND));
        });
        each([ramp], |checks, _| {
            let sum: i64 = all.iter().map(|sample| sample.error_ns.abs()).sum();
            checks.at_most("mean error, ns", sum / all.len() as i64, mean_ns);
            checks.covered(all.iter().copied());
        });
    }
}

#[test]
fn a_pulse_at_a_wrong_phase_is_refused_from_the_start() {
    // TIM-TP does not announce it.
    each_seed(SEEDS, [100, 300, 500, -300], |checks, seed, late_ms| {
        let by_ns = late_ms * MS;
        let kind = PulseFaultKind::WrongPhase { by_ns };
        let mut run = faulty(seed, kind, WorldNanos(0), FOR_EVER).start();
        run.until(WRONG_S * SECOND);
        check_not_followed(checks, &run, 200);
    });
}

#[test]
fn a_pulse_that_goes_wrong_is_refused_and_believed_again_when_it_is_right() {
    let phases_ms = [-500, -300, -100, 100, 300, 500];
    let mut kinds = phases_ms
        .map(|ms| PulseFaultKind::WrongPhase { by_ns: ms * MS })
        .to_vec();
    kinds.push(PulseFaultKind::Cut);
    each_seed(SEEDS, kinds, |checks, seed, kind| {
        let mut run = faulty(seed, kind, WRONG, at_s(360)).start();
        run.until(WRONG_S * SECOND - MS);
        let frequency_ppb = run.frequency_until_ppb(WRONG_S + 60);
        let worst = worst_since(&run, WRONG_S);
        checks.at_most("error while it was wrong, ns", worst, LOST_MAX_NS);
        checks.at_most("frequency error, ppb", frequency_ppb, FREQUENCY_PPB);
        if kind != PulseFaultKind::Cut {
            let unproved = refused(&run, WRONG_S, PulseRefusal::Unproved);
            checks.at_least("unproved", unproved, 55);
        }
        run.until(420 * SECOND);
        checks.at_most("error then, ns", worst_since(&run, 390), MAX_NS);
        checks.equal("source", run.board.clock.source(), Source::Pulse);
        checks.equal("steps", steps(&run, WRONG_S), 0);
        checks.equal("holdovers", run.board.clock.counters().holdovers, 0);
    });
}

#[test]
fn missing_doubled_and_bouncing_pulses_do_no_harm() {
    use PulseFaultKind::{Bouncing, Doubled, Missing};
    let doubled = |after_ns| Doubled { after_ns };
    let bouncing = Bouncing {
        edges: 5,
        within_ns: 2_000_000,
    };
    let kinds = [
        (Missing { one_in: 3 }, None),
        (doubled(10_000), None),
        (doubled(100_000_000), Some(PulseRefusal::Unproved)),
        (doubled(500_000_000), None),
        (bouncing, None),
    ];
    each_seed(SEEDS, kinds, |checks, seed, (kind, refusal)| {
        let mut run = faulty(seed, kind, WRONG, at_s(480)).start();
        run.until(WRONG_S * SECOND - MS);
        let frequency_ppb = run.frequency_until_ppb(540);
        check_held(checks, &run, frequency_ppb);
        if let Some(refusal) = refusal {
            let refused = refused(&run, WRONG_S, refusal);
            checks.at_least("refused", refused, 170);
        }
        if !matches!(kind, Missing { .. }) {
            checks.equal("locks", run.board.clock.counters().pulse_locks, 1);
        }
    });
}

#[test]
fn a_pulse_behind_another_edge_is_as_good_as_lost() {
    // The line is high already when it comes.
    let ahead = [1_000_000, 1_000].map(|ns| PulseFaultKind::Doubled {
        after_ns: SECOND.unsigned_abs() - ns,
    });
    each_seed(SEEDS, ahead, |checks, seed, kind| {
        let mut run = faulty(seed, kind, WRONG, at_s(480)).start();
        run.until(WRONG_S * SECOND - MS);
        let frequency_ppb = run.frequency_until_ppb(480);
        checks.at_most("error, ns", worst_since(&run, WRONG_S), LOST_MAX_NS);
        checks.at_most("frequency error, ppb", frequency_ppb, FREQUENCY_PPB);
        run.until(600 * SECOND);
        checks.at_most("error then, ns", worst_since(&run, 510), MAX_NS);
        checks.covered(run.utc_since(WRONG_S * SECOND));
        checks.equal("steps", steps(&run, WRONG_S), 0);
    });
}

/// Another receiver, whose seconds are `phase_ms` ahead and 10 ppm fast.
fn another_receiver(phase_ms: i64) -> ReceiverSettings {
    ReceiverSettings {
        seed: 7,
        // An uncommon width, which is set, distinguishes ours from it.
        pulse: PulseSettings {
            from: at_s(60),
            width_ns: 40_000_000,
            ..PulseSettings::m8()
        },
        time_faults: vec![
            TimeFault::jump(WorldNanos(0), phase_ms * MS),
            TimeFault::drift(WorldNanos(0), 10_000),
        ],
        ..ReceiverSettings::new(START.0)
    }
}

#[test]
fn another_receivers_pulse_is_not_followed() {
    each_seed(
        SEEDS,
        [-450, -200, 50, 350, 480],
        |checks, seed, phase_ms| {
            let mut scenario = scenario(seed);
            scenario.pulse = Some(another_receiver(phase_ms));
            let mut run = scenario.start();
            run.until(600 * SECOND);
            check_not_followed(checks, &run, 500);
        },
    );
}

#[test]
fn the_latency_that_was_learnt_serves_when_the_pulse_is_lost() {
    let latencies = [Latency::m8(), Latency::f9()];
    each_seed(SEEDS, latencies, |checks, seed, latency| {
        let mut scenario = faulty(seed, PulseFaultKind::Cut, WRONG, at_s(2_700));
        scenario.receiver.latency = latency;
        let mut run = scenario.start();
        run.until(WRONG_S * SECOND);
        // For ten minutes the pulse's own line is better than the messages are.
        let frequency_ppb = run.frequency_until_ppb(WRONG_S + 600);
        let since = run.utc_since(WRONG_S * SECOND);
        let minute = worst_ns(since.take_while(|sample| sample.at_ns <= 360 * SECOND));
        checks.at_most("error in a minute, ns", minute, LOST_MAX_NS);
        checks.at_most("error in ten, ns", worst_since(&run, WRONG_S), MS);
        checks.at_most("frequency error, ppb", frequency_ppb, FREQUENCY_PPB);
        // Then the messages take over; they are as far from UTC now as from their floor.
        let frequency_ppb = run.frequency_until_ppb(2_699);
        let worst = worst_since(&run, WRONG_S + 600);
        checks.at_most("error with the messages, ns", worst, MS);
        checks.at_most("frequency error then, ppb", frequency_ppb, 16_000.0);
        checks.equal("source", run.board.clock.source(), Source::Message);
        let latency_ns = run.board.clock.latency_ns() - scenario.floor_ns();
        checks.at_most("latency off, ns", latency_ns.abs(), MS);
        checks.covered(run.utc_since(WRONG_S * SECOND));
        run.until(2_760 * SECOND);
        let back = worst_since(&run, 2_730);
        checks.at_most("error when it was back, ns", back, MAX_NS);
        checks.equal("source then", run.board.clock.source(), Source::Pulse);
        checks.equal("steps", steps(&run, WRONG_S), 0);
    });
}

#[test]
fn a_pulse_that_jumps_and_stays_is_not_believed_without_a_word_of_the_receiver() {
    each_seed(SEEDS, [-500, 500], |checks, seed, late_us| {
        let by_ns = late_us * US;
        let kind = PulseFaultKind::WrongPhase { by_ns };
        let mut run = faulty(seed, kind, WRONG, FOR_EVER).start();
        run.until((WRONG_S + 60) * SECOND);
        let worst = worst_since(&run, WRONG_S);
        checks.at_most("error in a minute, ns", worst, LOST_MAX_NS);
        run.until(900 * SECOND);
        checks.at_most("error in ten, ns", worst_since(&run, WRONG_S), 100 * US);
        checks.covered(run.utc_since(WRONG_S * SECOND));
        checks.equal("source", run.board.clock.source(), Source::Message);
        checks.equal("steps", steps(&run, WRONG_S), 0);
    });
}

#[test]
fn a_receiver_that_jumps_with_its_pulse_is_believed_after_a_minute() {
    each_seed(SEEDS, [-300, 300], |checks, seed, jump_us| {
        let jump_ns = jump_us * US;
        let mut scenario = scenario(seed);
        let fault = TimeFault::jump(WRONG, jump_ns);
        scenario.receiver.time_faults.push(fault);
        let receiver = scenario.pulse.as_mut().expect("wired");
        receiver.time_faults.push(fault);
        let mut run = scenario.start();
        run.until((WRONG_S + 59) * SECOND);
        let worst = worst_since(&run, WRONG_S);
        checks.at_most("error for a minute, ns", worst, LOST_MAX_NS);
        run.until(420 * SECOND);
        let since = run.utc_since(390 * SECOND);
        let off_ns = since.map(|sample| (sample.error_ns - jump_ns).abs()).max();
        let off_ns = off_ns.unwrap_or(i64::MAX);
        checks.at_most("off the receiver in the end, ns", off_ns, MAX_NS);
        checks.equal("steps", steps(&run, WRONG_S), 0);
    });
}

#[test]
fn the_sawtooth_that_tim_tp_forecasts_is_taken_off() {
    each(SEEDS, |checks, &seed| {
        let [with, without] = [1, 0].map(|tim_tp_every| {
            let mut scenario = scenario(seed);
            let receiver = scenario.pulse.as_mut().expect("wired");
            receiver.port.tim_tp_every = tim_tp_every;
            // ±21 ns that turn round in 42 s, slow enough for any filter to follow, and
            // a crystal that is better than that.
            scenario.crystal = CrystalSettings::quiet(30_000.0);
            receiver.crystal_ppb = 1;
            receiver.pulse.clock_hz = 24_000_000;
            receiver.pulse.rms_ns = 13;
            let mut run = scenario.start();
            run.until(480 * SECOND);
            let errors = run.utc_since(180 * SECOND);
            let errors: Vec<i64> = errors.map(|sample| sample.error_ns.abs()).collect();
            errors.iter().sum::<i64>() as f64 / errors.len() as f64
        });
        checks.at_most("mean error with forecasts, ns", with, 0.5 * without);
    });
}

#[test]
fn the_clock_numbers_the_pulse_through_a_stall_of_the_messages() {
    each_seed(SEEDS, [1_560, 5_000], |checks, seed, lasts_ms| {
        let mut scenario = scenario(seed);
        scenario.receiver.stalls.push(Stall {
            from: WRONG,
            lasts_ns: lasts_ms * 1_000_000,
        });
        let mut run = scenario.start();
        run.until(WRONG_S * SECOND);
        let frequency_ppb = run.frequency_until_ppb(360);
        check_held(checks, &run, frequency_ppb);
        let counters = run.board.clock.counters();
        checks.at_least("outliers", counters.outlier, 1);
        checks.equal("locks", counters.pulse_locks, 1);
    });
}

#[test]
fn without_messages_it_stays_on_the_pulse() {
    each(SEEDS, |checks, &seed| {
        let mut scenario = scenario(seed);
        scenario.messages_lost.push(WRONG_S * SECOND..900 * SECOND);
        let mut run = scenario.start();
        run.until(WRONG_S * SECOND);
        let frequency_ppb = run.frequency_until_ppb(890);
        checks.equal("source", run.board.clock.source(), Source::Pulse);
        run.until(1_200 * SECOND);
        check_held(checks, &run, frequency_ppb);
        // The messages are back, and agree.
        let agree = run.count_marks(900 * SECOND, |outcome| *outcome == Outcome::Confirmed);
        checks.at_least("marks that agree", agree, 1_400);
    });
}
