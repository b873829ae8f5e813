//! The time pulse on AUX5: edges against the truth.

use virtual_pixhawk::{Builder, Firmware, Pixhawk};
use world::{Pulse, Pulses, Receiver, ReceiverSettings, WorldNanos};

use crate::common::{image, receiver_settings};

/// Core cycles a second of a board whose crystal is so far off, rounded as the virtual
/// board rounds it.
fn core_hz(crystal_ppb: i32) -> f64 {
    let hse_hz = 24_000_000.0 + (f64::from(crystal_ppb) * 0.024).round();
    7.0 * hse_hz
}

fn board(firmware: &Firmware, crystal_ppb: i32, settings: &ReceiverSettings) -> Pixhawk {
    Builder::new(firmware.clone())
        .crystal_ppb(crystal_ppb)
        .gps(Receiver::new(settings.clone()))
        .pulse(Pulses::new(settings))
        .power_on()
        .unwrap()
}

/// A capture is told to a count of the timer, 2 cycles, and the board's count is read
/// from outside to one.
const CAPTURE_CYCLES: f64 = 3.0;

#[test]
fn the_capture_of_each_edge_is_the_moment_at_which_it_came() {
    let Some(firmware) = image() else { return };
    let settings = receiver_settings();
    for crystal_ppb in [0, 40_000, -25_000] {
        let mut board = board(&firmware, crystal_ppb, &settings);
        let mut worst: f64 = 0.0;
        for Pulse { edge, .. } in Pulses::new(&settings).skip(1).take(12) {
            board.run_to(WorldNanos(edge.0 + 500_000)).unwrap();
            let clock = board.clock().unwrap();
            let told = board.captured_edge(clock.cycles).unwrap();
            let since_edge_s = (clock.at.0 - edge.0) as f64 * 1e-9;
            let truth = since_edge_s * core_hz(crystal_ppb);
            let off = clock.cycles.since(told) as f64 - truth;
            worst = worst.max(off.abs());
        }
        println!("{crystal_ppb} ppb: within {worst:.2} cycles");
        assert!(worst <= CAPTURE_CYCLES, "{worst} cycles at {crystal_ppb}");
    }
}
