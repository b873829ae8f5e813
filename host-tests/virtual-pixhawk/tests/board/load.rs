//! The load that is built in: what it makes, measured on the board, beside PX4's own figures; and what it does
//! to the clocks.

use std::collections::BTreeMap;

use console::Status;
use flight_load::{BOUNDS_US, Lateness, PX4_BEFORE};
use mavlink_node::Version;
use virtual_pixhawk::{Builder, Connector, Firmware, Pixhawk, Script};
use world::{Receiver, WorldNanos};

use crate::common::{MS, SECOND, ping_answers, pings, receiver_settings};

/// The exceptions of the load: TIM2, TIM3 and its three levels (RM0090, table 62).
const OF_THE_LOAD: [u16; 5] = [16 + 28, 16 + 29, 16 + 19, 16 + 20, 16 + 21];

/// UART4 and USART2.
const LINES: [u16; 2] = [16 + 52, 16 + 38];

/// Events that the probe has to see.
const EVENTS: u32 = 100_000;

/// The image that `cargo xtask board-test` hands over; `None` if the test has to be skipped, which has been
/// printed.
fn image(variant_and_load: &str) -> Option<Firmware> {
    let variable = format!("PIXCLOCK_IMAGE_{variant_and_load}");
    Firmware::from_variable(&variable).expect("the image can be read")
}

fn power_on(firmware: Firmware, asked_at: &[WorldNanos]) -> Pixhawk {
    Builder::new(firmware)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new(pings(Version::V2, asked_at.iter().copied())))
        .power_on()
        .unwrap()
}

fn lateness(board: &mut Pixhawk) -> Lateness {
    let bytes = board.read("LOAD_LATENESS").unwrap();
    let mut words = bytes.as_chunks::<4>().0.iter();
    Lateness(std::array::from_fn(|_| {
        words.next().map_or(0, |word| u32::from_le_bytes(*word))
    }))
}

/// Prints a histogram beside PX4's.
fn print(variant: &str, is: &Lateness) {
    println!(
        "{variant}: {} events of an interrupt at the load's level",
        is.events()
    );
    let bounds = BOUNDS_US.map(|bound_us| format!("≤ {bound_us} µs"));
    let bounds = bounds.iter().map(String::as_str).chain(["more"]);
    for ((bound, is), px4) in bounds.zip(is.shares()).zip(PX4_BEFORE.shares()) {
        println!(
            "{bound:>10} {:>8.3} %   PX4 {:>8.3} %",
            is * 100.0,
            px4 * 100.0
        );
    }
}

/// The share of the core that the load takes.
fn share(board: &mut Pixhawk) -> f64 {
    const METERED_MS: u64 = 400;
    board.start_meter(&[]).unwrap();
    board.run_for(METERED_MS * MS).unwrap();
    let exceptions: BTreeMap<_, _> = board.stop_meter().exceptions;
    let of = |number: &u16| exceptions.get(number).map_or(0, |tally| tally.instructions);
    let busy: u64 = OF_THE_LOAD.iter().map(of).sum();
    busy as f64 / (METERED_MS * 168_000) as f64
}

fn last_status(board: &mut Pixhawk) -> Status {
    let log = board.take_log().unwrap();
    let statuses = log.iter().map(|logged| Status::parse(&logged.line.text));
    statuses.flatten().last().expect("a status line")
}

