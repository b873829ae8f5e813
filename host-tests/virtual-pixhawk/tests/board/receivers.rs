//! Each receiver that can be bought, from its box to a set clock; those that cannot be used; none, and a
//! swap in flight.

use mavlink_node::client::Message;
use timebase::ClockState;
use virtual_pixhawk::{Builder, Connector, Firmware, Logged, Pixhawk};
use world::{Damage, Line, Model, Port, Receiver, ReceiverSettings, Swap, WorldNanos};

use crate::common::{MS, SECOND, image, messages, receiver_settings};
use crate::evidence::{board, readings, status};

/// A receiver is found this long after it speaks, at most.
const FOUND_NS: u64 = 10 * SECOND;

/// A port as it comes out of its box: NMEA once a second.
const fn nmea_at(baud: u32) -> Port {
    Port {
        baud,
        ..Port::FACTORY
    }
}

/// A port as makers of modules for flight controllers preset it: UBX.
const fn ubx_at(baud: u32) -> Port {
    Port {
        nmea: false,
        nav_pvt_every: 1,
        protocols_in: 0x01,
        ..nmea_at(baud)
    }
}

fn of(model: Model, port: Port) -> ReceiverSettings {
    ReceiverSettings {
        model,
        port,
        ..receiver_settings()
    }
}

/// The STATUSTEXTs about the receiver so far.
fn texts(board: &mut Pixhawk) -> Vec<String> {
    let sent = messages(&board.take_received(Connector::Telem1).unwrap());
    let texts = sent.into_iter().filter_map(|(_, what)| match what {
        Message::StatusText { text, .. } => Some(text.as_str().to_owned()),
        _ => None,
    });
    let is_receivers = |text: &String| text.starts_with("GNSS: ") || text.starts_with("receiver ");
    texts.filter(is_receivers).collect()
}

/// Whether the last status line has `word`.
fn has_word(log: &[Logged], word: &str) -> bool {
    let line = log
        .iter()
        .rfind(|logged| logged.line.text.starts_with("status "));
    line.unwrap().line.text.split(' ').any(|own| own == word)
}

/// When the log says first behind `from` that a receiver is there.
fn found_at(log: &[Logged], from: WorldNanos) -> WorldNanos {
    let mut behind = log.iter().filter(|logged| logged.at > from);
    let found = behind.find(|logged| logged.line.text.starts_with("the receiver is "));
    found.expect("it is found").at
}

/// Runs until the clock is set: when it is.
fn set_at(board: &mut Pixhawk) -> WorldNanos {
    for _ in 0..300 {
        board.run_for(100 * MS).unwrap();
        if board
            .clock()
            .is_ok_and(|clock| clock.reading.state == ClockState::Set)
        {
            return board.now();
        }
    }
    panic!("not set after {:?}", board.now());
}

fn each_sets_the_clock(firmware: &Firmware, receivers: &[(Model, Port, &str)]) {
    for (model, port, text) in receivers {
        let mut board = board(firmware.clone(), &of(*model, *port));
        let at = set_at(&mut board);
        println!(
            "| {text} | {} | {} | {:.1} s |",
            port.baud,
            if port.nmea { "NMEA" } else { "UBX" },
            at.0 as f64 / 1e9
        );
        assert!(at < WorldNanos(25 * SECOND), "{model:?} {port:?} {at:?}");
        board.run_for(SECOND).unwrap();
        let texts = texts(&mut board);
        assert!(texts.iter().any(|own| own == text), "{model:?} {texts:?}");
        readings(&mut board, 30);
        let log = board.take_log().unwrap();
        // Its pulse has the width that it has acknowledged; only such are followed.
        assert!(status(&log, "pulses") > 0, "{model:?} {port:?}");
    }
}

#[test]
fn each_generation_sets_the_clock_from_its_box() {
    let Some(firmware) = image() else { return };
    each_sets_the_clock(
        &firmware,
        &[
            (
                Model::M8,
                nmea_at(9_600),
                "GNSS: u-blox 8 SPG 3.01, UBX 18.00",
            ),
            (
                Model::M9,
                nmea_at(38_400),
                "GNSS: NEO-M9N SPG 4.04, UBX 32.01",
            ),
            (
                Model::M10,
                nmea_at(38_400),
                "GNSS: u-blox 10 SPG 5.10, UBX 34.10",
            ),
            (
                Model::F9,
                nmea_at(38_400),
                "GNSS: ZED-F9P HPG 1.32, UBX 27.31",
            ),
            (
                Model::F10,
                nmea_at(38_400),
                "GNSS: NEO-F10N SPG 6.00, UBX 40.00",
            ),
            (
                Model::X20,
                nmea_at(38_400),
                "GNSS: ZED-X20P HPG 2.00, UBX 50.00",
            ),
        ],
    );
}

#[test]
fn each_rate_and_preset_sets_the_clock() {
    let Some(firmware) = image() else { return };
    each_sets_the_clock(
        &firmware,
        &[
            (
                Model::M10,
                nmea_at(9_600),
                "GNSS: u-blox 10 SPG 5.10, UBX 34.10",
            ),
            (
                Model::M8,
                ubx_at(57_600),
                "GNSS: u-blox 8 SPG 3.01, UBX 18.00",
            ),
            (
                Model::M10,
                ubx_at(115_200),
                "GNSS: u-blox 10 SPG 5.10, UBX 34.10",
            ),
            (
                Model::M9,
                ubx_at(230_400),
                "GNSS: NEO-M9N SPG 4.04, UBX 32.01",
            ),
            (
                Model::F9,
                ubx_at(460_800),
                "GNSS: ZED-F9P HPG 1.32, UBX 27.31",
            ),
        ],
    );
}

