//! The clock on arrival times that real boards logged.
//!
//! *Design.* Each row of a trace is a fix: when it arrived by the board's clock,
//! and its UTC. The board here has the trace's clock, so that its error is the
//! clock's. The invariants of `board-model` demand that no reading goes back and
//! the slew limit holds, through stalls and backlogs, too.
//!
//! *Limits.* The true time is not known: the limits are on how far the clock strays
//! from the receiver's own epochs. Skipped, with a message, where
//! `PIXCLOCK_CAPTURES` is not set.

use board_model::{Board, MS, SECOND};
use comparison::spread::quantile;
use comparison::trace::{Trace, Track};
use host_tests::captures;
use utc_clock::{Counters, Outcome, Refusal, Settings, UtcNanos};

/// 3 653 days: what lifts a trace of 2015 over the earliest date.
const TEN_YEARS: i64 = 3_653 * 86_400 * SECOND;

/// The content of a trace's file, where there are recordings.
fn content(name: &str) -> Option<String> {
    Some(String::from_utf8(captures::file(name)?).expect("text"))
}

/// Rows of (arrival, UTC of the epoch), both in ns, the first arrival at 1 s, with
/// the dates that were recorded.
fn trace(name: &str) -> Option<Vec<(i64, UtcNanos)>> {
    let trace = Trace::parse(&content(name)?).expect("a trace");
    let lifted = trace.lifted_days * 86_400 * SECOND;
    let rows = trace.rows.iter();
    Some(
        rows.map(|row| (row.arrival, UtcNanos(row.utc - lifted)))
            .collect(),
    )
}

/// UTC less the arrival of each row, and the clock's time less the board's after each row.
struct Replay {
    epoch_ns: Vec<i64>,
    clock_ns: Vec<i64>,
    outcomes: Vec<Outcome>,
    counters: Counters,
}

fn run(rows: &[(i64, UtcNanos)]) -> Replay {
    let mut board = Board::new(Settings::DEFAULT, 0.0);
    let mut clock_ns = Vec::new();
    let mut outcomes = Vec::new();
    for (arrival, utc) in rows {
        outcomes.push(board.handle_arrival(*utc, *arrival));
        board.pass_lead();
        clock_ns.push(board.read().utc.0 - board.now_ns);
    }
    Replay {
        epoch_ns: rows.iter().map(|(arrival, utc)| utc.0 - arrival).collect(),
        clock_ns,
        outcomes,
        counters: board.clock.counters(),
    }
}

#[test]
fn a_real_flight_keeps_the_clock_within_the_receivers_own_spread() {
    for name in [
        "traces/frrs_ekf_failure_vehicle_gps_position0.csv",
        "traces/satpulse_f10t-tmode.csv",
        "traces/satpulse_f9p-pvt-out.csv",
        "traces/satpulse_m8t-tmode.csv",
    ] {
        let Some(rows) = trace(name) else { return };
        let run = run(&rows);
        // Those that are so much earlier than the first ones that they might be labels, and one that
        // is later than any jitter.
        let counters = run.counters;
        let off = counters.early + counters.late;
        assert!(
            off <= 2 && counters.refused() == off,
            "{name}: {counters:?}"
        );
        assert_eq!((counters.accepted + off) as usize, rows.len());
        let (least, most) = (run.epoch_ns.iter().min(), run.epoch_ns.iter().max());
        let (least, most) = (*least.expect("rows"), *most.expect("rows"));
        // One mark's slew beyond, at the longest pause between two fixes.
        let pause = rows.windows(2).map(|w| w[1].0 - w[0].0).max();
        let beyond = pause.expect("rows").min(2 * SECOND) / 2_000 + 100;
        for clock in &run.clock_ns {
            assert!((least - beyond..=most + beyond).contains(clock), "{name}");
        }
    }
}

