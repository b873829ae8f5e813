//! The clock behind receivers that stall, jump and run away.
//!
//! *Design.* An M8 in the simulated world that something befalls after ten minutes, under
//! the referee of `clock_board`. Errors are against floor time. What a scene is
//! demanded of: how far the phase strays and the frequency, what is counted, and that
//! the clock is with its receiver again in the end.
//!
//! *Limits.* Five seeds.

use host_tests::clock_board::{MS, SECOND, US};
use host_tests::clock_scene::{Faults, Play, Scene, at_s, worst_ns};
use utc_clock::{Counters, Outcome, Published, Refusal, UtcClock};
use world::{Latency, Stall, TimeFault, WorldNanos};

const SEEDS: std::ops::Range<u64> = 300..305;
/// When it happens, in s.
const THEN_S: i64 = 600;
const THEN: WorldNanos = at_s(600);
/// As far as two M8s may ever be apart, and their 99th percentile.
const MAX_NS: i64 = MS;
const P99_NS: i64 = 400 * US;
/// What that makes of the frequency over half a window.
const FREQUENCY_PPB: f64 = 16_000.0;
/// What a crystal can do that is within its ±50 ppm, in ten minutes, and floors that
/// wander by 10 ms to either side: so far a receiver that drifts is believed.
const BELIEVED_PPB: f64 = 50_000.0;
const BELIEVED_NS: i64 = 600 * 50 * US + 20 * MS;

fn scene(seed: u64) -> Scene {
    Scene::new(Latency::m8(), seed)
}

/// Steps forward and back.
fn steps(counters: &Counters) -> (u32, u32) {
    (counters.steps_forward, counters.steps_back)
}

/// The steps since something happened, in ns.
fn stepped_by(play: &Play<'_>, from_s: i64) -> Vec<i64> {
    let since = play.marks.iter().filter(|(at, _)| *at >= from_s * SECOND);
    since
        .filter_map(|(_, outcome)| match outcome {
            Outcome::Stepped { by_ns } => Some(*by_ns),
            _ => None,
        })
        .collect()
}

/// The trace of a real Pixhawk has the first: 1.56 s late, then a flush of the backlog
/// and a duplicate.
#[test]
fn a_stall_and_its_backlog_leave_the_clock_where_it_was() {
    let mut faults = Faults::default();
    for (seed, lasts_ms) in SEEDS.flat_map(|seed| [400, 1_560, 5_000].map(|ms| (seed, ms))) {
        let mut scene = scene(seed);
        scene.receiver.stalls.push(Stall {
            from: THEN,
            lasts_ns: lasts_ms * 1_000_000,
        });
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(THEN_S * SECOND);
        let before = play.board.clock.counters();
        let error = play.floor_error_ns();
        let frequency = play.frequency_until_ppb(THEN_S + 60);
        let counters = play.board.clock.counters();
        let name = format!("{lasts_ms} ms, seed {seed}");
        faults.unless(
            steps(&counters) == steps(&before),
            format!("{name}: {counters:?}"),
        );
        faults.unless(
            counters.duplicate_epoch == before.duplicate_epoch + 1,
            format!("{name}: {} duplicates", counters.duplicate_epoch),
        );
        // Those of the backlog that are more than half a second late, each by less than
        // the one before: a fifth less the time that it takes on the wire. And those
        // that are later than any jitter.
        let outliers = i64::from(counters.outlier - before.outlier);
        let late = i64::from(counters.late - before.late);
        let expected = (lasts_ms as i64 - 500).max(0) * 10 / 1_913;
        faults.unless(
            (expected - 1..=expected + 1).contains(&outliers) && late > 0,
            format!("{name}: {outliers} outliers, {late} late"),
        );
        let silent = u32::from(lasts_ms > 2_000);
        faults.unless(
            counters.holdovers == silent,
            format!("{name}: {} holdovers", counters.holdovers),
        );
        let moved = play.since(THEN_S * SECOND);
        let moved = moved.map(|sample| (sample.error_ns - error).abs()).max();
        faults.unless(
            moved.is_some_and(|ns| ns <= P99_NS) && frequency <= FREQUENCY_PPB,
            format!("{name}: {moved:?} ns, {frequency:.0} ppb"),
        );
    }
    faults.none();
}

#[test]
fn a_jump_that_is_over_in_less_than_a_second_is_refused() {
    let mut faults = Faults::default();
    for (seed, jump_s) in SEEDS.flat_map(|seed| [-18, -1, 1, 18].map(|s| (seed, s))) {
        let mut scene = scene(seed);
        // Four marks: at 5 Hz the fifth is the first that could agree with four others.
        let until = THEN.plus(790 * MS.unsigned_abs());
        let fault = TimeFault::jump(THEN, jump_s * SECOND).until(until);
        scene.receiver.time_faults.push(fault);
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(THEN_S * SECOND);
        let before = play.board.clock.counters();
        let frequency = play.frequency_until_ppb(THEN_S + 120);
        let counters = play.board.clock.counters();
        let name = format!("{jump_s} s, seed {seed}");
        let refused = counters.outlier + counters.epoch_back;
        faults.unless(
            steps(&counters) == steps(&before) && refused >= 4,
            format!("{name}: {counters:?}"),
        );
        let worst = worst_ns(play.since(THEN_S * SECOND));
        faults.unless(
            worst <= MAX_NS && frequency <= FREQUENCY_PPB,
            format!("{name}: {worst} ns, {frequency:.0} ppb"),
        );
    }
    faults.none();
}

