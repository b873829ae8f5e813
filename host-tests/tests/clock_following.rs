//! The clock behind a receiver's messages: how near it comes, and how soon.
//!
//! *Design.* Receivers after the measured figures, crystals within ±100 ppm or far beyond,
//! all under the invariants of `board-model`. Errors are against floor time. The limits are
//! those of a difference between two boards, kept by one.
//!
//! *Limits.* Five seeds; statistics over many are `comparison`'s.

use std::ops::Range;

use board_model::{MS, Run, SECOND, Sample, Scenario, US, worst_ns};
use host_tests::checks::{Checks, each, each_seed};
use utc_clock::{ClockState, Outcome, Ppb, Settings};
use world::{CrystalSettings, Latency, Ramp, Stall, WorldNanos};

const SEEDS: Range<u64> = 100..105;

/// Limits of the errors in a window of time.
struct Limits {
    mean_ns: i64,
    p99_ns: i64,
    max_ns: i64,
}

impl Limits {
    const M8: Self = Self {
        mean_ns: 120 * US,
        p99_ns: 400 * US,
        max_ns: 1_000 * US,
    };
    const HARSH_M8: Self = Self {
        mean_ns: 450 * US,
        p99_ns: 1_800 * US,
        max_ns: 4_000 * US,
    };
    const F9: Self = Self {
        mean_ns: 60 * US,
        p99_ns: 220 * US,
        max_ns: 1_000 * US,
    };

    /// A slope from one end of the errors to the other within the shortest window, 50 s.
    fn frequency_ppb(&self) -> f64 {
        2.0 * self.p99_ns as f64 / 50.0
    }

    /// Runs through the window and demands that phase and frequency keep within the limits.
    fn check(&self, checks: &mut Checks, run: &mut Run, window_s: Range<i64>) {
        run.until(window_s.start * SECOND);
        let frequency_ppb = run.frequency_until_ppb(window_s.end);
        let mut errors: Vec<i64> = run
            .since(window_s.start * SECOND)
            .map(|sample| sample.error_ns.abs())
            .collect();
        errors.sort_unstable();
        let count = errors.len();
        let mean_ns = errors.iter().sum::<i64>() / count as i64;
        checks.at_most("mean error, ns", mean_ns, self.mean_ns);
        checks.at_most(
            "99 % of the errors, ns",
            errors[count * 99 / 100],
            self.p99_ns,
        );
        checks.at_most("largest error, ns", errors[count - 1], self.max_ns);
        checks.at_most("frequency error, ppb", frequency_ppb, self.frequency_ppb());
    }
}

#[test]
fn receivers_are_followed_in_phase_and_frequency() {
    for (latency, limits) in [
        (Latency::m8(), Limits::M8),
        (Latency::harsh_m8(), Limits::HARSH_M8),
        (Latency::f9(), Limits::F9),
    ] {
        let ramps = [Ramp::None, Ramp::UP, Ramp::TURNING];
        let cases = ramps.map(|ramp| (latency, ramp));
        each_seed(SEEDS, cases, |checks, seed, (latency, ramp)| {
            let mut scenario = Scenario::new(latency, seed);
            scenario.crystal.ramp = ramp;
            let mut run = scenario.start();
            limits.check(checks, &mut run, 180..780);
            let counters = run.board.clock.counters();
            let steps = (counters.sets, counters.steps_back);
            checks.equal("sets and steps back", steps, (1, 0));
            checks.equal("holdovers", counters.holdovers, 0);
            // The second mark, if it is so much earlier than the first that it might be a label.
            checks.at_most("refusals", counters.refused(), 1);
        });
    }
}

#[test]
fn it_converges_within_a_minute() {
    let cases = [
        ("M8", Latency::m8(), MS),
        ("harsh M8", Latency::harsh_m8(), 4 * MS),
    ];
    for (name, latency, limit) in cases {
        let late = (200..240).filter(|&seed| {
            let mut run = Scenario::new(latency, seed).start();
            run.until(90 * SECOND);
            worst_ns(run.since(60 * SECOND)) > limit
        });
        // 95 % of 40.
        let late = late.count();
        assert!(late <= 2, "{late} of 40 with {name}");
    }
}

/// Settings with a stored frequency, `wrong_ppb` off, stated to be good to half a ppm.
fn stored(scenario: &Scenario, wrong_ppb: i32) -> Settings {
    Settings {
        frequency: Ppb(wrong_ppb - scenario.crystal.offset_ppb.round() as i32),
        frequency_uncertainty: Ppb(500),
        ..scenario.settings
    }
}

#[test]
fn with_a_stored_frequency_that_is_right_it_converges_in_ten_seconds() {
    let mut late = 0;
    each(200..230, |checks, &seed| {
        let mut scenario = Scenario::new(Latency::m8(), seed);
        scenario.settings = stored(&scenario, 0);
        let mut run = scenario.start();
        run.until(10 * SECOND);
        let frequency_ppb = run.frequency_until_ppb(60);
        late += u32::from(worst_ns(run.since(10 * SECOND)) > MS);
        let limit_ppb = Limits::M8.frequency_ppb();
        checks.at_most("frequency error, ppb", frequency_ppb, limit_ppb);
    });
    // 93 % of 30.
    assert!(late <= 2, "{late} of 30");
}