#[test]
fn a_real_stall_of_a_second_and_a_half_leaves_the_clock_where_it_was() {
    let name = "traces-cc-by-sa/dkla_log171_GPS_TimeUS.csv";
    let Some(rows) = trace(name) else { return };
    // Recorded before the earliest date that is believed.
    let refused = run(&rows).counters;
    assert_eq!(refused.too_old as usize, rows.len());
    assert!(rows.iter().all(|(_, utc)| *utc < Settings::DATE_FLOOR));

    let later: Vec<_> = rows
        .iter()
        .map(|(arrival, utc)| (*arrival, UtcNanos(utc.0 + TEN_YEARS)))
        .collect();
    let run = run(&later);
    let counters = run.counters;
    println!("{counters:?}");
    assert_eq!(counters.duplicate_epoch, 1);
    assert!(counters.outlier >= 1, "the stall is 1.56 s");
    assert_eq!((counters.sets, counters.epoch_back), (1, 0));
    // Forward over the lateness of the first marks, and never again.
    assert_eq!(counters.steps_back, 0);
    let settled = later.partition_point(|(arrival, _)| *arrival < later[0].0 + 30 * SECOND);
    let is_step = |outcome: &Outcome| matches!(outcome, Outcome::Stepped { .. });
    assert!(!run.outcomes[settled..].iter().any(is_step));

    // The last mark before the silence may slew it by 1 ms, and the marks that are accepted
    // in the second of the backlog by half of one.
    let stall = run
        .outcomes
        .iter()
        .position(|outcome| matches!(outcome, Outcome::Refused(Refusal::Outlier)))
        .expect("the stall");
    let backlog = later[stall..]
        .iter()
        .take_while(|(arrival, _)| *arrival < later[stall].0 + SECOND)
        .count();
    let moved = run.clock_ns[stall + backlog] - run.clock_ns[stall - 1];
    println!("{moved} ns over the stall and its backlog of {backlog}");
    assert!(moved.abs() <= 3 * MS / 2, "{moved} ns");
}

/// Through the stall the published time, also between the messages, stays as near to the
/// best smooth line as it is in 99 % of the time outside.
#[test]
fn through_a_real_stall_published_time_stays_by_its_line() {
    let name = "traces-cc-by-sa/dkla_log171_GPS_TimeUS.csv";
    let Some(text) = content(name) else { return };
    let trace = Trace::parse(&text).expect("a trace");
    assert_eq!(trace.lifted_days, 3_653, "recorded before 2016");
    let silence = trace
        .rows
        .windows(2)
        .max_by_key(|pair| pair[1].arrival - pair[0].arrival)
        .map(|pair| pair[0].arrival..pair[1].arrival)
        .expect("rows");
    assert!(
        silence.end - silence.start > 2 * SECOND,
        "1.56 s of it late"
    );
    // The backlog and its duplicate come within 0.1 s; a slew takes longer.
    let stall = silence.start..silence.end + 5 * SECOND;

    let replayed = trace.replay();
    assert_eq!(replayed.violation, None);
    let ours = &replayed.tracks[0];
    let (usual, _) = ours.spread().expect("set");
    let off = |ahead: &Option<i64>| ahead.map(|ahead| ahead.abs_diff(usual));
    let moments = || replayed.at.iter().zip(ours.ahead.iter().map(off));
    let within: Vec<u64> = moments()
        .filter(|(at, _)| stall.contains(at))
        .filter_map(|(_, off)| off)
        .collect();
    // The steps of its first seconds would make that an easy measure.
    let settled = replayed.at[0] + 10 * SECOND;
    let mut elsewhere: Vec<u64> = moments()
        .filter(|(at, _)| !stall.contains(at) && **at >= settled)
        .filter_map(|(_, off)| off)
        .collect();
    elsewhere.sort_unstable();
    let p99 = quantile(&elsewhere, 0.99).expect("moments");
    let worst = *within.iter().max().expect("moments");
    println!("{worst} ns at most through the stall, {p99} ns at 99 % elsewhere");
    assert!(
        worst <= p99,
        "{worst} ns through the stall, {p99} ns elsewhere"
    );
}

/// Mean distances from the best smooth line: ours, and the least of the others. \[ns\]
fn means(name: &str) -> Option<(f64, f64)> {
    let trace = Trace::parse(&content(name)?).expect("a trace");
    let replayed = trace.replay();
    assert_eq!(replayed.violation, None, "{name}");
    let mean = |track: &Track| Some(track.spread()?.1.mean);
    let (ours, others) = replayed.tracks.split_first().expect("ours is the first");
    let best = others.iter().filter_map(mean).min_by(f64::total_cmp);
    Some((mean(ours).expect("set"), best.expect("others are set")))
}

#[test]
fn no_other_clock_is_better_where_a_label_or_a_queue_misleads() {
    for name in ["field/k5_lag100ms_2min.csv", "field/d09_one_early.csv"] {
        let Some((ours, best)) = means(name) else {
            return;
        };
        assert!(ours <= 1.1 * best, "{name}: {ours} ns, the best {best} ns");
        assert!(ours < 100e3, "{name}: {ours} ns");
    }
}
