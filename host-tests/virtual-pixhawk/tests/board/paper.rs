//! The paper's variants: each boots with its priorities and its tick, answers in whole ticks, sets its
//! clock at every NAV-PVT, and is late by the frame's time on the wire and its wait.
//!
//! The bounds are the flow's own arithmetic: a poll sees bytes within a ms, the wait is what PX4
//! 1.9 or the paper says, in NuttX's whole ticks.

use std::collections::BTreeSet;

use console::Status;
use mavlink_node::Version;
use paper_clock::wakes_at;
use timebase::Cycles;
use utc_clock::ClockState;
use variant::Variant;
use virtual_pixhawk::{Builder, Connector, Firmware, Logged, Pixhawk, Script};
use world::{Latency, Port, Receiver, ReceiverSettings, Stall, WorldNanos};

use crate::common::{MS, SECOND, START_UTC_NS, ping_answers, pings, receiver_settings};

/// Bytes of a NAV-PVT on the wire.
const FRAME_BYTES: u64 = 100;
/// PX4 looks for bytes once a ms.
const POLL_NS: i64 = MS.cast_signed();
/// What parsing takes, and a reading from outside may be off, at most.
const HANDLING_NS: i64 = 100_000;
/// SysTick's exception number.
const SYSTICK: u16 = 15;

/// One of the paper's ways on a line.
#[derive(Clone, Copy, Debug)]
struct Case {
    variant: Variant,
    gps_baud: u32,
    /// The wait between poll and read, in µs.
    wait_us: u32,
    /// The priorities of SysTick and of every other interrupt.
    priorities: (&'static str, &'static str),
}

const DEFAULT: Case = Case {
    variant: Variant::PaperDefault,
    gps_baud: 115_200,
    wait_us: 2_777,
    priorities: ("0x80", "0x80"),
};
const DEFAULT_AT_38400: Case = Case {
    gps_baud: 38_400,
    wait_us: 8_333,
    ..DEFAULT
};
const STEP_1: Case = Case {
    variant: Variant::PaperStep1,
    wait_us: 5_000,
    ..DEFAULT
};

const fn step_2(tick_us: u32) -> Case {
    Case {
        variant: Variant::PaperStep2 { tick_us },
        priorities: ("0x00", "0x80"),
        ..STEP_1
    }
}

const TICK_ONLY: Case = Case {
    variant: Variant::PaperTickOnly { tick_us: 50 },
    ..STEP_1
};

const CASES: [Case; 7] = [
    DEFAULT,
    DEFAULT_AT_38400,
    STEP_1,
    step_2(500),
    step_2(200),
    step_2(50),
    TICK_ONLY,
];

/// After this time the default has searched the receiver's rate: 115200 is the fourth of PX4's *Auto*, and each has
/// 2 s.
const FOUND_NS: u64 = 8 * SECOND;

impl Case {
    /// The image that `cargo xtask board-test` hands over; `None` if the test has to be skipped,
    /// which has been printed.
    fn image(&self) -> Option<Firmware> {
        let name = self
            .variant
            .to_string()
            .to_uppercase()
            .replace(['-', ':'], "_");
        let ending = if self.gps_baud == 38_400 {
            "_38400BD"
        } else {
            ""
        };
        let variable = format!("PIXCLOCK_IMAGE_{name}{ending}");
        Firmware::from_variable(&variable).expect("the image can be read")
    }

    fn tick_ns(&self) -> i64 {
        i64::from(self.variant.tick_us()) * 1_000
    }

    /// The wait and all that NuttX makes of it, in ns.
    fn longest_wait_ns(&self) -> i64 {
        let wakes_at = wakes_at(Cycles::BOOT, self.wait_us, self.variant.tick_us() * 168);
        wakes_at.as_nanos().cast_signed()
    }

    fn frame_ns(&self) -> i64 {
        (FRAME_BYTES * 10 * SECOND / u64::from(self.gps_baud)).cast_signed()
    }
}

/// A receiver like an M8, with a way of its own at each seed, at the case's rate.
fn m8(seed: u64, case: &Case) -> ReceiverSettings {
    ReceiverSettings {
        seed,
        latency: Latency::m8(),
        port: Port {
            baud: case.gps_baud,
            ..Port::FACTORY
        },
        ..receiver_settings()
    }
}

