//! The clock under a time pulse: a good one, a bad one, and one that is lost.
//!
//! *Design.* An M8 in the simulated world with its pulse of 30 ns RMS on the capture pin,
//! under the referee of `clock_board`: whatever happens to the pulse, no reading jumps.
//! Errors are against UTC. The pulse begins after a minute, when the clock may not
//! step for its messages any more; what goes wrong begins after five.
//!
//! *Limits.* Five seeds.

use host_tests::clock_board::{MS, SECOND, START, US};
use host_tests::clock_scene::{Faults, Play, Scene, at_s, covered, worst_ns};
use utc_clock::{Outcome, Published, PulseOutcome, PulseRefusal, Source};
use world::{
    CrystalSettings, Latency, PulseFault, PulseFaultKind, PulseSettings, Ramp, ReceiverSettings,
    Stall, TimeFault, WorldNanos,
};

const SEEDS: std::ops::Range<u64> = 500..505;
/// When the pulse begins, in s.
const FROM_S: i64 = 60;
/// When something goes wrong with it, in s.
const WRONG_S: i64 = 300;
const WRONG: WorldNanos = at_s(300);
/// As far as two boards under their pulses may ever be apart.
const MAX_NS: i64 = 250;
/// 60 s after the pulse was lost.
const LOST_MAX_NS: i64 = 3 * US;
/// What 250 ns make of the frequency over 2 s, which a filter sees at least.
const FREQUENCY_PPB: f64 = 125.0;
const FOR_EVER: WorldNanos = WorldNanos(u64::MAX);

fn scene(seed: u64) -> Scene {
    let mut scene = Scene::new(Latency::m8(), seed);
    scene.receiver.pulse.from = at_s(60);
    scene.with_pulse()
}

/// One with a pulse that something befalls from `WRONG` to `until`.
fn faulty(seed: u64, kind: PulseFaultKind, until: WorldNanos) -> Scene {
    let mut scene = scene(seed);
    let pulse = scene.pulse.as_mut().expect("plugged in");
    pulse.pulse.faults.push(PulseFault {
        from: WRONG,
        until,
        kind,
    });
    scene
}

/// The largest error against UTC since then, in ns.
fn worst_since(play: &Play<'_>, from_s: i64) -> i64 {
    worst_ns(play.utc_since(from_s * SECOND))
}

/// Whether any mark or pulse stepped since then.
fn stepped(play: &Play<'_>, from_s: i64) -> bool {
    let mark = |outcome: &Outcome| matches!(outcome, Outcome::Stepped { .. });
    let pulse = |outcome: &PulseOutcome| matches!(outcome, PulseOutcome::Stepped { .. });
    play.count_marks(from_s * SECOND, mark) + play.count_pulses(from_s * SECOND, pulse) > 0
}

fn refused(play: &Play<'_>, from_s: i64, as_what: PulseRefusal) -> usize {
    play.count_pulses(from_s * SECOND, |outcome| {
        *outcome == PulseOutcome::Refused(as_what)
    })
}

#[test]
fn it_locks_after_five_pulses_and_steps_forward_over_the_latency() {
    let mut faults = Faults::default();
    for seed in SEEDS {
        let scene = scene(seed);
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(FROM_S * SECOND - MS);
        assert_eq!(play.board.clock.source(), Source::Message);
        let late = -play.board.error_ns();
        play.until((FROM_S + 5) * SECOND);
        let (candidates, followed) = play.pulses.split_at(5);
        let candidates = &candidates[..candidates.len() - 1];
        assert!(
            candidates
                .iter()
                .all(|(_, o)| *o == PulseOutcome::Candidate)
        );
        let first = play.pulses[4].1;
        let told = format!("seed {seed}: {late} ns late, {first:?}, {followed:?}");
        let is_over_it = match first {
            PulseOutcome::Stepped { by_ns } => (by_ns - late).abs() <= MS,
            _ => false,
        };
        faults.unless(is_over_it, &told);
        assert_eq!(play.board.clock.source(), Source::Pulse);
        let counters = play.board.clock.counters();
        assert_eq!((counters.pulse_locks, counters.steps_back), (1, 0));
        // What the step left is gone soon, and the latency is known.
        play.until((FROM_S + 60) * SECOND);
        let soon = worst_since(&play, FROM_S + 30);
        let latency = play.board.clock.latency_ns() - scene.floor_ns();
        faults.unless(
            soon <= MAX_NS && latency.abs() <= MS,
            format!("{told}: {soon} ns, latency {latency} ns off"),
        );
        faults.unless(
            play.board.read().uncertainty_ns <= 1_000,
            format!("{told}: {:?}", play.board.read()),
        );
    }
    faults.none();
}