#[test]
fn what_cannot_be_used_is_refused_in_words() {
    let Some(firmware) = image() else { return };
    for (model, text, words) in [
        (
            Model::Ublox6,
            "GNSS: u-blox 6 unused: it has no NAV-PVT",
            ["receiver=u-blox_6", "receiver_unused=it_has_no_NAV-PVT"],
        ),
        (
            Model::Ublox7,
            "GNSS: u-blox 7 unused: NAV-PVT of 84 bytes",
            ["receiver=u-blox_7", "receiver_unused=NAV-PVT_of_84_bytes"],
        ),
    ] {
        let mut board = board(firmware.clone(), &of(model, nmea_at(9_600)));
        board.run_to(WorldNanos(12 * SECOND)).unwrap();
        let texts = texts(&mut board);
        // Once, although it is asked again and again.
        assert_eq!(texts, [text], "{model:?}");
        let log = board.take_log().unwrap();
        for word in words {
            assert!(has_word(&log, word), "{word}");
        }
        assert!(
            board
                .clock()
                .map_or(true, |clock| clock.reading.state == ClockState::Unset)
        );
    }
}

#[test]
fn nobody_there_is_reported() {
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware).power_on().unwrap();
    board.run_to(WorldNanos(8 * SECOND)).unwrap();
    assert_eq!(texts(&mut board), ["GNSS: no receiver answers"]);
    assert!(has_word(&board.take_log().unwrap(), "receiver=none"));
}

#[test]
fn a_refused_pulse_is_named_and_never_followed() {
    let Some(firmware) = image() else { return };
    // CFG-TP-LEN_LOCK_TP1.
    let settings = ReceiverSettings {
        refuses_keys: vec![0x4005_0005],
        ..of(Model::M10, nmea_at(38_400))
    };
    let mut board = board(firmware, &settings);
    readings(&mut board, 40);
    let texts = texts(&mut board);
    let named = texts.iter().filter(|text| text.contains("refuses CFG-TP"));
    assert_eq!(named.count(), 1, "{texts:?}");
    assert_eq!(board.clock().unwrap().reading.state, ClockState::Set);
    assert_eq!(status(&board.take_log().unwrap(), "pulses"), 0);
}

#[test]
fn garbage_on_the_line_delays_a_clock_and_does_not_mislead_it() {
    let Some(firmware) = image() else { return };
    let damage = Damage {
        seed: 17,
        drop: 0.002,
        flip: 0.002,
        insert: 0.002,
        silence: None,
    };
    let receiver = Receiver::new(of(Model::M10, nmea_at(38_400)));
    let pulses = receiver.pulses();
    let mut board = Builder::new(firmware)
        .crystal_ppb(37_000)
        .gps(Line::new(receiver, damage))
        .pulse(pulses)
        .power_on()
        .unwrap();
    let clocks = readings(&mut board, 60);
    let last = clocks.last().unwrap();
    assert_eq!(last.reading.state, ClockState::Set);
}

#[test]
fn one_that_restarts_is_found_again_at_once() {
    let Some(firmware) = image() else { return };
    for model in [Model::M8, Model::F9] {
        let restart = WorldNanos(30 * SECOND);
        let settings = ReceiverSettings {
            restarts: vec![restart],
            ..of(model, nmea_at(38_400))
        };
        let mut board = board(firmware.clone(), &settings);
        readings(&mut board, 60);
        // It speaks a second later, at the rate that it has saved.
        let truth = board.truth().unwrap();
        let again = truth.iter().find(|sent| sent.first_byte > restart).unwrap();
        let ms = (again.first_byte.0 - restart.0) / MS;
        println!("{model:?}: the first NAV-PVT after {ms} ms");
        assert!(again.first_byte.0 < restart.0 + SECOND + FOUND_NS / 2);
        assert_eq!(board.clock().unwrap().reading.state, ClockState::Set);
    }
}

#[test]
fn a_swap_in_flight_is_found_and_never_misleads() {
    let Some(firmware) = image() else { return };
    for (first, second, port) in [
        (Model::M8, Model::M10, nmea_at(38_400)),
        (Model::F9, Model::M8, nmea_at(9_600)),
    ] {
        let unplugged = WorldNanos(40 * SECOND);
        let plugged = WorldNanos(43 * SECOND);
        let mut spare = of(second, port);
        spare.power_on = plugged;
        spare.pulse.from = plugged;
        let line = Swap::new(
            Receiver::new(of(first, nmea_at(38_400))),
            unplugged,
            Receiver::new(spare),
        );
        let pulses = line.pulses();
        let mut board = Builder::new(firmware.clone())
            .crystal_ppb(37_000)
            .gps(line)
            .pulse(pulses)
            .power_on()
            .unwrap();
        // Each reading holds the truth.
        readings(&mut board, 100);
        let log = board.take_log().unwrap();
        let found = found_at(&log, unplugged);
        println!(
            "{first:?} to {second:?}: found {} ms after it speaks",
            (found.0 - plugged.0) / MS
        );
        assert!(found.0 < plugged.0 + FOUND_NS, "{found:?}");
        assert_eq!(board.clock().unwrap().reading.state, ClockState::Set);
    }
}
