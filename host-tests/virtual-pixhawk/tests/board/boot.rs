//! The flashed image on the virtual board: it boots, it reports, it can be trusted.

use crate::common::{MS, SECOND, START_UTC_NS, image, pings, receiver_settings};
use console::{Level, Status};
use mavlink_node::Version;
use virtual_pixhawk::{Builder, Connector, Firmware, Logged, Pixhawk, Script};
use world::{Receiver, Transmission, WorldNanos};

/// What the firmware may reach though no model answers: `(INSTANCE.REGISTER, whether
/// it may be written, why a run can be believed all the same)`.
const EXPLAINED: [(&str, bool, &str); 0] = [];

/// A board with a receiver from its box, with requests in both versions of MAVLink
/// and with noise on both lines: everything that the firmware does.
fn busy_board(firmware: Firmware) -> Pixhawk {
    let at = |n: u64| WorldNanos(SECOND + n * 300 * MS);
    let mut telem1 = pings(Version::V2, (0..6).map(at));
    telem1.extend(pings(Version::V1, (6..12).map(at)));
    telem1.push(Transmission {
        start: WorldNanos(4_950 * MS),
        bytes: (0..200).map(|n: u8| n.wrapping_mul(73)).collect(),
        baud: 9_600,
    });
    Builder::new(firmware)
        .crystal_ppb(-23_000)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new(telem1))
        .power_on()
        .expect("the board has power")
}

fn statuses(log: &[Logged]) -> Vec<Status> {
    log.iter()
        .filter_map(|logged| Status::parse(&logged.line.text))
        .collect()
}

#[test]
fn it_boots_and_reports_once_a_second() {
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware).power_on().unwrap();
    board.run_to(WorldNanos(3 * SECOND + 500 * MS)).unwrap();
    let log = board.take_log().unwrap();
    assert!(log[0].line.text.starts_with("pixclock "), "{:?}", log[0]);
    assert_eq!(statuses(&log).len(), 3);
    let worse = log
        .iter()
        .find(|logged| logged.line.level >= Some(Level::Warn));
    assert_eq!(worse, None);
    assert_eq!(board.damaged_log_frames().unwrap(), 0);
    assert_eq!(board.gaps().unwrap().resets, 0);
}

#[test]
fn a_hard_fault_logs_where_it_was_and_stops_the_board() {
    /// UDF: undefined for ever.
    const UNDEFINED: u16 = 0xDE00;
    let Some(firmware) = image() else { return };
    // The first byte on the MAVLink line, its own of the first second, ends it.
    let handler = firmware.symbol("USART2").unwrap();
    let firmware = firmware.with_instruction("USART2", UNDEFINED).unwrap();
    let mut board = Builder::new(firmware).power_on().unwrap();
    board.run_to(WorldNanos(3 * SECOND)).unwrap();
    let log = board.take_log().unwrap();
    assert!(log[0].line.text.starts_with("pixclock "), "{:?}", log[0]);
    let last = log.last().unwrap();
    assert_eq!(last.line.level, Some(Level::Error));
    let expected = format!("hard fault at {:#010x}", handler.address);
    assert!(
        last.line.text.starts_with(&expected),
        "{expected}: {last:?}"
    );
    assert!((SECOND..SECOND + 100 * MS).contains(&last.at.0), "{last:?}");
    assert_eq!(board.gaps().unwrap().resets, 0);
}

#[test]
fn every_register_that_is_reached_has_a_model_or_an_explanation() {
    let Some(firmware) = image() else { return };
    let mut board = busy_board(firmware);
    board.run_to(WorldNanos(6 * SECOND)).unwrap();
    let last = statuses(&board.take_log().unwrap()).pop().unwrap();
    assert!(last.is_set(), "it has not done all that it does: {last:?}");
    let gaps = board.gaps().unwrap();
    for (register, written) in &gaps.unmodelled {
        println!("no model behind {register}, written: {written}");
    }
    let unexplained: Vec<_> = gaps
        .unmodelled
        .iter()
        .filter(|(register, written)| {
            !EXPLAINED
                .iter()
                .any(|&(known, may_write, _)| known == register && (may_write || !written))
        })
        .collect();
    assert!(unexplained.is_empty(), "{unexplained:?}");
    assert!(gaps.refused.is_empty(), "{:?}", gaps.refused);
    assert!(gaps.misuse.is_empty(), "{:?}", gaps.misuse);
}

/// All that a run leaves behind.
#[derive(Debug, PartialEq)]
struct Traces {
    log: Vec<Logged>,
    sent: Vec<(u64, u8)>,
    instructions: u64,
}

fn traces(mut board: Pixhawk, meets: impl Fn(&mut Pixhawk)) -> Traces {
    meets(&mut board);
    let received = board.take_received(Connector::Telem1).unwrap();
    Traces {
        log: board.take_log().unwrap(),
        sent: received
            .iter()
            .map(|received| (received.at.0, received.byte))
            .collect(),
        instructions: board.instructions().unwrap(),
    }
}

#[test]
fn the_same_script_leaves_the_same_traces_however_it_is_watched() {
    let Some(firmware) = image() else { return };
    let end = WorldNanos(5 * SECOND);
    let first = traces(busy_board(firmware.clone()), |board| {
        board.run_to(end).unwrap();
    });
    assert!(first.log.len() >= 5 && first.sent.len() > 100);

    let again = traces(busy_board(firmware.clone()), |board| {
        board.run_to(end).unwrap();
    });
    assert_eq!(first, again);

    let in_pieces = traces(busy_board(firmware.clone()), |board| {
        for piece in 1..=50 {
            board
                .run_to(WorldNanos(end.0 / 50 * piece + piece % 7))
                .unwrap();
        }
        board.run_to(end).unwrap();
    });
    assert_eq!(first, in_pieces);

    let metered = traces(busy_board(firmware), |board| {
        board.run_to(WorldNanos(4 * SECOND)).unwrap();
        board.start_meter(&[]).unwrap();
        board.run_to(WorldNanos(4 * SECOND + 400 * MS)).unwrap();
        assert!(board.stop_meter().instructions > 10_000);
        board.run_to(end).unwrap();
    });
    assert_eq!(first, metered);
}

#[test]
fn statics_are_read_where_the_board_stands() {
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware).power_on().unwrap();
    board.run_to(WorldNanos(SECOND)).unwrap();
    let early = board.clock().unwrap();
    board.run_to(WorldNanos(2 * SECOND)).unwrap();
    let late = board.clock().unwrap();
    // A perfect crystal: 21 cycles are 125 ns.
    let passed_ns = late.at.0 - early.at.0;
    let counted_ns = (late.cycles.0 - early.cycles.0) * 125 / 21;
    assert!(
        passed_ns.abs_diff(counted_ns) < 50,
        "{passed_ns} {counted_ns}"
    );
    assert!(late.reading.utc.0 < START_UTC_NS, "no receiver has set it");
}