#[test]
fn it_makes_px4s_histogram_and_takes_what_was_asked_for() {
    let Some(firmware) = image("PAPER_TICK_ONLY_50_LOAD_55") else {
        return;
    };
    let mut board = power_on(firmware, &[]);
    board.run_to(WorldNanos(2 * SECOND)).unwrap();
    let taken = share(&mut board);
    println!("the load px4 takes {:.1} % of the core", taken * 100.0);
    while lateness(&mut board).events() < EVENTS {
        board.run_for(SECOND).unwrap();
    }
    let is = lateness(&mut board);
    print("paper-tick-only:50", &is);
    assert!((taken - 0.55).abs() <= 0.05, "{taken}");
    let [buckets @ .., beyond] = is.shares();
    let [px4 @ .., _] = PX4_BEFORE.shares();
    for ((is, px4), bound_us) in buckets.iter().zip(px4).zip(BOUNDS_US) {
        let ratio = is / px4;
        assert!((1.0 / 1.5..=1.5).contains(&ratio), "{bound_us} µs: {ratio}");
    }
    assert!(beyond <= 1e-4, "{beyond}");
    // Nothing of it was left out, no line lost a byte, and ticks were lost.
    let status = last_status(&mut board);
    for never in ["load_left_out", "gps_overrun", "mav_overrun"] {
        assert_eq!(status.number(never).unwrap_or(0), 0, "{status:?}");
    }
    assert!(status.number("lost_ticks") > Some(1_000), "{status:?}");
}

#[test]
fn step_2_loses_no_tick_under_it() {
    let Some(firmware) = image("PAPER_STEP2_50_LOAD_55") else {
        return;
    };
    let mut board = power_on(firmware, &[]);
    board.run_to(WorldNanos(10 * SECOND)).unwrap();
    let status = last_status(&mut board);
    for never in ["lost_ticks", "load_left_out", "gps_overrun", "mav_overrun"] {
        assert_eq!(status.number(never).unwrap_or(0), 0, "{status:?}");
    }
    print("paper-step2:50", &lateness(&mut board));
}

#[test]
fn under_60_percent_ours_stamps_in_time_and_answers_every_ping() {
    let Some(firmware) = image("LOAD_60") else {
        return;
    };
    let asked_at: Vec<_> = (0..400)
        .map(|n| WorldNanos(4 * SECOND + n * 11 * MS + n * n * 77))
        .collect();
    let mut board = power_on(firmware.clone(), &asked_at);
    board.run_to(WorldNanos(6 * SECOND)).unwrap();
    board.start_meter(&[]).unwrap();
    board.run_for(SECOND).unwrap();
    let profile = board.stop_meter();
    board.run_to(WorldNanos(10 * SECOND)).unwrap();
    let answers = ping_answers(&board.take_received(Connector::Telem1).unwrap());
    assert_eq!(answers.len(), asked_at.len());
    let status = last_status(&mut board);
    for never in [
        "lost_ticks",
        "load_left_out",
        "gps_overrun",
        "mav_overrun",
        "mav_outgoing_full",
    ] {
        assert_eq!(status.number(never).unwrap_or(0), 0, "{status:?}");
    }
    let of = |number: &u16| {
        profile
            .exceptions
            .get(number)
            .map_or(0, |tally| tally.instructions)
    };
    let busy: u64 = OF_THE_LOAD.iter().map(of).sum();
    let taken = busy as f64 / 168e6;
    println!("the load 60 takes {:.1} % of the core", taken * 100.0);
    assert!((taken - 0.60).abs() <= 0.05, "{taken}");
    print("pixclock", &lateness(&mut board));
    let (function, longest) = profile.masked(&firmware)[0];
    assert!(longest.most <= 250, "{longest:?} in {function}");
    // 3 µs are 504 instructions.
    for line in LINES {
        let stamp = profile.stamps()[&line];
        println!("exception {line}: {stamp:?}");
        assert!(stamp.times > 50 && stamp.most <= 504, "{stamp:?}");
    }
}

#[test]
fn an_image_without_it_has_nothing_of_it() {
    let Some(firmware) = image("50US") else {
        return;
    };
    for symbol in ["LOAD_LATENESS", "LOAD_LEFT_OUT", "PIXCLOCK_LOAD_SEED"] {
        assert!(firmware.symbol(symbol).is_err(), "{symbol}");
    }
    let is_of_load = |name: &str| name.contains("flight_load") || name.contains("firmware::load");
    let found: Vec<_> = firmware
        .symbols()
        .filter(|(name, _)| is_of_load(name))
        .collect();
    assert!(found.is_empty(), "{found:?}");
}
