//! The clock among receivers that are late, silent, jump or lie.
//!
//! *Design.* Each scenario runs under the referee of `clock_board`: no reading
//! ever goes back or leaves the slew limit of 500 ppm, except over a step that
//! the clock counts. What is asserted here comes on top of it. The receiver is
//! the M8 as it was measured: a floor, above it half a bell curve with a standard
//! deviation of 6.5 ms within a window of 30 ms, 5 Hz.

use host_tests::clock_board::{Board, MS, SECOND, START, leap_second, mark};
use timebase::{CivilTime, TimeMark};
use utc_clock::gate::EARLIEST;
use utc_clock::{
    CalendarError, ClockState, Counters, Outcome, Published, Refusal, Settings, UtcNanos, calendar,
};

const PERIOD: i64 = 200 * MS;
const FLOOR: i64 = 40 * MS;
const WINDOW: i64 = 30 * MS;
const SIGMA: f64 = 6.5e6;
/// 500 ppm of the time between two marks: the most that one mark can do.
const SLEW_PER_MARK: i64 = PERIOD / 2_000;

/// The M8's latency, seeded.
struct Latency(fastrand::Rng);

impl Latency {
    fn new(seed: u64) -> Self {
        Self(fastrand::Rng::with_seed(seed))
    }

    fn draw(&mut self) -> i64 {
        loop {
            let radius = (-2.0 * (1.0 - self.0.f64()).ln()).sqrt();
            let normal = radius * (std::f64::consts::TAU * self.0.f64()).cos();
            let above = (normal.abs() * SIGMA) as i64;
            if above <= WINDOW {
                return FLOOR + above;
            }
        }
    }
}

fn epoch(number: i64) -> UtcNanos {
    UtcNanos(START.0 + number * PERIOD)
}

/// Marks `from..to` with the receiver's latency.
fn marks(board: &mut Board, latency: &mut Latency, numbers: std::ops::Range<i64>) {
    for number in numbers {
        let arrival = number * PERIOD + latency.draw();
        let outcome = board.hear(epoch(number), arrival);
        assert!(!matches!(outcome, Outcome::Refused(_)), "{outcome:?}");
    }
}

/// A board that has followed a steady receiver for a while, by mark number 50.
fn settled(line: &Published, crystal_ppb: i64) -> Board<'_> {
    let mut board = Board::new(Settings::DEFAULT, crystal_ppb, line);
    for number in 1..50 {
        board.hear(epoch(number), number * PERIOD + FLOOR);
    }
    board
}

#[test]
fn it_tells_the_time_since_boot_until_the_first_good_mark_sets_it() {
    let line = Published::new();
    let mut board = Board::new(Settings::DEFAULT, 0, &line);
    board.pass_until(25 * SECOND);
    let unset = board.read();
    assert_eq!(unset.state, ClockState::Unset);
    assert_eq!(unset.uncertainty_ns, u32::MAX);
    assert!((unset.utc.0 - 25 * SECOND).abs() <= 25);

    let outcome = board.hear(epoch(125), 25 * SECOND + FLOOR);
    assert_eq!(outcome, Outcome::Set);
    board.pass_lead();
    let set = board.read();
    assert_eq!(set.state, ClockState::Set);
    assert!(set.leap_seconds_known);
    // Nothing is known of the latency, so the clock is late by it, and says so.
    assert!((board.error_ns() + FLOOR).abs() <= 10);
    assert!(i64::from(set.uncertainty_ns) >= FLOOR);
    let expected = Counters {
        accepted: 1,
        sets: 1,
        ..Counters::default()
    };
    assert_eq!(board.clock.counters(), expected);
}

#[test]
fn a_known_latency_is_taken_off() {
    let settings = Settings {
        latency_ns: 40_000_000,
        latency_doubt_ns: 5_000_000,
        ..Settings::DEFAULT
    };
    let line = Published::new();
    let mut board = Board::new(settings, 0, &line);
    board.hear(epoch(1), PERIOD + FLOOR);
    board.pass_lead();
    assert!(board.error_ns().abs() <= 10);
    assert!((5_000_000..5_002_000).contains(&board.read().uncertainty_ns));
}

