//! The clock behind a receiver's messages: how near it comes, and how soon.
//!
//! *Design.* Receivers after the measured figures, crystals as chance has them or far
//! beyond that, all under the referee of `clock_board`. Errors are against floor time.
//! The limits are those of a difference between two boards, kept by one.
//!
//! *Limits.* Five seeds; statistics over many are `comparison`'s.

use host_tests::clock_board::{MS, SECOND, Sample, US};
use host_tests::clock_scene::{Faults, Play, Scene, covered, worst_ns};
use utc_clock::{ClockState, Outcome, Ppb, Published, Settings};
use world::{CrystalSettings, Latency, Ramp, Stall, WorldNanos};

const SEEDS: std::ops::Range<u64> = 100..105;

/// The mean of the errors from `from_s` on, the 99th percentile and the largest, in ns.
fn errors_ns(play: &Play<'_>, from_s: i64) -> (i64, i64, i64) {
    let mut errors: Vec<i64> = play
        .since(from_s * SECOND)
        .map(|sample| sample.error_ns.abs())
        .collect();
    errors.sort_unstable();
    let mean = errors.iter().sum::<i64>() / i64::try_from(errors.len()).expect("few");
    (
        mean,
        errors[errors.len() * 99 / 100],
        errors[errors.len() - 1],
    )
}

/// What a stretch of a play was like, and what it must be.
struct Report {
    told: String,
    mean: i64,
    p99: i64,
    max: i64,
    frequency: f64,
}

impl Report {
    fn of(play: &mut Play<'_>, name: &str, from_s: i64, until_s: i64) -> Self {
        play.until(from_s * SECOND);
        let frequency = play.frequency_until_ppb(until_s);
        let (mean, p99, max) = errors_ns(play, from_s);
        Self {
            told: format!("{name}: {mean}, {p99}, {max} ns, {frequency:.0} ppb"),
            mean,
            p99,
            max,
            frequency,
        }
    }

    fn judge(&self, limits: &Limits, faults: &mut Faults) {
        let holds = self.mean <= limits.mean_us * US
            && self.p99 <= limits.p99_us * US
            && self.max <= limits.max_us * US
            && self.frequency <= limits.frequency_ppb();
        faults.unless(holds, &self.told);
    }
}

/// Of the errors, in µs.
struct Limits {
    mean_us: i64,
    p99_us: i64,
    max_us: i64,
}

impl Limits {
    const M8: Self = Self {
        mean_us: 120,
        p99_us: 400,
        max_us: 1_000,
    };
    const HARSH_M8: Self = Self {
        mean_us: 450,
        p99_us: 1_800,
        max_us: 4_000,
    };
    const F9: Self = Self {
        mean_us: 60,
        p99_us: 220,
        max_us: 1_000,
    };

    /// A slope from the one end of the errors to the other within the least window, 50 s.
    fn frequency_ppb(&self) -> f64 {
        2.0 * self.p99_us as f64 * 1e3 / 50.0
    }
}

#[test]
fn receivers_are_followed_in_phase_and_frequency() {
    let receivers = [
        ("M8", Latency::m8(), Limits::M8),
        ("harsh M8", Latency::harsh_m8(), Limits::HARSH_M8),
        ("F9", Latency::f9(), Limits::F9),
    ];
    let ramps = [
        Ramp::None,
        Ramp::Constant {
            ppb_per_min: 1_000.0,
        },
        Ramp::Random {
            ppb_per_min: 1_000.0,
            every_ns: 120_000_000_000,
        },
    ];
    let mut faults = Faults::default();
    for (name, latency, limits) in receivers {
        for (seed, ramp) in SEEDS.flat_map(|seed| ramps.map(|ramp| (seed, ramp))) {
            let mut scene = Scene::new(latency, seed);
            scene.crystal.ramp = ramp;
            let line = Published::new();
            let mut play = scene.play(&line);
            let name = format!("{name}, seed {seed}, {ramp:?}");
            Report::of(&mut play, &name, 180, 780).judge(&limits, &mut faults);
            let counters = play.board.clock.counters();
            let is_calm = (counters.sets, counters.steps_back) == (1, 0)
                && (counters.refused(), counters.holdovers) == (0, 0);
            faults.unless(is_calm, format!("{name}: {counters:?}"));
        }
    }
    faults.none();
}