#[test]
fn a_latency_that_was_set_wrong_does_not_keep_the_pulse_out() {
    let mut faults = Faults::default();
    for (seed, wrong_ns) in SEEDS.zip([-30 * MS, -25 * MS, 25 * MS, 60 * MS, 90 * MS]) {
        let mut scene = scene(seed);
        let set_ns = u32::try_from(scene.floor_ns() + wrong_ns).expect("no less than 0");
        scene.settings = scene.settings.with_latency_ns(set_ns);
        let line = Published::new();
        let mut play = scene.play(&line);
        // It is ahead by what was set too much, and slews that away at 400 ppm.
        let slewed_s = (wrong_ns.max(0) as f64 / 400e-6 / 1e9) as i64;
        let over_s = FROM_S + slewed_s + 60;
        play.until((over_s + 60) * SECOND);
        let (source, worst) = (play.board.clock.source(), worst_since(&play, over_s));
        faults.unless(
            source == Source::Pulse && worst <= MAX_NS,
            format!("seed {seed}, {wrong_ns} ns: {source:?}, {worst} ns"),
        );
    }
    faults.none();
}

#[test]
fn it_is_followed_in_phase_and_frequency() {
    let constant = (Ramp::None, 22, 130);
    let ramp = Ramp::Constant {
        ppb_per_min: 1_000.0,
    };
    let turning = Ramp::Random {
        ppb_per_min: 1_000.0,
        every_ns: 120_000_000_000,
    };
    let mut faults = Faults::default();
    for (ramp, mean_ns, max_ns) in [constant, (ramp, 32, MAX_NS), (turning, 32, MAX_NS)] {
        let mut all = Vec::new();
        for seed in SEEDS {
            let mut scene = scene(seed);
            scene.crystal.ramp = ramp;
            let line = Published::new();
            let mut play = scene.play(&line);
            play.until(180 * SECOND);
            let frequency = play.frequency_until_ppb(780);
            let samples: Vec<_> = play.utc_since(180 * SECOND).collect();
            let max = worst_ns(samples.iter().copied());
            let name = format!("{ramp:?}, seed {seed}: {max} ns, {frequency:.0} ppb");
            faults.unless(max <= max_ns && frequency <= FREQUENCY_PPB, &name);
            let odd = play.count_marks(180 * SECOND, |outcome| *outcome != Outcome::Confirmed);
            faults.unless(odd == 0, format!("{name}: {odd} marks did something"));
            all.extend(samples);
        }
        let mean = all.iter().map(|s| s.error_ns.abs()).sum::<i64>() / all.len() as i64;
        faults.unless(mean <= mean_ns, format!("{ramp:?}: mean {mean} ns"));
        let held = covered(all);
        faults.unless(held >= 0.95, format!("{ramp:?}: {held:.3} are held"));
    }
    faults.none();
}

#[test]
fn a_pulse_at_a_wrong_phase_is_refused_from_the_start() {
    let mut faults = Faults::default();
    // One that is early by what a latency could be is taken for good: nothing on the
    // board could tell.
    for (seed, by_ms) in SEEDS.flat_map(|seed| [100, 300, 500, -300].map(|ms| (seed, ms))) {
        let mut scene = faulty(
            seed,
            PulseFaultKind::WrongPhase { by_ns: by_ms * MS },
            FOR_EVER,
        );
        let pulse = scene.pulse.as_mut().expect("plugged in");
        pulse.pulse.faults[0].from = WorldNanos(0);
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(WRONG_S * SECOND);
        let counters = play.board.clock.counters();
        let worst = worst_ns(play.since(180 * SECOND));
        let name = format!("{by_ms} ms, seed {seed}: {worst} ns, {counters:?}");
        faults.unless(
            counters.pulses == 0 && counters.pulse_off_second >= 200,
            &name,
        );
        faults.unless(worst <= MS, &name);
        assert_eq!(play.board.clock.source(), Source::Message);
    }
    faults.none();
}

