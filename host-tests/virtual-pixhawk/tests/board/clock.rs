//! The main job on the flashed image: the receiver's time in, UTC out, held against a
//! truth that is known to the nanosecond.
//!
//! The firmware is built without a latency, so the clock is late by what lies between
//! a solution's epoch and the end of its message's first byte. That is what bounds
//! the error in every test here: a clock that follows its marks is never later than
//! the latest of them and never earlier than the earliest.

use std::path::PathBuf;

use crate::common::{
    BYTE_NS, MS, SECOND, START_UTC_NS, image, ping_answers, pings, receiver_settings,
};
use mavlink_node::Version;
use utc_clock::ClockState;
use virtual_pixhawk::{Builder, Connector, Firmware, Pixhawk, Script};
use world::{Port, Receiver, Recording, Sent, Talker, WorldNanos};

/// What a clock may be off beyond its marks, in ns: it follows the floor, which lies
/// somewhat below the earliest of them, and may miss it by 1 ms.
const BEYOND_MARKS_NS: i64 = 1_000_000;

/// How late each mark arrived: the end of its first byte, less its epoch, where the
/// world began at `utc_at_start_ns`.
fn lateness_ns(truth: &[Sent], utc_at_start_ns: i64) -> Vec<i64> {
    let late = truth.iter().map(|sent| {
        let arrival_ns = (sent.first_byte.0 + BYTE_NS).cast_signed();
        utc_at_start_ns + arrival_ns - sent.epoch_utc_ns
    });
    late.collect()
}

/// Asserts that a clock that showed `utc_ns` when it was `at` is within its marks.
fn assert_within_marks(utc_ns: i64, at: WorldNanos, lateness_ns: &[i64], utc_at_start_ns: i64) {
    let late_ns = utc_at_start_ns + at.0.cast_signed() - utc_ns;
    let least = lateness_ns.iter().min().copied().unwrap_or_default();
    let most = lateness_ns.iter().max().copied().unwrap_or_default();
    assert!(
        (least - BEYOND_MARKS_NS..=most + BEYOND_MARKS_NS).contains(&late_ns),
        "{late_ns} ns late at {at:?}, its marks {least} to {most}"
    );
}

fn board(
    firmware: Firmware,
    crystal_ppb: i32,
    receiver: impl Talker + Send + 'static,
    asked_at: &[WorldNanos],
    version: Version,
) -> Pixhawk {
    Builder::new(firmware)
        .crystal_ppb(crystal_ppb)
        .gps(receiver)
        .telem1(Script::new(pings(version, asked_at.iter().copied())))
        .power_on()
        .unwrap()
}

/// When the first byte of a PING that leaves at `start` has arrived.
fn arrival(start: WorldNanos) -> WorldNanos {
    WorldNanos(start.0 + BYTE_NS)
}

#[test]
fn answers_carry_the_receivers_utc_within_the_latency_of_its_marks() {
    let Some(firmware) = image() else { return };
    let asked_at: Vec<_> = (0..8)
        .map(|n| WorldNanos(4 * SECOND + n * 333 * MS + n))
        .collect();
    for (version, crystal_ppb) in [
        (Version::V1, 0),
        (Version::V2, 44_000),
        (Version::V2, -500_000),
    ] {
        let receiver = Receiver::new(receiver_settings());
        let mut board = board(firmware.clone(), crystal_ppb, receiver, &asked_at, version);
        board.run_to(WorldNanos(7 * SECOND)).unwrap();
        let lateness_ns = lateness_ns(&board.truth().unwrap(), START_UTC_NS);
        assert!(lateness_ns.len() > 15, "5 Hz were not reached");
        let received = board.take_received(Connector::Telem1).unwrap();
        let answers = ping_answers(&received);
        assert_eq!(answers.len(), asked_at.len(), "{version:?}: {answers:?}");
        for (seq, time_usec) in answers {
            let at = arrival(asked_at[seq as usize]);
            let utc_ns = time_usec.cast_signed() * 1_000;
            assert_within_marks(utc_ns, at, &lateness_ns, START_UTC_NS);
        }
    }
}

#[test]
fn the_clock_itself_stays_within_its_marks_and_never_runs_back() {
    let Some(firmware) = image() else { return };
    let receiver = Receiver::new(receiver_settings());
    let mut board = board(firmware, 37_000, receiver, &[], Version::V2);
    board.run_to(WorldNanos(3 * SECOND)).unwrap();
    let mut last = board.clock().unwrap();
    assert_eq!(last.reading.state, ClockState::Set);
    for _ in 0..200 {
        board.run_for(37 * MS + 12_345).unwrap();
        let clock = board.clock().unwrap();
        let lateness_ns = lateness_ns(&board.truth().unwrap(), START_UTC_NS);
        assert_within_marks(clock.reading.utc.0, clock.at, &lateness_ns, START_UTC_NS);
        assert!(clock.reading.utc > last.reading.utc, "{last:?} {clock:?}");
        let late_ns = START_UTC_NS + clock.at.0.cast_signed() - clock.reading.utc.0;
        assert!(
            late_ns <= clock.reading.uncertainty_ns.cast_signed(),
            "{clock:?}"
        );
        last = clock;
    }
}

