//! The clock under marks and calls that nobody would think of.
//!
//! *Design.* Random marks (from good ones to fields of any value), silences,
//! late timers and stamps of any age, in any order. The referee of `clock_board`
//! demands that readings increase and the slew limit holds; here it is added
//! that a stamp's answer never changes while it may be asked for.

use host_tests::clock_board::{Board, FRAME_NS, MS, SECOND, START, mark};
use proptest::prelude::*;
use timebase::{CORE_HZ, CivilTime, Cycles, TimeMark, Validity};
use utc_clock::{Published, Settings, UtcClock, UtcNanos};

#[derive(Clone, Debug)]
enum Event {
    /// Time passes.
    Pass { ns: i64 },
    /// A mark that is as good as they come, so late and off by so much.
    Good { late_ns: i64, off_ns: i64 },
    /// A mark with any fields.
    Any(Box<TimeMark>),
}

fn any_mark() -> impl Strategy<Value = TimeMark> {
    let civil = (
        prop_oneof![1970..2110_u16, any::<u16>()],
        0..14_u8,
        0..33_u8,
        0..25_u8,
        0..62_u8,
        0..63_u8,
        prop_oneof![-5_000_000..995_000_000_i32, any::<i32>()],
    );
    let arrival = prop_oneof![0..100 * u64::from(CORE_HZ), any::<u64>()];
    let claims = prop::array::uniform5(prop::bool::weighted(0.9));
    (
        arrival,
        civil,
        prop_oneof![0..200_000_u32, any::<u32>()],
        claims,
    )
        .prop_map(
            |(arrival, (year, month, day, hour, minute, second, nano), t_acc_ns, claims)| {
                TimeMark {
                    arrival: Cycles(arrival),
                    epoch: CivilTime {
                        year,
                        month,
                        day,
                        hour,
                        minute,
                        second,
                        nano,
                    },
                    t_acc_ns,
                    validity: Validity {
                        date: claims[0],
                        time: claims[1],
                        fully_resolved: claims[2],
                        confirmed: claims[3],
                        leap_seconds_known: claims[4],
                    },
                }
            },
        )
}

fn event() -> impl Strategy<Value = Event> {
    let off = prop_oneof![
        6 => Just(0),
        2 => -400 * MS..400 * MS,
        1 => -2 * SECOND..2 * SECOND,
        1 => Just(SECOND),
    ];
    prop_oneof![
        3 => (0..300 * MS).prop_map(|ns| Event::Pass { ns }),
        1 => (0..40 * SECOND).prop_map(|ns| Event::Pass { ns }),
        8 => (0..200 * MS, off).prop_map(|(late_ns, off_ns)| Event::Good { late_ns, off_ns }),
        1 => any_mark().prop_map(|mark| Event::Any(Box::new(mark))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn readings_increase_whatever_comes(
        events in prop::collection::vec(event(), 1..120),
        crystal_ppb in -2_000_000..2_000_000_i64,
    ) {
        let line = Published::new();
        let mut board = Board::new(Settings::DEFAULT, crystal_ppb, &line);
        board.read_every_ns = 7 * MS;
        for event in events {
            let heard = match event {
                Event::Pass { ns } => {
                    board.pass_until(board.now_ns + ns);
                    continue;
                }
                Event::Good { late_ns, off_ns } => {
                    let epoch = UtcNanos(board.truth().0 + off_ns);
                    let arrival = board.cycles(board.now_ns + late_ns);
                    board.pass_until(board.now_ns + late_ns);
                    TimeMark { arrival, ..mark(epoch) }
                }
                Event::Any(heard) => *heard,
            };
            board.pass_until(board.now_ns + FRAME_NS);
            // A stamp that was taken and answered before the mark is answered in
            // the same way after it, be it that the mark sets or steps the clock.
            let now = board.cycles(board.now_ns);
            let stamps = [0, 1, 100_000, 800_000].map(|age| Cycles(now.0 - age));
            let before = stamps.map(|when| board.line.reading_at(when));
            let outcome = board.handle(&heard);
            let after = stamps.map(|when| board.line.reading_at(when));
            prop_assert_eq!(before, after, "{:?}", outcome);
        }
    }

    #[test]
    fn no_mark_at_all_makes_it_panic(
        marks in prop::collection::vec((any_mark(), any::<u64>()), 1..200),
    ) {
        // Not even with a clock that jumps.
        let line = Published::new();
        let mut clock = UtcClock::new(Settings::DEFAULT, &line);
        for (mark, now) in marks {
            clock.handle_mark(&mark, Cycles(now));
            clock.handle_timeout(Cycles(now));
            for when in [now, mark.arrival.0, 0, u64::MAX] {
                let reading = clock.model().reading_at(Cycles(when));
                prop_assert!(!reading.utc.to_string().is_empty());
            }
        }
    }

    #[test]
    fn a_mark_that_is_late_drags_it_no_farther_than_the_slew_limit(
        late_ms in proptest::collection::vec(0..450_i64, 1..50),
    ) {
        let line = Published::new();
        let mut board = Board::new(Settings::DEFAULT, 0, &line);
        board.hear(START, 0);
        board.pass_lead();
        for (number, late) in (1..).zip(late_ms) {
            let before = board.error_ns();
            let began = board.now_ns;
            board.hear(UtcNanos(START.0 + number * 500 * MS), number * 500 * MS + late * MS);
            let moved = (board.error_ns() - before).abs();
            prop_assert!(moved <= (board.now_ns - began) / 2_000 + 2);
        }
    }
}
