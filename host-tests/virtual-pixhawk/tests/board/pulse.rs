//! The time pulse on AUX5: edges against the truth.

use mavlink_node::Version;
use virtual_pixhawk::{Builder, Connector, Firmware, Pixhawk, Script};
use world::{Pulse, PulseFault, PulseFaultKind, Pulses, Receiver, ReceiverSettings, WorldNanos};

use crate::common::{MS, SECOND, START_UTC_NS, image, ping_answers, pings, receiver_settings};

/// TIM4 in the vector table (RM0090, table 62): 16 and the interrupt's number.
const TIM4: u16 = 16 + 30;

/// Core cycles a second of a board whose crystal is so far off, rounded as the virtual
/// board rounds it.
fn core_hz(crystal_ppb: i32) -> f64 {
    let hse_hz = 24_000_000.0 + (f64::from(crystal_ppb) * 0.024).round();
    7.0 * hse_hz
}

fn board(firmware: &Firmware, crystal_ppb: i32, settings: &ReceiverSettings) -> Pixhawk {
    Builder::new(firmware.clone())
        .crystal_ppb(crystal_ppb)
        .gps_and_pulse(Receiver::new(settings.clone()))
        .power_on()
        .unwrap()
}

/// The synchroniser's delay is known to a count of the timer, 2 cycles, the start of the counter to
/// half of the interval that the readings leave open, and the board's count is read from outside to
/// three cycles. The firmware promises 54 ns, 9 cycles.
const EDGE_CYCLES: f64 = 8.0;

#[test]
fn the_moment_of_each_edge_is_the_one_at_which_it_came() {
    let Some(firmware) = image() else { return };
    let settings = receiver_settings();
    for crystal_ppb in [0, 40_000, -25_000] {
        let mut board = board(&firmware, crystal_ppb, &settings);
        let mut worst: f64 = 0.0;
        let mut sum = 0.0;
        for Pulse { edge, .. } in Pulses::new(&settings).skip(1).take(12) {
            board.run_to(WorldNanos(edge.0 + 500_000)).unwrap();
            let clock = board.clock().unwrap();
            let captured = board.last_rise(clock.cycles).unwrap();
            let since_edge_s = (clock.at.0 - edge.0) as f64 * 1e-9;
            let truth = since_edge_s * core_hz(crystal_ppb);
            let off = clock.cycles.since(captured) as f64 - truth;
            worst = worst.max(off.abs());
            sum += off;
        }
        let mean = sum / 12.0;
        println!("{crystal_ppb} ppb: within {worst:.2} cycles, {mean:+.2} in the mean");
        // The truth is a floating-point product: its last bits are no cycles.
        assert!(
            worst <= EDGE_CYCLES + 1e-6,
            "{worst} cycles at {crystal_ppb}"
        );
        // A constant that is half a count wrong would show.
        assert!(mean.abs() <= 4.0, "{mean} cycles at {crystal_ppb}");
    }
}

/// The value of `key` in the last status line of the log; 0 if it is not there.
fn status(board: &mut Pixhawk, key: &str) -> u64 {
    let log = board.take_log().unwrap();
    let line = log
        .iter()
        .rfind(|logged| logged.line.text.starts_with("status "));
    let pairs = line.unwrap().line.text.split(' ');
    let mut value = pairs.filter_map(|pair| pair.strip_prefix(key)?.strip_prefix('='));
    value.next_back().map_or(0, |value| value.parse().unwrap())
}

#[test]
fn a_wire_full_of_noise_costs_an_interrupt_a_millisecond() {
    let Some(firmware) = image() else { return };
    // 20 µs apart, for ever.
    let noise = (0..).map(|n| Pulse {
        edge: WorldNanos(100 * MS + n * 20_000),
        end: WorldNanos(100 * MS + n * 20_000 + 10_000),
        utc_s: None,
        late_ps: 0,
    });
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(receiver_settings()))
        .pulse(noise)
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(4 * SECOND)).unwrap();
    board.start_meter(&[]).unwrap();
    board.run_for(100 * MS).unwrap();
    let tally = board.stop_meter().exceptions[&TIM4];
    println!("{tally:?}");
    // The alarm comes once a ms, and when a timer is due.
    assert!((90..=120).contains(&tally.times), "{tally:?}");
    // None of it is a pulse; the messages keep the clock.
    let late_ns = START_UTC_NS + board.now().0.cast_signed() - board.clock().unwrap().reading.utc.0;
    assert!((0..120 * MS.cast_signed()).contains(&late_ns), "{late_ns}");
    assert_eq!(status(&mut board, "pulses"), 0);
}