#[test]
fn it_converges_within_a_minute() {
    let cases = [
        ("M8", Latency::m8(), MS),
        ("harsh M8", Latency::harsh_m8(), 4 * MS),
    ];
    for (name, latency, limit) in cases {
        let late = (200..240).filter(|&seed| {
            let line = Published::new();
            let mut play = Scene::new(latency, seed).play(&line);
            play.until(90 * SECOND);
            worst_ns(play.since(60 * SECOND)) > limit
        });
        // 95 % of 40.
        let late = late.count();
        assert!(late <= 2, "{late} of 40 with {name}");
    }
}

/// A frequency that was stored, `wrong_ppb` off, and is believed to half a ppm.
fn stored(scene: &Scene, wrong_ppb: i32) -> Settings {
    Settings {
        frequency: Ppb(wrong_ppb - scene.crystal.offset_ppb.round() as i32),
        frequency_uncertainty: Ppb(500),
        ..scene.settings
    }
}

#[test]
fn with_a_stored_frequency_that_is_right_it_converges_in_ten_seconds() {
    let mut late = 0;
    let mut faults = Faults::default();
    for seed in 200..230 {
        let mut scene = Scene::new(Latency::m8(), seed);
        scene.settings = stored(&scene, 0);
        let line = Published::new();
        let mut play = scene.play(&line);
        let Report {
            told,
            max,
            frequency,
            ..
        } = Report::of(&mut play, &format!("seed {seed}"), 10, 60);
        late += u32::from(max > MS);
        faults.unless(frequency <= Limits::M8.frequency_ppb(), told);
    }
    faults.none();
    // 93 % of 30.
    assert!(late <= 2, "{late} of 30");
}

#[test]
fn a_stored_frequency_that_is_wrong_is_unlearnt() {
    let mut faults = Faults::default();
    for (seed, wrong_ppb) in SEEDS.flat_map(|seed| [-20_000, 20_000].map(|ppb| (seed, ppb))) {
        let mut scene = Scene::new(Latency::m8(), seed);
        scene.settings = stored(&scene, wrong_ppb);
        let line = Published::new();
        let mut play = scene.play(&line);
        let name = format!("{wrong_ppb} ppb wrong, seed {seed}");
        // On the way no worse than what 20 ppm make of the longest window, 120 s.
        let on_the_way = Report::of(&mut play, &name, 10, 300);
        faults.unless(on_the_way.max <= 2_400 * US, on_the_way.told);
        Report::of(&mut play, &name, 300, 780).judge(&Limits::M8, &mut faults);
    }
    faults.none();
}

#[test]
fn crystals_far_off_are_followed_all_the_same() {
    let mut faults = Faults::default();
    let mut all = Vec::new();
    for (seed, ppm) in SEEDS.flat_map(|seed| [-1_800, -500, 500, 1_800].map(|ppm| (seed, ppm))) {
        let mut scene = Scene::new(Latency::m8(), seed);
        scene.crystal = CrystalSettings::new(f64::from(ppm) * 1e3);
        let line = Published::new();
        let mut play = scene.play(&line);
        let name = format!("{ppm} ppm, seed {seed}");
        // Three minutes are what it may take, and one more for what 500 ppm have to slew.
        Report::of(&mut play, &name, 240, 540).judge(&Limits::M8, &mut faults);
        all.extend(play.since(0));
        let counters = play.board.clock.counters();
        let is_calm = (counters.steps_back, counters.crystal) == (0, 0);
        faults.unless(is_calm, format!("{name}: {counters:?}"));
    }
    let held = covered(all);
    faults.unless(held >= 0.95, format!("{held:.3} are held"));
    faults.none();
}