fn power_on(firmware: Firmware, receiver: &ReceiverSettings, asked_at: &[WorldNanos]) -> Pixhawk {
    Builder::new(firmware)
        .crystal_ppb(37_000)
        .gps(Receiver::new(receiver.clone()))
        .telem1(Script::new(pings(Version::V2, asked_at.iter().copied())))
        .power_on()
        .unwrap()
}

fn last_status(log: &[Logged]) -> Status {
    let statuses = log.iter().map(|logged| Status::parse(&logged.line.text));
    statuses.flatten().last().expect("a status line")
}

#[test]
fn each_says_what_it_is_and_has_its_priorities_and_its_tick() {
    for case in CASES {
        let Some(firmware) = case.image() else { return };
        let mut board = power_on(firmware, &m8(0, &case), &[]);
        board
            .run_to(WorldNanos(FOUND_NS + 5 * SECOND + 500 * MS))
            .unwrap();
        let log = board.take_log().unwrap();
        let (name, tick_us) = (case.variant.name(), case.variant.tick_us());
        let first = format!("variant {name}, tick {tick_us} us");
        assert!(log[0].line.text.contains(&first), "{:?}", log[0]);
        let (tick, other) = case.priorities;
        let priorities = format!(
            "priorities: SysTick {tick}, PendSV {other}, UART4 {other}, USART2 {other}, TIM4 {other}, tasks 0x90 and 0xa0"
        );
        let says = |text: &str| log.iter().any(|logged| logged.line.text == text);
        assert!(says(&priorities), "{priorities}");

        let status = last_status(&log);
        assert_eq!(status.get("variant"), Some(name));
        // Such a clock proves nothing.
        assert_eq!(status.state(), Some(ClockState::Unproved), "{case:?}");
        for never in [
            "lost_ticks",
            "gps_overrun",
            "mav_overrun",
            "gps_incoming_full",
        ] {
            assert!(
                status.number(never).unwrap_or(0) == 0,
                "{case:?}: {status:?}"
            );
        }
        let claimed_s = board.clock().unwrap().reading.uncertainty_ns / SECOND;
        assert_eq!(claimed_s, 1_024 * 7 * 86_400);

        board.start_meter(&[]).unwrap();
        board.run_for(SECOND).unwrap();
        let ticks = board.stop_meter().exceptions[&SYSTICK].times;
        // The crystal makes 37 ppm more, and the meter may miss one at either end.
        let expected = 1_000_000 / u64::from(tick_us);
        assert!(ticks.abs_diff(expected) <= 3, "{ticks} of {expected}");
    }
}

#[test]
fn a_ping_is_answered_in_whole_ticks() {
    for case in CASES {
        let Some(firmware) = case.image() else { return };
        let tick_us = u64::from(case.variant.tick_us());
        // Before the clock is set; and between two sets, while the receiver is silent.
        let before = (0..20).map(|n| WorldNanos(500 * MS + n * 17 * MS + n * n * 1_234));
        let between =
            (0..40).map(|n| WorldNanos(FOUND_NS + 7 * SECOND + n * 41 * MS + n * n * 1_234));
        let asked_at: Vec<_> = before.chain(between).collect();
        let mut settings = m8(0, &case);
        settings.cold_start_ns = 2 * SECOND;
        settings.stalls = vec![Stall {
            from: WorldNanos(FOUND_NS + 6 * SECOND + 500 * MS),
            lasts_ns: 10 * SECOND,
        }];
        let mut board = power_on(firmware, &settings, &asked_at);
        board.run_to(WorldNanos(FOUND_NS + 9 * SECOND)).unwrap();
        let answers = ping_answers(&board.take_received(Connector::Telem1).unwrap());
        assert_eq!(answers.len(), asked_at.len(), "{case:?}");
        let (before, between) = answers.split_at(20);
        for (_, time_us) in before {
            assert_eq!(time_us % tick_us, 0, "{case:?}");
        }
        let since_first = between.iter().map(|(_, time_us)| time_us - between[0].1);
        let elapsed_us: BTreeSet<_> = since_first.collect();
        assert!(elapsed_us.len() > 35, "{case:?}: {elapsed_us:?}");
        for elapsed_us in elapsed_us {
            assert_eq!(elapsed_us % tick_us, 0, "{case:?}");
        }
    }
}

/// How late a clock was after each NAV-PVT, less the receiver's own latency; and whether each of
/// them has set it.
struct Lateness {
    /// Of the clock to UTC, just before the next frame, in ns.
    total_ns: Vec<i64>,
    /// From the end of the frame on the wire, in ns.
    after_frame_ns: Vec<i64>,
}