#[test]
fn before_the_clock_is_set_answers_are_the_time_since_boot() {
    let Some(firmware) = image() else { return };
    let mut settings = receiver_settings();
    settings.cold_start_ns = 60 * SECOND;
    let asked_at = [WorldNanos(2 * SECOND), WorldNanos(3 * SECOND)];
    let mut board = board(firmware, 0, Receiver::new(settings), &asked_at, Version::V2);
    board.run_to(WorldNanos(4 * SECOND)).unwrap();
    let answers = ping_answers(&board.take_received(Connector::Telem1).unwrap());
    assert_eq!(answers.len(), 2);
    for (seq, time_usec) in answers {
        // It boots in less than a ms, and holds TIM5 against SysTick for one more.
        let since_power_us = arrival(asked_at[seq as usize]).0 / 1_000;
        assert!(
            (0..2_000).contains(&(since_power_us - time_usec)),
            "{time_usec}"
        );
    }
    assert_eq!(board.clock().unwrap().reading.state, ClockState::Unset);
}

#[test]
fn a_clock_whose_receiver_falls_silent_goes_into_holdover_and_runs_on() {
    let Some(firmware) = image() else { return };
    let Some(recording) = recording("ublox-neo-m8p.log") else {
        return;
    };
    let firmware = firmware.for_recording(&recording, None).unwrap();
    let mut board = board(firmware, 37_000, recording, &[], Version::V2);
    // It lasts 15 s.
    board.run_to(WorldNanos(18 * SECOND)).unwrap();
    let before = board.clock().unwrap();
    board.run_to(WorldNanos(30 * SECOND)).unwrap();
    let after = board.clock().unwrap();
    for clock in [before, after] {
        assert_eq!(clock.reading.state, ClockState::Holdover);
    }
    assert!(after.reading.uncertainty_ns > before.reading.uncertainty_ns);
    let passed_ns = (after.at.0 - before.at.0).cast_signed();
    let counted_ns = after.reading.utc.0 - before.reading.utc.0;
    // 12 s at no more than a crystal's usual error.
    assert!((counted_ns - passed_ns).abs() < 12 * 50_000, "{counted_ns}");
}

/// A recording of a real receiver; `None` if the test has to be skipped.
fn recording(name: &str) -> Option<Recording> {
    let Some(captures) = std::env::var_os("PIXCLOCK_CAPTURES") else {
        eprintln!("SKIPPED: PIXCLOCK_CAPTURES is not set to a folder of recordings");
        return None;
    };
    let path = PathBuf::from(captures).join("ubx-gpsd").join(name);
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    Some(Recording::new(&bytes).unwrap())
}

#[test]
fn a_replayed_recording_is_answered_with_its_own_utc() {
    let Some(firmware) = image() else { return };
    // The first lasts 15 s, the second 5 s.
    for (name, state) in [
        ("ublox-neo-m8p.log", ClockState::Set),
        ("ublox-neo-m8n.log", ClockState::Holdover),
    ] {
        let Some(recording) = recording(name) else {
            return;
        };
        // Its marks wait for other messages, and the clock is set by the least late of 10 s.
        let asked_at: Vec<_> = (0..9)
            .map(|n| WorldNanos(12 * SECOND + n * 123 * MS))
            .collect();
        let firmware = firmware.for_recording(&recording, None).unwrap();
        let mut board = board(firmware, 0, recording, &asked_at, Version::V2);
        board.run_to(WorldNanos(13 * SECOND + 500 * MS)).unwrap();
        let truth = board.truth().unwrap();
        // A recording knows no epoch's lateness but its own: let the world begin
        // where the first mark puts it.
        let first = truth[0];
        let utc_at_start_ns = first.epoch_utc_ns - first.first_byte.0.cast_signed();
        let mut lateness_ns = lateness_ns(&truth, utc_at_start_ns);
        // Its bytes come at the board's speed, 0.114 % after their own: 0.1 µs a byte
        // of the burst before the mark.
        lateness_ns.push(lateness_ns.iter().max().unwrap() + 150_000);
        let answers = ping_answers(&board.take_received(Connector::Telem1).unwrap());
        assert_eq!(answers.len(), asked_at.len(), "{name}");
        for (seq, time_usec) in answers {
            let at = arrival(asked_at[seq as usize]);
            let utc_ns = time_usec.cast_signed() * 1_000;
            assert_within_marks(utc_ns, at, &lateness_ns, utc_at_start_ns);
        }
        assert_eq!(board.clock().unwrap().reading.state, state, "{name}");
    }
}

#[test]
fn a_receiver_that_is_configured_already_is_used_at_once() {
    let Some(firmware) = image() else { return };
    let mut settings = receiver_settings();
    settings.port = Port::CONFIGURED;
    let mut board = board(firmware, 0, Receiver::new(settings), &[], Version::V2);
    board.run_to(WorldNanos(SECOND)).unwrap();
    let state = board.clock().unwrap().reading.state;
    assert!(state != ClockState::Unset, "{state}");
    // Five marks prove its second.
    board.run_to(WorldNanos(2 * SECOND)).unwrap();
    assert_eq!(board.clock().unwrap().reading.state, ClockState::Set);
}
