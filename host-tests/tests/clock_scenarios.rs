//! The clock and single marks: those that set it, those that are bad, leap seconds.
//!
//! *Design.* Each scenario is under the invariants of `board-model`: no reading goes back or
//! leaves the slew limit, except over a step that the clock reports. The tests check the rest.
//! The receiver is more even than any real one, so that every ns is accounted for; those with
//! jitter are in `clock_following`, `clock_refusals`, `clock_holdover` and `clock_pulse`.

use board_model::{Board, MS, SECOND, START, good_mark, leap_seconds};
use timebase::{CivilTime, Cycles, LeapEvent, LeapSeconds, TimeMark};
use utc_clock::{CalendarError, ClockState, Counters, Outcome, Refusal, Settings, UtcNanos};

const PERIOD: i64 = 200 * MS;
const FLOOR: i64 = 40 * MS;

fn epoch(number: i64) -> UtcNanos {
    UtcNanos(START.0 + number * PERIOD)
}

/// A good mark; its arrival is filled in later.
fn mark(epoch: UtcNanos) -> TimeMark {
    good_mark(Cycles::BOOT, epoch).expect("an epoch of this century")
}

/// An instant within a leap second at the end of 2026, `nano` ns after its start.
const fn leap_second(nano: i32) -> CivilTime {
    CivilTime {
        year: 2026,
        month: 12,
        day: 31,
        hour: 23,
        minute: 59,
        second: 60,
        nano,
    }
}

/// A board that has followed a steady receiver for a while, by mark number 50.
fn settled() -> Board {
    let mut board = Board::new(Settings::DEFAULT, 0.0);
    for number in 1..50 {
        board.handle_arrival(epoch(number), number * PERIOD + FLOOR);
    }
    board
}

#[test]
fn it_reads_the_time_since_boot_until_the_first_good_mark_sets_it() {
    let mut board = Board::new(Settings::DEFAULT, 0.0);
    board.pass_until(25 * SECOND);
    let unset = board.read();
    assert_eq!(unset.state, ClockState::Unset);
    assert_eq!(unset.uncertainty_ns, u64::MAX);
    assert!((unset.utc.0 - 25 * SECOND).abs() <= 25);

    let outcome = board.handle_arrival(epoch(125), 25 * SECOND + FLOOR);
    assert_eq!(outcome, Outcome::Set);
    board.pass_lead();
    let first = board.read();
    // A mark alone does not say which second it is: all leap seconds there were are between.
    assert_eq!(first.state, ClockState::Unproved);
    assert!(first.uncertainty_ns > 18 * SECOND.unsigned_abs());
    assert!(first.leap_seconds_known);
    // The latency is not known: the clock is late by it, and its uncertainty covers that.
    assert!((board.error_ns() + FLOOR).abs() <= 10);
    for number in 126..131 {
        board.handle_arrival(epoch(number), number * PERIOD + FLOOR);
    }
    board.pass_lead();
    let set = board.read();
    assert_eq!(set.state, ClockState::Set);
    assert!((FLOOR..SECOND).contains(&set.uncertainty_ns.cast_signed()));
    let expected = Counters {
        accepted: 6,
        sets: 1,
        ..Counters::default()
    };
    assert_eq!(board.clock.counters(), expected);
}

#[test]
fn a_known_latency_is_taken_off() {
    let settings = Settings::DEFAULT.with_latency_ns(40_000_000);
    let mut board = Board::new(settings, 0.0);
    board.handle_arrival(epoch(1), PERIOD + FLOOR);
    board.pass_lead();
    assert!(board.error_ns().abs() <= 10);
    // A single mark may be as late as any that was measured.
    assert!(board.read().uncertainty_ns >= 10_000_000 + 91_000_000);
    for number in 2..300 {
        board.handle_arrival(epoch(number), number * PERIOD + FLOOR);
    }
    assert!(board.error_ns().abs() <= 10);
    // The uncertainty of a latency that was set is 10 ms, as of one that was learnt; the rest
    // is less than 1 ms.
    assert!((10_000_000..11_000_000).contains(&board.read().uncertainty_ns));
}