fn lateness(case: &Case, seed: u64, seconds: u64) -> Option<Lateness> {
    let mut board = power_on(case.image()?, &m8(seed, case), &[]);
    // Found, configured and set.
    board.run_to(WorldNanos(FOUND_NS + 6 * SECOND)).unwrap();
    let mut found = Lateness {
        total_ns: Vec::new(),
        after_frame_ns: Vec::new(),
    };
    let settled_ns = case.frame_ns() + POLL_NS + case.longest_wait_ns() + HANDLING_NS;
    let mut seen = board.truth().unwrap().len();
    while board.now() < WorldNanos(FOUND_NS + (6 + seconds) * SECOND) {
        board.run_for(5 * MS).unwrap();
        let truth = board.truth().unwrap();
        let Some(sent) = truth.get(seen) else {
            continue;
        };
        seen += 1;
        let handled_at = sent.first_byte.plus(settled_ns.cast_unsigned());
        // Two frames may be closer together than it takes to read one.
        board.run_to(handled_at).unwrap();
        if board.truth().unwrap().len() > seen {
            continue;
        }
        let clock = board.clock().unwrap();
        assert_eq!(clock.reading.state, ClockState::Unproved);
        let late_ns = START_UTC_NS + clock.at.0.cast_signed() - clock.reading.utc.0;
        let sent_after_ns = START_UTC_NS + sent.first_byte.0.cast_signed() - sent.epoch_utc_ns;
        found.total_ns.push(late_ns);
        found
            .after_frame_ns
            .push(late_ns - sent_after_ns - case.frame_ns());
    }
    // A NAV-PVT is either counted here as one that set the clock, or still on its way.
    let sent = board.truth().unwrap().len();
    board.run_for(SECOND + 100 * MS).unwrap();
    let marks = last_status(&board.take_log().unwrap()).number("marks");
    assert!(
        marks.is_some_and(|marks| marks.unsigned_abs() as usize + 1 >= sent),
        "{marks:?} of {sent}"
    );
    Some(found)
}

/// Mean and standard deviation, least and most, in ms.
fn figures(values_ns: &[i64]) -> (f64, f64, f64, f64) {
    let ms = |ns: i64| ns as f64 * 1e-6;
    let count = values_ns.len() as f64;
    let mean = values_ns.iter().copied().map(ms).sum::<f64>() / count;
    let squares = values_ns.iter().map(|&ns| (ms(ns) - mean).powi(2));
    let deviation = (squares.sum::<f64>() / count).sqrt();
    let least = values_ns.iter().min().copied().map_or(0.0, ms);
    let most = values_ns.iter().max().copied().map_or(0.0, ms);
    (mean, deviation, least, most)
}

#[test]
fn a_clock_is_late_by_the_frame_and_the_wait_and_set_by_every_nav_pvt() {
    for case in CASES {
        let Some(found) = lateness(&case, 1, 60) else {
            return;
        };
        let total = figures(&found.total_ns);
        let after = figures(&found.after_frame_ns);
        println!(
            "{} at {}: late by {:.2} ± {:.2} ms ({:.2} to {:.2}); of it after the frame {:.2} ± {:.2} ms ({:.2} to {:.2}); {} marks",
            case.variant,
            case.gps_baud,
            total.0,
            total.1,
            total.2,
            total.3,
            after.0,
            after.1,
            after.2,
            after.3,
            found.total_ns.len()
        );
        assert!(found.after_frame_ns.len() > 250, "{case:?}");
        // Never before the frame has come, and the answer is the last tick's time.
        let least_ns = found.after_frame_ns.iter().min().unwrap();
        assert!(*least_ns >= -case.tick_ns(), "{case:?}: {least_ns}");
        // Seen within a ms, and read a wait later.
        let most_ns = found.after_frame_ns.iter().max().unwrap();
        let longest_ns = POLL_NS + case.longest_wait_ns() + HANDLING_NS;
        assert!(*most_ns <= longest_ns, "{case:?}: {most_ns} > {longest_ns}");
        // The wait is there: without it they would be read when they are seen.
        let at_once_ns = POLL_NS + case.tick_ns() + HANDLING_NS;
        assert!(*most_ns > at_once_ns, "{case:?}: {most_ns}");
    }
}