#[test]
fn of_an_edge_that_bounces_the_first_is_the_pulse() {
    let Some(firmware) = image() else { return };
    let mut settings = receiver_settings();
    settings.pulse.faults = vec![PulseFault {
        from: WorldNanos(0),
        until: WorldNanos(u64::MAX),
        kind: PulseFaultKind::Bouncing {
            edges: 5,
            within_ns: MS,
        },
    }];
    let mut board = board(&firmware, 40_000, &settings);
    board.run_to(WorldNanos(40 * SECOND + 200 * MS)).unwrap();
    let clock = board.clock().unwrap();
    let error_ns = clock.reading.utc.0 - START_UTC_NS - clock.at.0.cast_signed();
    println!("{error_ns} ns");
    assert!(error_ns.abs() <= clock.reading.uncertainty_ns.cast_signed());
    // A pulse at constant temperature: two boards are at most 130 ns apart.
    assert!(error_ns.abs() <= 130, "{error_ns} ns");
    let followed = status(&mut board, "edges_followed");
    assert!(followed >= 30, "{followed}");
}

#[test]
fn an_edge_that_rings_is_followed_as_the_first_within_its_uncertainty() {
    let Some(firmware) = image() else { return };
    for pace in ["1.0", "2.0"] {
        for within_ns in [100, 300, 1_000] {
            let mut settings = receiver_settings();
            settings.pulse.faults = vec![PulseFault {
                from: WorldNanos(0),
                until: WorldNanos(u64::MAX),
                kind: PulseFaultKind::Bouncing {
                    edges: 3,
                    within_ns,
                },
            }];
            let mut board = Builder::new(firmware.clone())
                .pace(pace.parse().unwrap())
                .crystal_ppb(40_000)
                .gps_and_pulse(Receiver::new(settings.clone()))
                .power_on()
                .unwrap();
            board.run_to(WorldNanos(40 * SECOND)).unwrap();
            let mut most_ns = 0;
            for _ in 0..20 {
                board.run_for(SECOND + 37 * MS).unwrap();
                let clock = board.clock().unwrap();
                let error_ns = clock.reading.utc.0 - START_UTC_NS - clock.at.0.cast_signed();
                assert!(
                    error_ns.unsigned_abs() <= clock.reading.uncertainty_ns,
                    "{pace}, {within_ns} ns: off by {error_ns} ns, {clock:?}"
                );
                most_ns = most_ns.max(error_ns.abs());
            }
            println!("{pace} cycles an instruction, ringing for {within_ns} ns: {most_ns} ns");
            let log = board.take_log().unwrap();
            let last = log
                .iter()
                .rfind(|logged| logged.line.text.starts_with("status "));
            let last = &last.unwrap().line.text;
            assert!(last.contains(" source=pulse "), "{within_ns} ns: {last}");
            assert!(!last.contains("edges_unclear"), "{within_ns} ns: {last}");
        }
    }
}

/// A byte of 10 bits at 115200: it is stamped when it is whole. [ns]
const BYTE_NS: i64 = 86_806;

#[test]
fn a_ping_that_meets_the_status_line_is_stamped_at_once() {
    let Some(firmware) = image() else { return };
    let settings = receiver_settings();
    // The line is written once a second; its start is somewhere in this half of a ms.
    let sent_at: Vec<_> = (0..125)
        .map(|n| WorldNanos((20 + n) * SECOND + 200_000 + n * 4_000))
        .collect();
    let mut board = Builder::new(firmware)
        .gps_and_pulse(Receiver::new(settings))
        .telem1(Script::new(pings(Version::V2, sent_at.iter().copied())))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(146 * SECOND)).unwrap();
    let answers = ping_answers(&board.take_received(Connector::Telem1).unwrap());
    assert_eq!(answers.len(), sent_at.len());
    let late_ns = answers.iter().zip(&sent_at).map(|(&(_, us), sent_at)| {
        let whole_at_ns = START_UTC_NS + sent_at.0.cast_signed() + BYTE_NS;
        us.cast_signed() * 1_000 - whole_at_ns
    });
    let most_ns = late_ns.max().unwrap();
    println!("{most_ns} ns late");
    // Answers have whole µs.
    assert!((-1_000..=3_000).contains(&most_ns), "{most_ns} ns");
}