#[test]
fn a_jump_that_stays_is_refused_until_five_marks_agree_and_then_a_counted_step() {
    let mut faults = Faults::default();
    for (seed, jump_s, pulse) in SEEDS.flat_map(|seed| {
        [-18, -1, 1, 18]
            .into_iter()
            .flat_map(move |jump_s| [false, true].map(|pulse| (seed, jump_s, pulse)))
    }) {
        let mut scene = scene(seed);
        let jump = jump_s * SECOND;
        // For two minutes; then the receiver finds out.
        let fault = TimeFault::jump(THEN, jump).until(at_s(720));
        scene.receiver.time_faults.push(fault);
        if pulse {
            scene = scene.with_pulse();
        }
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(THEN_S * SECOND);
        let before = play.board.clock.counters();
        let error = play.board.error_ns();
        let name = format!("{jump_s} s, pulse {pulse}, seed {seed}");
        // No phase of its own is lost under the pulse; the messages' begins anew.
        let near = if pulse { US } else { 10 * MS };

        play.until(THEN_S * SECOND + 700 * MS);
        let alone = play.board.clock.counters();
        faults.unless(
            steps(&alone) == steps(&before) && alone.outlier >= before.outlier + 2,
            format!("{name}: {alone:?}"),
        );
        let moved = (play.board.error_ns() - error).abs();
        faults.unless(
            moved <= P99_NS,
            format!("{name}: {moved} ns before the step"),
        );
        play.until((THEN_S + 2) * SECOND);
        let by_ns = stepped_by(&play, THEN_S);
        faults.unless(
            matches!(by_ns[..], [by_ns] if (by_ns - jump).abs() <= near),
            format!("{name}: stepped by {by_ns:?}"),
        );
        let frequency = play.frequency_until_ppb(THEN_S + 110);
        let off = (play.board.error_ns() - error - jump).abs();
        let settled = if pulse { US } else { MAX_NS };
        faults.unless(
            off <= settled && frequency <= FREQUENCY_PPB,
            format!("{name}: {off} ns off the jump, {frequency:.0} ppb"),
        );

        play.until(722 * SECOND);
        let by_ns = stepped_by(&play, 720);
        faults.unless(
            matches!(by_ns[..], [by_ns] if (by_ns + jump).abs() <= near),
            format!("{name}: stepped back by {by_ns:?}"),
        );
        let frequency = play.frequency_until_ppb(900);
        let worst = worst_ns(play.since(840 * SECOND));
        let worst = if pulse {
            worst_ns(play.utc_since(840 * SECOND))
        } else {
            worst
        };
        faults.unless(
            worst <= settled && frequency <= FREQUENCY_PPB,
            format!("{name}: {worst} ns in the end, {frequency:.0} ppb"),
        );
        let counters = play.board.clock.counters();
        faults.unless(
            steps(&counters) == (before.steps_forward + 1, before.steps_back + 1),
            format!("{name}: {counters:?}"),
        );
    }
    faults.none();
}

#[test]
fn a_jump_of_a_fraction_of_a_second_never_moves_it_faster_than_a_slew() {
    let jumps_ms = [-400, -250, -120, -80, -30, 30, 80, 120, 250, 400];
    let mut faults = Faults::default();
    for (seed, jump_ms) in SEEDS.flat_map(|seed| jumps_ms.map(|ms| (seed, ms))) {
        let mut scene = scene(seed);
        let jump = jump_ms * MS;
        scene.receiver.time_faults.push(TimeFault::jump(THEN, jump));
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(THEN_S * SECOND);
        let before = play.board.clock.counters();
        let name = format!("{jump_ms} ms, seed {seed}");
        play.board.margin_ppb = f64::INFINITY;
        // A single mark, or four, do nothing that a late one would not.
        play.until(THEN_S * SECOND + 800 * MS);
        let moved = worst_ns(play.since(THEN_S * SECOND));
        faults.unless(moved <= MAX_NS, format!("{name}: {moved} ns at once"));
        // Ten minutes to be sure that it is one, and what is left to slew.
        let slewing_s = jump.abs() / i64::from(UtcClock::MAX_SLEW.0) + 1;
        let end_s = THEN_S + slewing_s + 600;
        let frequency = play.frequency_until_ppb(end_s);
        play.pass_s(60);
        let off: Vec<i64> = play
            .since(end_s * SECOND)
            .map(|sample| (sample.error_ns - jump).abs())
            .collect();
        let off = off.into_iter().max().unwrap_or(i64::MAX);
        faults.unless(
            off <= MAX_NS,
            format!("{name}: {off} ns off the receiver in the end"),
        );
        // A slope from the old to the new floor is no crystal's.
        faults.unless(
            frequency <= 100_000.0,
            format!("{name}: {frequency:.0} ppb"),
        );
        let counters = play.board.clock.counters();
        faults.unless(
            counters.steps_forward == before.steps_forward,
            format!("{name}: {counters:?}"),
        );
        let is_odd = |outcome: &Outcome| {
            matches!(
                outcome,
                Outcome::Refused(
                    Refusal::Late | Refusal::Early | Refusal::Outlier | Refusal::Drift
                )
            )
        };
        if jump_ms.abs() > 100 {
            let refused = play.count_marks(THEN_S * SECOND, is_odd);
            faults.unless(refused >= 4, format!("{name}: {refused} refused"));
        }
    }
    faults.none();
}