/// Marks at 5 Hz from 10 s before a leap second to 30 s after it, as a receiver sends them, and what
/// each did; `announce` is done with the first.
fn over_a_leap_second(board: &mut Board, announce: impl FnOnce(&mut Board)) -> Vec<(i64, Outcome)> {
    let midnight = UtcNanos::from_civil(&CivilTime {
        year: 2027,
        month: 1,
        day: 1,
        hour: 0,
        minute: 0,
        second: 0,
        nano: 0,
    })
    .expect("a time of this century");
    announce(board);
    let marks = (0..200_i64).map(|number| {
        let since = number * PERIOD - 10 * SECOND;
        let mut received: TimeMark = mark(UtcNanos(midnight.0 + since));
        if (0..SECOND).contains(&since) {
            received.epoch = leap_second(i32::try_from(since).expect("less than a second"));
        } else if since >= SECOND {
            received = mark(UtcNanos(midnight.0 + since - SECOND));
        }
        let outcome = board.handle_mark_at(received, number * PERIOD + FLOOR);
        (since, outcome)
    });
    marks.collect()
}

#[test]
fn a_leap_second_that_was_announced_is_stepped_over_when_it_is_over() {
    // Receivers differ by a second in how far away it is.
    for in_s in [9, 10, 11] {
        let mut board = Board::new(Settings::DEFAULT, 0.0);
        let outcomes = over_a_leap_second(&mut board, |board| {
            let received = LeapSeconds {
                event: Some(LeapEvent { change: 1, in_s }),
                ..leap_seconds(Cycles::BOOT)
            };
            board.clock.handle_leap_seconds(&received, Cycles::BOOT);
        });
        for (since, outcome) in &outcomes[1..] {
            let expected = match since {
                0..SECOND => matches!(outcome, Outcome::Refused(Refusal::LeapSecond)),
                _ => matches!(outcome, Outcome::Slewed { error_ns } if error_ns.abs() < 1_000),
            };
            assert!(expected, "{since} ns, announced {in_s} s: {outcome:?}");
        }
        assert_eq!(board.clock.counters().steps_back, 1);
        assert_eq!(board.read().state, ClockState::Set);
    }
}

#[test]
fn one_that_was_not_is_a_second_in_doubt_and_no_step() {
    // 2026-12-31 has none, but the receiver sends one.
    let mut board = Board::new(Settings::DEFAULT, 0.0);
    let outcomes = over_a_leap_second(&mut board, |_| ());
    for (since, outcome) in &outcomes {
        if *since >= SECOND {
            assert_eq!(*outcome, Outcome::Refused(Refusal::Outlier), "{since} ns");
        }
    }
    let counters = board.clock.counters();
    assert_eq!((counters.steps_forward, counters.steps_back), (0, 0));
    let reading = board.read();
    assert_eq!(reading.state, ClockState::Unproved);
    assert!(reading.uncertainty_ns > SECOND.unsigned_abs());
    // NAV-TIMELS is asked about it.
    let now = board.cycles(board.now_ns);
    assert!(board.clock.poll_leap_seconds(now));
}

#[test]
fn a_clock_is_not_set_in_a_leap_second() {
    let mut board = Board::new(Settings::DEFAULT, 0.0);
    let mut received = mark(START);
    received.epoch = leap_second(0);
    let outcome = board.handle_mark_at(received, FLOOR);
    assert_eq!(outcome, Outcome::Refused(Refusal::LeapSecond));
    assert_eq!(board.read().state, ClockState::Unset);
}