#[test]
fn it_follows_an_m8_within_the_receivers_own_lateness() {
    for seed in 0..5 {
        for crystal_ppb in [-50_000, 0, 44_000] {
            let line = Published::new();
            let mut board = Board::new(Settings::DEFAULT, crystal_ppb, &line);
            marks(&mut board, &mut Latency::new(seed), 1..3_000);
            let counters = board.clock.counters();
            assert_eq!((counters.sets, counters.accepted), (1, 2_999));
            assert_eq!((counters.refused(), counters.holdovers), (0, 0));
            // As late as the receiver is, neither more nor less, but for what
            // one mark can do, and the crystal between two of them.
            let beyond = SLEW_PER_MARK + PERIOD / 20_000;
            for error in &board.errors_ns {
                assert!(
                    (-(FLOOR + WINDOW) - beyond..=-FLOOR + beyond).contains(error),
                    "seed {seed}, {crystal_ppb} ppb: {error} ns"
                );
            }
            // Latency unknown: 120 ms are allowed for it, and they suffice.
            let reading = board.read();
            assert!(board.error_ns().unsigned_abs() <= u64::from(reading.uncertainty_ns));
        }
    }
}

#[test]
fn a_late_first_mark_is_worked_off_at_500_ppm() {
    let line = Published::new();
    let mut board = Board::new(Settings::DEFAULT, 0, &line);
    let late = 100 * MS;
    board.hear(epoch(1), PERIOD + FLOOR + late);
    let set_at = board.now_ns;
    // 100 ms at 500 ppm are 200 s; 1 ms a second of it is the time constant's.
    let mut number = 3;
    while board.now_ns < set_at + 190 * SECOND {
        board.hear(epoch(number), number * PERIOD + FLOOR);
        number += 1;
    }
    assert!(
        board.error_ns() + FLOOR < -4 * MS,
        "no faster than 500 ppm allow"
    );
    while board.now_ns < set_at + 206 * SECOND {
        board.hear(epoch(number), number * PERIOD + FLOOR);
        number += 1;
    }
    let left = board.error_ns() + FLOOR;
    assert!(left.abs() <= MS / 10, "{left} ns are left");
}

#[test]
fn one_late_mark_before_silence_moves_the_clock_by_a_millisecond_at_most() {
    let line = Published::new();
    let mut board = settled(&line, 0);
    let before = board.error_ns();
    board.hear(epoch(50), 50 * PERIOD + FLOOR + 400 * MS);
    board.pass_until(board.now_ns + 60 * SECOND);
    let moved = before - board.error_ns();
    assert!(
        (MS * 9 / 10..=MS * 101 / 100).contains(&moved),
        "{moved} ns"
    );
}

/// The trace of a real Pixhawk has it: 1.56 s late, then a flush of the backlog
/// and a duplicate.
#[test]
fn a_stall_and_its_backlog_leave_the_clock_where_it_was() {
    let line = Published::new();
    let mut board = settled(&line, 0);
    let before = board.error_ns();
    let flush = 50 * PERIOD + FLOOR + 1_560 * MS;
    for i in 0..8 {
        // Back to back on the wire.
        board.hear(epoch(50 + i), flush + i * 8_700_000);
    }
    let again = board.hear(epoch(57), flush + 8 * 8_700_000);
    assert_eq!(again, Outcome::Refused(Refusal::DuplicateEpoch));
    for number in 58..70 {
        board.hear(epoch(number), number * PERIOD + FLOOR + 75 * MS / 1_000);
    }
    let counters = board.clock.counters();
    // Late by 1.56, 1.37, 1.18, 0.99, 0.80 and 0.60 s.
    assert_eq!(counters.outlier, 6);
    assert_eq!(counters.duplicate_epoch, 1);
    assert_eq!((counters.steps_back, counters.steps_forward), (0, 0));
    // Two of the backlog were within half a second: each for one frame's time.
    let moved = board.error_ns() - before;
    assert!(moved.abs() <= SLEW_PER_MARK, "{moved} ns");
}

