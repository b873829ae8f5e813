//! All four tick settings: the interrupts that they cause, counted, and how late
//! timers are.

use crate::common::{SECOND, receiver_settings};
use virtual_pixhawk::{Builder, Firmware};
use world::{Receiver, WorldNanos};

/// SysTick's exception number.
const SYSTICK: u16 = 15;

/// Interrupts of SysTick in a second of true time, with a crystal so far off.
fn ticks_a_second(firmware: &Firmware, crystal_ppb: i32) -> u64 {
    let mut board = Builder::new(firmware.clone())
        .crystal_ppb(crystal_ppb)
        .gps(Receiver::new(receiver_settings()))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(2 * SECOND)).unwrap();
    board.start_meter(&[]).unwrap();
    board.run_to(WorldNanos(3 * SECOND)).unwrap();
    let profile = board.stop_meter();
    let tally = profile.exceptions[&SYSTICK];
    println!(
        "{} interrupts of {} to {} instructions; {} instructions in all",
        tally.times, tally.least, tally.most, profile.instructions
    );
    tally.times
}

/// From a timer's wake-up to its task, with a log line before it, in µs: generous,
/// since it has to be small beside a tick only at the slower settings.
const WAKE_UP_US: u64 = 100;

/// From the board's first line to the start of the status line's task, in µs: the other lines of the start,
/// and the first steps of the tasks that come before it. It is the same for every tick.
const START_US: u64 = 500;

/// When the status lines were logged, in µs since boot: a timer wakes their task each
/// second after the board's first line.
fn status_times_us(firmware: &Firmware) -> (u64, Vec<u64>) {
    let mut board = Builder::new(firmware.clone())
        .gps(Receiver::new(receiver_settings()))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(6 * SECOND)).unwrap();
    let log = board.take_log().unwrap();
    let time_us = |text: &str| {
        let seconds: f64 = text.parse().expect("seconds with six decimals");
        (seconds * 1e6).round() as u64
    };
    let mut boot_us = None;
    let mut statuses_us = Vec::new();
    for logged in &log {
        let at_us = time_us(logged.line.timestamp.as_deref().expect("each line has one"));
        boot_us.get_or_insert(at_us);
        if logged.line.text.starts_with("status ") {
            statuses_us.push(at_us);
        }
    }
    (boot_us.expect("it logs that it boots"), statuses_us)
}

/// No timer is early, and none is later than a tick and the way to its task.
fn timers_are_prompt(firmware: &Firmware, tick_us: u64) {
    let (boot_us, statuses_us) = status_times_us(firmware);
    assert!(statuses_us.len() >= 4, "{statuses_us:?}");
    let late_us: Vec<u64> = statuses_us
        .iter()
        .zip(1..)
        .map(|(at_us, second)| {
            let due_us = boot_us + second * 1_000_000;
            assert!(*at_us >= due_us, "{at_us} is before {due_us}");
            at_us - due_us
        })
        .collect();
    let [least_us, most_us] = [late_us.iter().min(), late_us.iter().max()].map(Option::unwrap);
    assert!(*least_us <= START_US + tick_us, "{late_us:?}");
    assert!(most_us - least_us <= tick_us + WAKE_UP_US, "{late_us:?}");
}

fn holds_for(tick_us: u64) {
    let variable = format!("PIXCLOCK_IMAGE_{tick_us}US");
    let Some(firmware) = Firmware::from_variable(&variable).unwrap() else {
        return;
    };
    timers_are_prompt(&firmware, tick_us);
    let expected = 1_000_000 / tick_us;
    let counted = ticks_a_second(&firmware, 0);
    // The meter does not see an interrupt's end while the core sleeps on from it, so
    // that it may miss one at either end of the second.
    assert!(counted.abs_diff(expected) <= 2, "{counted} of {expected}");
    let fast = ticks_a_second(&firmware, 500_000);
    let expected = expected + expected / 2_000;
    assert!(fast.abs_diff(expected) <= 2, "{fast} of {expected}");
}

#[test]
fn a_tick_of_1000_us_is_1_000_interrupts_a_second() {
    holds_for(1_000);
}

#[test]
fn a_tick_of_500_us_is_2_000_interrupts_a_second() {
    holds_for(500);
}

#[test]
fn a_tick_of_200_us_is_5_000_interrupts_a_second() {
    holds_for(200);
}

#[test]
fn a_tick_of_50_us_is_20_000_interrupts_a_second() {
    holds_for(50);
}
