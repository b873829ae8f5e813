//! What may keep a stamp waiting: no section masks interrupts for long, and no log frame masks them.

use mavlink_node::client::Client;
use mavlink_node::{Address, Test, Version};
use virtual_pixhawk::{Builder, Card, Firmware, Profile, Script};
use world::{Receiver, Transmission, WorldNanos};

use crate::common::{BAUD, MS, SECOND, image, pings, receiver_settings};

/// Exception numbers (RM0090, table 62): 16 and the interrupt's.
const TIM4: u16 = 16 + 30;
const USART2: u16 = 16 + 38;
const UART4: u16 = 16 + 52;
const EXECUTORS: [u16; 2] = [16 + 78, 16 + 63];
const THREAD: u16 = 0;

/// Two seconds in which everything happens at once.
fn busy(firmware: &Firmware) -> Profile {
    let [station, board] =
        [(255, 190), (1, 1)].map(|(system, component)| Address { system, component });
    let mut requests = pings(
        Version::V1,
        (0..1_300).map(|n| WorldNanos(16 * SECOND + n * 4 * MS)),
    );
    requests.push(Transmission {
        start: WorldNanos(20 * SECOND + 502 * MS),
        bytes: Client::new(station, Version::V2)
            .test(board, Test::Ends)
            .to_vec(),
        baud: BAUD,
    });
    requests.sort_by_key(|request| request.start);
    let mut board = Builder::new(firmware.clone())
        .gps_and_pulse(Receiver::new(receiver_settings()))
        .telem1(Script::new(requests))
        .card(Card::holding(&fat_image::formatted(fat_image::Kind::Fat16)))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(19 * SECOND + 500 * MS)).unwrap();
    let logger = ["_defmt_acquire", "_defmt_write", "_defmt_release"];
    board.start_meter(&logger).unwrap();
    board.run_for(2 * SECOND).unwrap();
    let profile = board.stop_meter();
    let log = board.take_log().unwrap();
    let has = |start: &str| log.iter().any(|logged| logged.line.text.starts_with(start));
    assert!(has("the log is saved"), "{log:?}");
    let last = log
        .iter()
        .rfind(|logged| logged.line.text.starts_with("status "));
    let last = &last.unwrap().line.text;
    assert!(last.contains(" source=pulse "), "{last}");
    assert!(last.contains(" lost_ticks=0"), "{last}");
    profile
}

#[test]
fn no_section_masks_interrupts_for_long_and_no_stamp_waits() {
    let Some(firmware) = image() else { return };
    let profile = busy(&firmware);
    let masked = profile.masked(&firmware);
    for (function, tally) in masked.iter().take(10) {
        println!("{:>4} instructions masked in {function}", tally.most);
    }
    let longest = masked[0].1.most;
    assert!(longest <= 250, "{longest} instructions, {}", masked[0].0);
    for line in [UART4, USART2] {
        let stamp = profile.stamps()[&line];
        println!("{line}: {stamp:?}");
        assert!(stamp.times > 1_000 && stamp.most <= 500, "{stamp:?}");
    }
    let capture = profile.entries()[&TIM4];
    println!("{capture:?}");
    assert!(capture.times >= 4 && capture.most <= 2_500, "{capture:?}");
}

#[test]
fn the_log_is_written_below_every_stamp_and_never_under_primask() {
    let Some(firmware) = image() else { return };
    let profile = busy(&firmware);
    let frames = profile.functions["_defmt_acquire"].times;
    assert!(frames >= 3, "{frames}");
    for function in ["_defmt_acquire", "_defmt_write", "_defmt_release"] {
        let place = firmware.symbol(function).unwrap();
        assert!(profile.inside(place) > 0);
        assert_eq!(profile.inside_masked(place), 0, "{function}");
        for caller in &profile.callers[function] {
            assert!(
                *caller == THREAD || EXECUTORS.contains(caller),
                "{function} in exception {caller}"
            );
        }
    }
}