#[test]
fn each_kind_of_bad_mark_is_counted_and_costs_no_good_one() {
    let mut board = settled();
    let error = board.error_ns();
    let accepted = board.clock.counters().accepted;
    type Spoil = fn(&mut TimeMark);
    let spoils: [(Spoil, Refusal); 9] = [
        (|m| m.validity.date = false, Refusal::Date),
        (|m| m.validity.time = false, Refusal::Time),
        (|m| m.validity.fully_resolved = false, Refusal::Unresolved),
        (|m| m.t_acc_ns = u32::MAX, Refusal::Inaccurate),
        (|m| m.t_acc_ns = 100_001, Refusal::Inaccurate),
        (
            |m| m.epoch.month = 13,
            Refusal::Calendar(CalendarError::Month(13)),
        ),
        (
            |m| m.epoch.second = 61,
            Refusal::Calendar(CalendarError::Second(61)),
        ),
        (
            |m| m.epoch = UtcNanos(Settings::DATE_FLOOR.0 - 1).to_civil().unwrap(),
            Refusal::TooOld,
        ),
        (
            |m| m.epoch.year = 2101,
            Refusal::Calendar(CalendarError::Year(2101)),
        ),
    ];
    for (i, (spoil, refusal)) in (0..).zip(spoils) {
        let number = 50 + 2 * i;
        let mut bad = mark(epoch(number));
        spoil(&mut bad);
        let outcome = board.handle_mark_at(bad, number * PERIOD + FLOOR);
        assert_eq!(outcome, Outcome::Refused(refusal));
        let good = board.handle_arrival(epoch(number + 1), (number + 1) * PERIOD + FLOOR);
        assert!(matches!(good, Outcome::Slewed { error_ns } if error_ns.abs() <= 100));
    }
    let counters = board.clock.counters();
    assert_eq!(counters.accepted, accepted + 9);
    assert_eq!(counters.refused(), 9);
    assert_eq!(
        (counters.date, counters.time, counters.unresolved),
        (1, 1, 1)
    );
    assert_eq!((counters.inaccurate, counters.calendar), (2, 3));
    assert_eq!(counters.too_old, 1);
    assert!((board.error_ns() - error).abs() <= 100);
}

#[test]
fn a_stamp_from_the_future_or_from_long_ago_is_refused() {
    let mut board = settled();
    let now = board.cycles(board.now_ns);
    for arrival in [now.0 + 1, now.0.wrapping_sub(11 * 168_000_000), u64::MAX] {
        let mut received = mark(epoch(60));
        received.arrival = Cycles(arrival);
        let outcome = board.clock.handle_mark(&received, now);
        assert_eq!(outcome, Outcome::Refused(Refusal::Stamp));
    }
    assert_eq!(board.clock.counters().stamp, 3);
}

#[test]
fn a_backlog_flushed_at_once_takes_no_reading_back() {
    // Six marks that arrived in time and are handled late, within 1 ms: a timeline of three
    // models takes two of them at most. The invariants check the readings.
    let mut board = settled();
    let before = board.clock.counters();
    let first_ns = board.now_ns / (200 * MS) * (200 * MS) + 200 * MS;
    board.pass_until(first_ns + 6 * 200 * MS);
    let stamps = [0, 100, 900].map(|age_us| board.cycles(board.now_ns - age_us * 1_000));
    for number in 0..6 {
        let due_ns = first_ns + number * 200 * MS;
        let mut received = mark(UtcNanos(START.0 + due_ns));
        received.arrival = board.cycles(due_ns + 40 * MS);
        let before_it = stamps.map(|when| board.timeline.reading_at(when));
        board.handle_mark(&received);
        assert_eq!(
            before_it,
            stamps.map(|when| board.timeline.reading_at(when))
        );
    }
    board.read_every_ns = Some(10_000);
    board.pass_until(board.now_ns + 5 * MS);
    let after = board.clock.counters();
    assert_eq!(after.accepted - before.accepted, 2);
    assert_eq!(after.backlog - before.backlog, 4);
}

#[test]
fn a_count_of_leap_seconds_shows_as_unconfirmed_until_it_is() {
    let mut board = Board::new(Settings::DEFAULT, 0.0);
    for number in 1..20 {
        let mut received = mark(epoch(number));
        received.validity.leap_seconds_known = number >= 10;
        let outcome = board.handle_mark_at(received, number * PERIOD + FLOOR);
        assert!(!matches!(outcome, Outcome::Refused(_)));
        board.pass_lead();
        assert_eq!(board.read().leap_seconds_known, number >= 10);
    }
}