#[test]
fn an_hour_of_silence_is_holdover_at_the_crystals_rate() {
    let crystal_ppb = 44_000;
    let line = Published::new();
    let mut board = settled(&line, crystal_ppb);
    let heard = 49 * PERIOD + FLOOR;
    board.pass_until(heard + 1_999 * MS);
    assert_eq!(board.read().state, ClockState::Set);
    board.pass_until(heard + 2_003 * MS);
    let lost = board.read();
    assert_eq!(lost.state, ClockState::Holdover);
    let (began, error) = (board.now_ns, board.error_ns());

    board.read_every_ns = 100 * MS;
    let mut width = lost.uncertainty_ns;
    for minute in 1..=60 {
        board.pass_until(began + minute * 60 * SECOND);
        let reading = board.read();
        let grown = i64::from(reading.uncertainty_ns - width);
        // 50 ppm of a minute by this crystal, and a few ns for the rounding up.
        assert!((3 * MS..=3 * MS + 150).contains(&grown), "{grown} ns");
        width = reading.uncertainty_ns;
        let drifted = board.error_ns() - error;
        let expected = crystal_ppb * 60 * minute;
        assert!((drifted - expected).abs() <= 2_000, "minute {minute}");
        assert!(board.error_ns().unsigned_abs() <= u64::from(width));
    }

    // 158 ms ahead by now: no step, the clock slews back.
    let number = board.now_ns / PERIOD + 1;
    let outcome = board.hear(epoch(number), number * PERIOD + FLOOR);
    assert!(matches!(outcome, Outcome::Slewed { error_ns } if error_ns < -150_000_000));
    board.pass_lead();
    assert_eq!(board.read().state, ClockState::Set);
    assert_eq!(board.clock.counters().holdovers, 1);
}

#[test]
fn one_jump_is_refused_and_five_that_agree_are_a_counted_step() {
    for jump in [SECOND, -SECOND, 18 * SECOND, -18 * SECOND, 3_600 * SECOND] {
        let line = Published::new();
        let mut board = settled(&line, 0);
        let error = board.error_ns();
        // One mark that jumps alone; a jump back refuses its successor, too.
        board.hear(UtcNanos(epoch(50).0 + jump), 50 * PERIOD + FLOOR);
        for number in 51..55 {
            board.hear(epoch(number), number * PERIOD + FLOOR);
        }
        let alone = board.clock.counters();
        assert_eq!((alone.steps_forward, alone.steps_back), (0, 0));
        assert!((board.error_ns() - error).abs() <= 100, "jump {jump}");

        // Then the receiver jumps and stays there.
        let mut stepped = Vec::new();
        let mut refused = 0;
        for number in 55..70 {
            let told = UtcNanos(epoch(number).0 + jump);
            match board.hear(told, number * PERIOD + FLOOR) {
                Outcome::Stepped { by_ns } => stepped.push((number, by_ns)),
                Outcome::Refused(_) => refused += 1,
                Outcome::Slewed { .. } => assert!(!stepped.is_empty()),
                Outcome::Set => panic!("set twice"),
            }
        }
        let [(number, by_ns)] = stepped[..] else {
            panic!("stepped {stepped:?}");
        };
        // Going back, the first is refused as an epoch before the last.
        let first = if jump > 0 { 55 } else { 56 };
        assert_eq!(number, first + 4);
        assert_eq!(refused, number - 55);
        assert!((by_ns - jump).abs() <= 1_000);
        board.pass_lead();
        assert!((board.error_ns() - error - jump).abs() <= 1_000);
        let counters = board.clock.counters();
        let expected = if jump > 0 { (1, 0) } else { (0, 1) };
        assert_eq!((counters.steps_forward, counters.steps_back), expected);
    }
}