#[test]
fn a_pulse_that_goes_wrong_is_refused_and_believed_again_when_it_is_right() {
    let phases =
        [-500, -300, -100, 100, 300, 500].map(|ms| PulseFaultKind::WrongPhase { by_ns: ms * MS });
    let mut faults = Faults::default();
    for (seed, kind) in SEEDS.flat_map(|seed| {
        let kinds = phases.into_iter().chain([PulseFaultKind::Cut]);
        kinds.map(move |kind| (seed, kind))
    }) {
        let line = Published::new();
        let mut play = faulty(seed, kind, at_s(360)).play(&line);
        play.until(WRONG_S * SECOND - MS);
        let frequency = play.frequency_until_ppb(WRONG_S + 60);
        let name = format!("{kind:?}, seed {seed}");
        let worst = worst_since(&play, WRONG_S);
        faults.unless(
            worst <= LOST_MAX_NS && frequency <= FREQUENCY_PPB,
            format!("{name}: {worst} ns while it was wrong, {frequency:.0} ppb"),
        );
        if kind != PulseFaultKind::Cut {
            let off_line = refused(&play, WRONG_S, PulseRefusal::OffLine);
            let off_second = refused(&play, WRONG_S, PulseRefusal::OffSecond);
            faults.unless(
                off_line >= 9 && off_second >= 40,
                format!("{name}: {off_line} off the line, {off_second} off the second"),
            );
        }
        play.until(420 * SECOND);
        let worst = worst_since(&play, 390);
        faults.unless(worst <= MAX_NS, format!("{name}: {worst} ns then"));
        assert_eq!(play.board.clock.source(), Source::Pulse, "{name}");
        faults.unless(!stepped(&play, WRONG_S), format!("{name}: stepped"));
        let holdovers = play.board.clock.counters().holdovers;
        faults.unless(holdovers == 0, format!("{name}: {holdovers} holdovers"));
    }
    faults.none();
}

#[test]
fn missing_doubled_and_bouncing_pulses_do_no_harm() {
    use PulseFaultKind::{Bouncing, Doubled, Missing};
    let kinds = [
        (Missing { one_in: 3 }, None),
        (Doubled { after_ns: 10_000 }, Some(PulseRefusal::Doubled)),
        (
            Doubled {
                after_ns: 100_000_000,
            },
            Some(PulseRefusal::Doubled),
        ),
        (
            Doubled {
                after_ns: 500_000_000,
            },
            None,
        ),
        // Before the edge, as a contact bounces when it opens.
        (
            Doubled {
                after_ns: 999_000_000,
            },
            Some(PulseRefusal::OffLine),
        ),
        (
            Doubled {
                after_ns: 999_999_000,
            },
            Some(PulseRefusal::OffLine),
        ),
        (
            Bouncing {
                edges: 5,
                within_ns: 2_000_000,
            },
            Some(PulseRefusal::Doubled),
        ),
    ];
    let mut faults = Faults::default();
    for (seed, (kind, refusal)) in SEEDS.flat_map(|seed| kinds.map(|kind| (seed, kind))) {
        let line = Published::new();
        let mut play = faulty(seed, kind, at_s(480)).play(&line);
        play.until(WRONG_S * SECOND - MS);
        let frequency = play.frequency_until_ppb(540);
        let worst = worst_since(&play, WRONG_S);
        let name = format!("{kind:?}, seed {seed}: {worst} ns, {frequency:.0} ppb");
        faults.unless(worst <= MAX_NS && frequency <= FREQUENCY_PPB, &name);
        if let Some(refusal) = refusal {
            let count = refused(&play, WRONG_S, refusal);
            faults.unless(count >= 170, format!("{name}: {count} {refusal:?}"));
        }
        let counters = play.board.clock.counters();
        let is_missed = matches!(kind, Missing { .. });
        faults.unless(
            (counters.pulse_locks == 1 || is_missed) && counters.holdovers == 0,
            format!("{name}: {counters:?}"),
        );
        faults.unless(!stepped(&play, WRONG_S), format!("{name}: stepped"));
    }
    faults.none();
}