#[test]
fn a_stored_frequency_that_is_wrong_is_unlearnt() {
    each_seed(SEEDS, [-20_000, 20_000], |checks, seed, wrong_ppb| {
        let mut scenario = Scenario::new(Latency::m8(), seed);
        scenario.settings = stored(&scenario, wrong_ppb);
        let mut run = scenario.start();
        // A frequency that is said to be known moves by 4.8 ppm a minute at most.
        run.until(420 * SECOND);
        // On the way no worse than what 20 ppm make of the longest window, 120 s.
        let worst = worst_ns(run.since(10 * SECOND));
        checks.at_most("error on the way, ns", worst, 2_400 * US);
        Limits::M8.check(checks, &mut run, 420..900);
    });
}

#[test]
fn crystals_as_far_off_as_they_may_be_are_followed() {
    let mut all = Vec::new();
    let ppm = [-100, 100];
    each_seed(SEEDS, ppm, |checks, seed, ppm| {
        let mut scenario = Scenario::new(Latency::m8(), seed);
        scenario.crystal = CrystalSettings::new(f64::from(ppm) * 1e3);
        let mut run = scenario.start();
        Limits::M8.check(checks, &mut run, 240..540);
        all.extend(run.since(0));
        let counters = run.board.clock.counters();
        let odd = (counters.steps_back, counters.drift);
        checks.equal("steps back and refused crystals", odd, (0, 0));
    });
    each(["all"], |checks, _| checks.covered(all.iter().copied()));
}

#[test]
fn what_no_crystal_does_is_not_learnt() {
    // Nothing is promised of a clock with such a crystal but that.
    each_seed(SEEDS, [-3_000, -500, 500, 3_000], |checks, seed, ppm| {
        let mut scenario = Scenario::new(Latency::m8(), seed);
        scenario.crystal = CrystalSettings::new(f64::from(ppm) * 1e3);
        let mut run = scenario.start();
        run.board.invariants.margin_ppb = f64::INFINITY;
        run.until(900 * SECOND);
        let Ppb(learnt) = run.board.clock.frequency();
        checks.at_most("learnt frequency, ppb", learnt.abs(), 110_000);
    });
}

#[test]
fn a_late_first_mark_is_stepped_over_forward_within_half_a_minute() {
    // The backlog of a stall comes first: the first mark is late by most of it. One of
    // more than half a second makes outliers of the good ones.
    let mut all = Vec::new();
    each_seed(SEEDS, [260, 450, 950, 1_560], |checks, seed, lasts_ms| {
        let mut scenario = Scenario::new(Latency::m8(), seed);
        scenario.receiver.stalls.push(Stall {
            from: WorldNanos(0),
            lasts_ns: lasts_ms * 1_000_000,
        });
        let mut run = scenario.start();
        run.until(60 * SECOND);
        checks.equal("the first mark", run.marks[0].1, Outcome::Set);
        let stepped = |outcome: &Outcome| match outcome {
            Outcome::Stepped { by_ns } => Some(*by_ns),
            _ => None,
        };
        let steps: Vec<i64> = run.marks.iter().filter_map(|(_, o)| stepped(o)).collect();
        checks.at_least(
            "least step, ns",
            steps.iter().copied().min().unwrap_or(0),
            1,
        );
        let counters = run.board.clock.counters();
        let counted = (counters.steps_forward as usize, counters.steps_back);
        checks.equal("steps", counted, (steps.len(), 0));
        // The error of the first mark is gone long before the half minute is over.
        let soon = worst_ns(run.since(15 * SECOND));
        checks.at_most("error after 15 s, ns", soon, 4 * MS);
        let then = worst_ns(run.since(55 * SECOND));
        checks.at_most("error after 55 s, ns", then, MS);
        all.extend(run.since(0));
    });
    each(["all"], |checks, _| checks.covered(all.iter().copied()));
}

#[test]
fn after_half_a_minute_it_never_steps() {
    let latencies = [
        Latency::m8(),
        Latency::harsh_m8(),
        Latency::f9(),
        Latency::rayleigh(),
    ];
    each_seed(SEEDS, latencies, |checks, seed, latency| {
        let mut run = Scenario::new(latency, seed).start();
        run.until(300 * SECOND);
        let settled_ns = run.marks[0].0 + 30 * SECOND;
        for (at_ns, outcome) in &run.marks {
            if let Outcome::Stepped { by_ns } = outcome {
                checks.at_least("step, ns", *by_ns, 1);
                checks.at_most("time of a step, ns", *at_ns, settled_ns);
            }
        }
        let is_lost = |sample: &Sample| sample.state == ClockState::Holdover;
        checks.that(!run.board.samples.iter().any(is_lost), "a holdover");
    });
}