#[test]
fn a_leap_second_is_sat_out_and_then_stepped_over_in_the_open() {
    // 2026-12-31 does not have one; the receiver says it has.
    let midnight = calendar::to_utc(&CivilTime {
        year: 2027,
        month: 1,
        day: 1,
        hour: 0,
        minute: 0,
        second: 0,
        nano: 0,
    })
    .unwrap();
    let line = Published::new();
    let mut board = Board::new(Settings::DEFAULT, 0, &line);
    let mut outcomes = Vec::new();
    // From 2 s before the leap second to 4 s after it.
    for number in 0..35_i64 {
        let since = (number - 10) * PERIOD;
        let mut heard: TimeMark = mark(UtcNanos(midnight.0 + since));
        if (0..SECOND).contains(&since) {
            heard.epoch = leap_second((2026, 12, 31), i32::try_from(since).unwrap());
        } else if since >= SECOND {
            heard = mark(UtcNanos(midnight.0 + since - SECOND));
        }
        outcomes.push(board.hear_mark(heard, number * PERIOD + FLOOR));
    }
    assert_eq!(outcomes[0], Outcome::Set);
    for (i, outcome) in outcomes.iter().enumerate().skip(1) {
        let expected = match i {
            10..15 => matches!(outcome, Outcome::Refused(Refusal::LeapSecond)),
            15..19 => matches!(outcome, Outcome::Refused(Refusal::Outlier)),
            19 => matches!(outcome, Outcome::Stepped { by_ns } if (by_ns + SECOND).abs() < 1_000),
            _ => matches!(outcome, Outcome::Slewed { error_ns } if error_ns.abs() < 1_000),
        };
        assert!(expected, "{i}: {outcome:?}");
    }
    assert_eq!(board.clock.counters().steps_back, 1);
}

#[test]
fn a_clock_is_not_set_in_a_leap_second() {
    let line = Published::new();
    let mut board = Board::new(Settings::DEFAULT, 0, &line);
    let mut heard = mark(START);
    heard.epoch = leap_second((2026, 12, 31), 0);
    let outcome = board.hear_mark(heard, FLOOR);
    assert_eq!(outcome, Outcome::Refused(Refusal::LeapSecond));
    assert_eq!(board.read().state, ClockState::Unset);
}

#[test]
fn each_kind_of_bad_mark_is_counted_and_costs_no_good_one() {
    let line = Published::new();
    let mut board = settled(&line, 0);
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
            |m| m.epoch = calendar::from_utc(UtcNanos(EARLIEST.0 - 1)).unwrap(),
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
        let outcome = board.hear_mark(bad, number * PERIOD + FLOOR);
        assert_eq!(outcome, Outcome::Refused(refusal));
        let good = board.hear(epoch(number + 1), (number + 1) * PERIOD + FLOOR);
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
    let line = Published::new();
    let mut board = settled(&line, 0);
    let now = board.cycles(board.now_ns);
    for arrival in [now.0 + 1, now.0.wrapping_sub(11 * 168_000_000), u64::MAX] {
        let mut heard = mark(epoch(60));
        heard.arrival = timebase::Cycles(arrival);
        let outcome = board.clock.handle_mark(&heard, now);
        assert_eq!(outcome, Outcome::Refused(Refusal::Stamp));
    }
    assert_eq!(board.clock.counters().stamp, 3);
}

#[test]
fn leap_seconds_that_nobody_confirmed_show_until_they_are() {
    let line = Published::new();
    let mut board = Board::new(Settings::DEFAULT, 0, &line);
    for number in 1..20 {
        let mut heard = mark(epoch(number));
        heard.validity.leap_seconds_known = number >= 10;
        let outcome = board.hear_mark(heard, number * PERIOD + FLOOR);
        assert!(!matches!(outcome, Outcome::Refused(_)));
        board.pass_lead();
        assert_eq!(board.read().leap_seconds_known, number >= 10);
    }
}