#[test]
fn a_receiver_that_drifts_away_is_followed_no_farther_than_a_crystal_goes() {
    let mut faults = Faults::default();
    for (seed, ppm, sign) in SEEDS.flat_map(|seed| {
        [1, 10, 100, 500]
            .into_iter()
            .flat_map(move |ppm| [-1, 1].map(|sign| (seed, ppm, sign)))
    }) {
        let mut scene = scene(seed);
        let drift = TimeFault::drift(THEN, sign * ppm * 1_000).until(at_s(1_200));
        scene.receiver.time_faults.push(drift);
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(THEN_S * SECOND);
        let before = play.board.clock.counters();
        play.board.margin_ppb = f64::INFINITY;
        let frequency = play.frequency_until_ppb(1_200);
        let counters = play.board.clock.counters();
        let worst = worst_ns(play.since(THEN_S * SECOND));
        let drifted = i64::from(ppm) * 600 * US;
        let name = format!(
            "{} ppm, seed {seed}: {worst} ns of {drifted}, {frequency:.0} ppb, {} refused",
            sign * ppm,
            counters.drift - before.drift
        );
        let bound = (drifted + MAX_NS).min(BELIEVED_NS);
        faults.unless(worst <= bound, format!("{name}: the phase"));
        let bound_ppb = (f64::from(ppm) * 1e3 + FREQUENCY_PPB).min(BELIEVED_PPB);
        faults.unless(frequency <= bound_ppb, format!("{name}: the frequency"));
        // One that falls behind is late.
        let refused = counters.drift + counters.late - before.drift - before.late;
        if ppm >= 100 {
            faults.unless(refused > 0, format!("{name}: the counter"));
        }
        faults.unless(
            steps(&counters) == steps(&before),
            format!("{name}: stepped"),
        );
        // It comes back, and is believed again.
        play.until(1_800 * SECOND);
        let end = worst_ns(play.since(1_790 * SECOND));
        faults.unless(end <= MAX_NS, format!("{name}: {end} ns in the end"));
    }
    faults.none();
}

#[test]
fn a_receiver_that_drifts_away_with_its_pulse_is_followed_no_farther_either() {
    let mut faults = Faults::default();
    for (seed, ppm) in SEEDS.flat_map(|seed| [1, 10, 100, 500].map(|ppm| (seed, ppm))) {
        let mut scene = scene(seed);
        let drift = TimeFault::drift(THEN, ppm * 1_000);
        scene.receiver.time_faults.push(drift);
        let scene = scene.with_pulse();
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(THEN_S * SECOND);
        let before = play.board.clock.counters();
        let frequency = play.frequency_until_ppb(1_200);
        let counters = play.board.clock.counters();
        let worst = worst_ns(play.utc_since(THEN_S * SECOND));
        let drifted = i64::from(ppm) * 600 * US;
        let refused = counters.pulse_off_line - before.pulse_off_line;
        let name = format!(
            "{ppm} ppm, seed {seed}: {worst} ns of {drifted}, {frequency:.0} ppb, {refused} pulses refused"
        );
        let bound = (drifted + MAX_NS).min(BELIEVED_NS);
        faults.unless(worst <= bound, format!("{name}: the phase"));
        let bound_ppb = (f64::from(ppm) * 1e3 + FREQUENCY_PPB).min(BELIEVED_PPB);
        faults.unless(frequency <= bound_ppb, format!("{name}: the frequency"));
        // A jump of the pulse's frequency beyond what a crystal does in a second.
        if ppm >= 10 {
            faults.unless(refused > 0, format!("{name}: the pulse's counter"));
        }
        if ppm >= 100 {
            faults.unless(
                counters.drift > before.drift,
                format!("{name}: the counter"),
            );
        }
        faults.unless(
            steps(&counters) == steps(&before),
            format!("{name}: stepped"),
        );
    }
    faults.none();
}
