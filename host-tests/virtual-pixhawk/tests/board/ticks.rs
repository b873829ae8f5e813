//! All four tick settings: the interrupts that they cause, counted.

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

fn holds_for(tick_us: u64) {
    let variable = format!("PIXCLOCK_IMAGE_{tick_us}US");
    let Some(firmware) = Firmware::from_variable(&variable).unwrap() else {
        return;
    };
    let expected = 1_000_000 / tick_us;
    let counted = ticks_a_second(&firmware, 0);
    // One more or less is where the second begins and ends between two of them.
    assert!(counted.abs_diff(expected) <= 1, "{counted} of {expected}");
    let fast = ticks_a_second(&firmware, 500_000);
    let expected = expected + expected / 2_000;
    assert!(fast.abs_diff(expected) <= 1, "{fast} of {expected}");
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