#[test]
fn a_crystal_beyond_2_000_ppm_is_refused_and_nothing_is_claimed() {
    let mut faults = Faults::default();
    for (seed, ppm) in SEEDS.flat_map(|seed| [-3_000, 3_000].map(|ppm| (seed, ppm))) {
        let mut scene = Scene::new(Latency::m8(), seed);
        scene.crystal = CrystalSettings::new(f64::from(ppm) * 1e3);
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(300 * SECOND);
        let name = format!("{ppm} ppm, seed {seed}");
        let counters = play.board.clock.counters();
        faults.unless(counters.crystal > 0, format!("{name}: {counters:?}"));
        let held = covered(play.since(0));
        faults.unless(held >= 0.95, format!("{name}: {held:.3} are held"));
        // Nothing beyond the bound is ever learnt.
        let Ppb(learnt) = play.board.clock.frequency();
        faults.unless(learnt.abs() <= 2_000_000, format!("{name}: {learnt} ppb"));
    }
    faults.none();
}

#[test]
fn a_late_first_mark_is_stepped_over_forward_within_half_a_minute() {
    // The backlog of a stall comes first: the first mark is late by most of it. One of
    // more than half a second makes outliers of the good ones.
    let mut faults = Faults::default();
    let mut all = Vec::new();
    for (seed, lasts_ms) in SEEDS.flat_map(|seed| [260, 450, 950, 1_560].map(|ms| (seed, ms))) {
        let mut scene = Scene::new(Latency::m8(), seed);
        scene.receiver.stalls.push(Stall {
            from: WorldNanos(0),
            lasts_ns: lasts_ms * 1_000_000,
        });
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(60 * SECOND);
        let name = format!("{lasts_ms} ms, seed {seed}");
        assert_eq!(play.marks[0].1, Outcome::Set, "{name}");
        let stepped = |outcome: &Outcome| match outcome {
            Outcome::Stepped { by_ns } => Some(*by_ns),
            _ => None,
        };
        let steps: Vec<i64> = play.marks.iter().filter_map(|(_, o)| stepped(o)).collect();
        faults.unless(
            !steps.is_empty() && steps.iter().all(|by_ns| *by_ns > 0),
            format!("{name}: {steps:?}"),
        );
        let counters = play.board.clock.counters();
        assert_eq!(counters.steps_forward as usize, steps.len(), "{name}");
        assert_eq!(counters.steps_back, 0, "{name}");
        // What it was set late by is gone long before the half minute is over.
        let soon = worst_ns(play.since(15 * SECOND));
        faults.unless(soon <= 4 * MS, format!("{name}: {soon} ns after 15 s"));
        let then = worst_ns(play.since(55 * SECOND));
        faults.unless(then <= MS, format!("{name}: {then} ns after 55 s"));
        all.extend(play.since(0));
    }
    let held = covered(all);
    faults.unless(held >= 0.95, format!("{held:.3} are held"));
    faults.none();
}

#[test]
fn after_half_a_minute_it_never_steps() {
    let mut faults = Faults::default();
    for (seed, latency) in SEEDS.flat_map(|seed| {
        [
            Latency::m8(),
            Latency::harsh_m8(),
            Latency::f9(),
            Latency::rayleigh(),
        ]
        .map(|latency| (seed, latency))
    }) {
        let line = Published::new();
        let mut play = Scene::new(latency, seed).play(&line);
        play.until(300 * SECOND);
        let settled = play.marks[0].0 + 30 * SECOND;
        for (at, outcome) in &play.marks {
            if let Outcome::Stepped { by_ns } = outcome {
                let told = format!("seed {seed}, {latency:?}: {by_ns} ns at {at}");
                faults.unless(*at <= settled && *by_ns > 0, told);
            }
        }
        let stays_set = |sample: &Sample| sample.state == ClockState::Set;
        assert!(play.board.samples.iter().all(stays_set));
    }
    faults.none();
}