/// A receiver whose seconds are `phase_ms` ahead and 10 ppm fast.
fn somebody_else(phase_ms: i64, from: WorldNanos) -> ReceiverSettings {
    ReceiverSettings {
        seed: 7,
        pulse: PulseSettings {
            from,
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
fn somebody_elses_pulse_is_not_followed() {
    let mut faults = Faults::default();
    for (seed, phase_ms) in SEEDS.flat_map(|seed| [-450, -200, 350, 480].map(|ms| (seed, ms))) {
        let mut scene = scene(seed);
        scene.pulse = Some(somebody_else(phase_ms, at_s(60)));
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(600 * SECOND);
        let counters = play.board.clock.counters();
        let worst = worst_ns(play.since(180 * SECOND));
        let name = format!("{phase_ms} ms, seed {seed}: {worst} ns, {counters:?}");
        faults.unless(
            counters.pulses == 0 && counters.pulse_off_second >= 500,
            &name,
        );
        faults.unless(worst <= MS, &name);
    }
    faults.none();
}

#[test]
fn somebody_elses_pulse_that_could_be_ours_is_found_out_by_the_messages() {
    let mut faults = Faults::default();
    for seed in SEEDS {
        let mut scene = scene(seed);
        // As if the latency were 90 ms, and more by 10 µs each second.
        scene.pulse = Some(somebody_else(50, at_s(60)));
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(4_200 * SECOND);
        let counters = play.board.clock.counters();
        let name = format!("seed {seed}: {counters:?}");
        assert_eq!(play.board.clock.source(), Source::Message, "{name}");
        // As far as floors wander, and the slew that takes it back.
        let drawn = play.utc_since(0).map(|s| s.error_ns).max();
        faults.unless(
            drawn.is_some_and(|ns| ns <= 50 * MS + 45 * MS),
            format!("{name}: drawn by {drawn:?} ns"),
        );
        faults.unless(counters.pulse_off_second > 0, &name);
        faults.unless(!stepped(&play, 90), &name);
    }
    faults.none();
}

#[test]
fn the_latency_that_was_learnt_serves_when_the_pulse_is_lost() {
    let mut faults = Faults::default();
    for (seed, latency) in
        SEEDS.flat_map(|seed| [Latency::m8(), Latency::f9()].map(|latency| (seed, latency)))
    {
        let mut scene = faulty(seed, PulseFaultKind::Cut, at_s(2_700));
        scene.receiver.latency = latency;
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(WRONG_S * SECOND);
        let name = format!("{latency:?}, seed {seed}");
        // For ten minutes the pulse's own line is better than the messages are.
        let frequency = play.frequency_until_ppb(WRONG_S + 600);
        let minute = play.utc_since(WRONG_S * SECOND);
        let minute = worst_ns(minute.take_while(|s| s.at_ns <= 360 * SECOND));
        let ten = worst_since(&play, WRONG_S);
        faults.unless(
            minute <= LOST_MAX_NS && ten <= MS && frequency <= FREQUENCY_PPB,
            format!("{name}: {minute} ns in a minute, {ten} ns in ten, {frequency:.0} ppb"),
        );
        // Then the messages take over; they are as far from UTC now as from their floor.
        let frequency = play.frequency_until_ppb(2_699);
        let worst = worst_since(&play, WRONG_S + 600);
        faults.unless(
            worst <= MS && frequency <= 16_000.0,
            format!("{name}: {worst} ns with the messages, {frequency:.0} ppb"),
        );
        assert_eq!(play.board.clock.source(), Source::Message, "{name}");
        let latency_ns = play.board.clock.latency_ns() - scene.floor_ns();
        faults.unless(
            latency_ns.abs() <= MS,
            format!("{name}: latency {latency_ns} ns off"),
        );
        let held = covered(play.utc_since(WRONG_S * SECOND));
        faults.unless(held >= 0.95, format!("{name}: {held:.3} are held"));
        play.until(2_760 * SECOND);
        let back = worst_since(&play, 2_730);
        faults.unless(
            back <= MAX_NS,
            format!("{name}: {back} ns when it was back"),
        );
        assert_eq!(play.board.clock.source(), Source::Pulse, "{name}");
        faults.unless(!stepped(&play, WRONG_S), format!("{name}: stepped"));
    }
    faults.none();
}

#[test]
fn a_pulse_that_jumps_and_stays_is_believed_after_a_while_and_slewed_to() {
    let mut faults = Faults::default();
    for (seed, by_us) in SEEDS.flat_map(|seed| [-500, 500].map(|us| (seed, us))) {
        let kind = PulseFaultKind::WrongPhase { by_ns: by_us * US };
        let line = Published::new();
        let mut play = faulty(seed, kind, FOR_EVER).play(&line);
        play.until((WRONG_S + 9) * SECOND);
        let at_first = worst_since(&play, WRONG_S);
        let off_line = refused(&play, WRONG_S, PulseRefusal::OffLine);
        let name = format!("{by_us} us, seed {seed}");
        faults.unless(
            at_first <= MAX_NS && off_line >= 8,
            format!("{name}: {at_first} ns, {off_line} off the line"),
        );
        play.until(420 * SECOND);
        // A pulse that is late makes seconds late.
        let off = play
            .utc_since(360 * SECOND)
            .map(|s| (s.error_ns + by_us * US).abs());
        let off = off.max().unwrap_or(i64::MAX);
        faults.unless(off <= MAX_NS, format!("{name}: {off} ns off it in the end"));
        faults.unless(!stepped(&play, WRONG_S), format!("{name}: stepped"));
    }
    faults.none();
}

#[test]
fn what_tim_tp_says_is_taken_off() {
    let mut faults = Faults::default();
    for seed in SEEDS {
        let [with, without] = [1, 0].map(|tim_tp_every| {
            let mut scene = scene(seed);
            let pulse = scene.pulse.as_mut().expect("plugged in");
            pulse.port.tim_tp_every = tim_tp_every;
            // ±21 ns that turn round in 42 s, slow enough for any filter to follow, and
            // a crystal that is better than that.
            scene.crystal = CrystalSettings::quiet(30_000.0);
            pulse.crystal_ppb = 1;
            pulse.pulse.clock_hz = 24_000_000;
            pulse.pulse.rms_ns = 13;
            let line = Published::new();
            let mut play = scene.play(&line);
            play.until(480 * SECOND);
            let errors: Vec<i64> = play
                .utc_since(180 * SECOND)
                .map(|sample| sample.error_ns.abs())
                .collect();
            errors.iter().sum::<i64>() as f64 / errors.len() as f64
        });
        faults.unless(
            with <= 0.5 * without,
            format!("seed {seed}: {with:.1} ns with, {without:.1} ns without"),
        );
    }
    faults.none();
}

#[test]
fn the_clock_numbers_the_pulse_through_a_stall_of_the_messages() {
    let mut faults = Faults::default();
    for (seed, lasts_ms) in SEEDS.flat_map(|seed| [1_560, 5_000].map(|ms| (seed, ms))) {
        let mut scene = scene(seed);
        scene.receiver.stalls.push(Stall {
            from: WRONG,
            lasts_ns: lasts_ms * 1_000_000,
        });
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(360 * SECOND);
        let worst = worst_since(&play, WRONG_S);
        let counters = play.board.clock.counters();
        let name = format!("{lasts_ms} ms, seed {seed}: {worst} ns, {counters:?}");
        faults.unless(worst <= MAX_NS && !stepped(&play, WRONG_S), &name);
        faults.unless(
            counters.outlier > 0 && (counters.pulse_locks, counters.holdovers) == (1, 0),
            &name,
        );
    }
    faults.none();
}

#[test]
fn without_messages_it_stays_on_the_pulse() {
    let mut faults = Faults::default();
    for seed in SEEDS {
        let mut scene = scene(seed);
        scene.deaf.push(WRONG_S * SECOND..900 * SECOND);
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(WRONG_S * SECOND);
        let frequency = play.frequency_until_ppb(890);
        assert_eq!(play.board.clock.source(), Source::Pulse);
        play.until(1_200 * SECOND);
        let worst = worst_since(&play, WRONG_S);
        let counters = play.board.clock.counters();
        let name = format!("seed {seed}: {worst} ns, {frequency:.0} ppb, {counters:?}");
        faults.unless(
            worst <= MAX_NS && frequency <= FREQUENCY_PPB && counters.holdovers == 0,
            &name,
        );
        // The messages are back, and agree.
        let agree = play.count_marks(900 * SECOND, |outcome| *outcome == Outcome::Confirmed);
        faults.unless(agree >= 1_400, format!("{name}: {agree} agree"));
        faults.unless(!stepped(&play, WRONG_S), name);
    }
    faults.none();
}
