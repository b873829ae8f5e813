//! The line that speaks STANAG 4586, beside the one that speaks MAVLink: one clock behind both.
//!
//! Requests leave on both lines at the same moments, and what comes back is read as `ping` reads it.

use stanag_net::relay::FromLine;
use stanag_net::station::{self, Report, TOOLS, What};
use stanag_wire::{Frame, NodeId};
use virtual_pixhawk::{Builder, Connector, Firmware, Pixhawk, Script};
use world::{Receiver, ReceiverSettings, Stall, Transmission, WorldNanos};

use crate::common::{
    BAUD, BYTE_NS, MS, SECOND, START_UTC_NS, messages, ping_answers, pings, receiver_settings,
};
use mavlink_node::Version;
use mavlink_node::client::Message;

/// The board's id, that of MAVLink's system 1.
const BOARD: NodeId = NodeId(0x0050_4301);
/// A PING has whole µs, and of two interrupts at the same moment one waits for the other. [ns]
const SAME_NS: u64 = 3_000;

/// The image whose TELEM2 speaks this; `None` if a test has to be skipped.
fn image() -> Option<Firmware> {
    Firmware::from_variable("PIXCLOCK_IMAGE_STANAG").expect("the image can be read")
}

/// An answer of each line to requests that left together. [ns]
struct Both {
    /// The report, and how long it took.
    report: Report,
    delay_ns: i64,
    /// A PING's time, and how long it took.
    mavlink_ns: i64,
    mavlink_round_trip_ns: i64,
    /// True UTC when the requests left, and when their first byte had arrived.
    left_ns: i64,
    arrived_ns: i64,
}

/// Asks on both lines from `from_s` on, `count` times in a second.
fn ask(settings: ReceiverSettings, from_s: u64, count: u32) -> Option<Vec<Both>> {
    let start_utc_ns = settings.utc_at_start_ns;
    let at =
        |n: u32| WorldNanos(from_s * SECOND + 50 * MS + u64::from(n) * SECOND / u64::from(count));
    let utc_ns = |at: WorldNanos| start_utc_ns + at.0.cast_signed();
    let requests = (0..count).map(|n| Transmission {
        start: at(n),
        bytes: station::clock_request(TOOLS, BOARD, utc_ns(at(n)), n),
        baud: BAUD,
    });
    let mut board = Builder::new(image()?)
        .gps(Receiver::new(settings))
        .telem1(Script::new(pings(Version::V2, (0..count).map(at))))
        .telem2(Script::new(requests))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos((from_s + 2) * SECOND)).unwrap();
    let reports = reports(&mut board, start_utc_ns);
    let pinged = board.take_received(Connector::Telem1).unwrap();
    let arrivals: Vec<_> = messages(&pinged)
        .into_iter()
        .filter(|(_, message)| matches!(message, Message::Ping { .. }))
        .map(|(at, _)| at)
        .collect();
    let pinged = ping_answers(&pinged);
    assert_eq!([reports.len(), pinged.len()], [count as usize; 2]);
    let both = reports.into_iter().zip(pinged).zip(arrivals).zip(0..);
    Some(
        both.map(|((((answered, report), (seq, time_us)), pinged), n)| {
            assert_eq!((report.sequence, seq), (Some(n.into()), n));
            let left = at(n);
            let held_ns = report
                .sent_ns
                .zip(report.arrival_ns)
                .map_or(0, |(sent, arrival)| sent - arrival);
            Both {
                report,
                delay_ns: (answered.0 - left.0).cast_signed() - held_ns,
                mavlink_ns: time_us.cast_signed() * 1_000,
                mavlink_round_trip_ns: (pinged.0 - left.0).cast_signed(),
                left_ns: utc_ns(left),
                arrived_ns: utc_ns(left.plus(BYTE_NS)),
            }
        })
        .collect(),
    )
}

/// The Clock Reports that came, each with the moment of its last byte.
fn reports(board: &mut Pixhawk, near_utc_ns: i64) -> Vec<(WorldNanos, Report)> {
    let mut line = FromLine::default();
    let received = board.take_received(Connector::Telem2).unwrap();
    let mut reports = Vec::new();
    for byte in received {
        for frame in line.push(&[byte.byte]) {
            for said in station::read(&frame, TOOLS, near_utc_ns) {
                if let What::Clock(report) = said.what {
                    assert_eq!(said.from, BOARD);
                    reports.push((byte.at, report));
                }
            }
        }
    }
    reports
}

/// Both lines have the same clock: as `ping` has it, by their uncertainties, and in truth nearly to the µs.
fn assert_agree(answers: &[Both], state: u64) {
    for both in answers {
        let report = &both.report;
        assert_eq!(report.state, Some(state), "{report:?}");
        let (t1, t2, t3) = (
            both.left_ns,
            report.arrival_ns.unwrap(),
            report.sent_ns.unwrap(),
        );
        let t4 = t1 + both.delay_ns + (t3 - t2);
        let offset_ns = ((t2 - t1) + (t3 - t4)) / 2;
        let mavlink_offset_ns = both.mavlink_ns - (t1 + both.mavlink_round_trip_ns / 2);
        let apart_ns = offset_ns.abs_diff(mavlink_offset_ns);
        let uncertain_ns = (both.delay_ns + both.mavlink_round_trip_ns).unsigned_abs() / 2;
        assert!(
            apart_ns <= uncertain_ns,
            "{apart_ns} ns apart, ± {uncertain_ns} ns"
        );
        assert!(
            t2.abs_diff(both.mavlink_ns) <= SAME_NS,
            "{t2} {}",
            both.mavlink_ns
        );
        // And the truth is where the report says that it is.
        let error_ns = t2.abs_diff(both.arrived_ns);
        let claimed_ns = report.uncertainty_ns.unwrap();
        assert!(
            error_ns <= claimed_ns,
            "{error_ns} ns off, ± {claimed_ns} ns"
        );
    }
}

#[test]
fn both_languages_tell_one_clock() {
    let Some(answers) = ask(receiver_settings(), 20, 10) else {
        return;
    };
    assert_agree(&answers, 1);
}

#[test]
fn a_clock_that_is_not_set_is_without_a_time_in_both() {
    let mut settings = receiver_settings();
    settings.cold_start_ns = 20 * SECOND;
    let Some(answers) = ask(settings, 5, 10) else {
        return;
    };
    for both in &answers {
        let report = &both.report;
        let times = (report.arrival_ns, report.sent_ns, report.uncertainty_ns);
        assert_eq!(times, (None, None, None), "{report:?}");
        assert_eq!(report.state, Some(0));
        let uptime_ns = report.uptime_ns.unwrap();
        // MAVLink has the time since boot then.
        assert!(
            uptime_ns.abs_diff(both.mavlink_ns.unsigned_abs()) <= SAME_NS,
            "{report:?}"
        );
    }
}

#[test]
fn both_agree_before_and_behind_the_wrap_of_the_time_stamp() {
    const WRAP_MS: i64 = (1 << 40) + 946_684_800_000;
    let mut settings = receiver_settings();
    settings.utc_at_start_ns = (WRAP_MS - 20_550) * 1_000_000;
    let Some(answers) = ask(settings, 20, 10) else {
        return;
    };
    assert_agree(&answers, 1);
    let wrapped = answers.iter().filter(|both| {
        both.report
            .arrival_ns
            .is_some_and(|ns| ns / 1_000_000 >= WRAP_MS)
    });
    assert!(
        (1..10).contains(&wrapped.count()),
        "all on one side of the wrap"
    );
}

#[test]
fn both_agree_in_holdover() {
    let mut settings = receiver_settings();
    settings.stalls = vec![Stall {
        from: WorldNanos(26 * SECOND),
        lasts_ns: 60 * SECOND,
    }];
    let Some(answers) = ask(settings, 31, 10) else {
        return;
    };
    assert_agree(&answers, 3);
}

#[test]
fn positions_are_of_the_receivers_own_epochs_and_leave_no_line_of_others_behind() {
    let settings = receiver_settings();
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(settings))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(30 * SECOND)).unwrap();
    let epochs_ms: Vec<i64> = board
        .truth()
        .unwrap()
        .iter()
        .map(|sent| sent.epoch_utc_ns.div_euclid(1_000_000))
        .collect();
    let mut line = FromLine::default();
    let bytes: Vec<u8> = board
        .take_received(Connector::Telem2)
        .unwrap()
        .iter()
        .map(|received| received.byte)
        .collect();
    let frames = line.push(&bytes);
    let length: usize = frames.iter().map(Vec::len).sum();
    assert_eq!(
        length,
        bytes.len(),
        "there are bytes that belong to no frame"
    );
    let stamps: Vec<i64> = frames
        .iter()
        .map(|frame| Frame::read(frame).unwrap().0)
        .filter(|frame| frame.header.message == 4_000)
        // Its first field, behind the presence vector of three bytes.
        .filter(|frame| frame.data[2] & 1 == 1)
        .map(|frame| {
            frame.data[3..8]
                .iter()
                .fold(0, |ms, &byte| ms << 8 | i64::from(byte))
        })
        .map(|ms| ms + 946_684_800_000)
        .collect();
    assert!((26..=30).contains(&stamps.len()), "{}", stamps.len());
    assert!(
        stamps.iter().all(|stamp| epochs_ms.contains(stamp)),
        "{stamps:?}"
    );
    // While its receiver is being configured the board has one solution for more than a second.
    assert!(stamps.is_sorted(), "{stamps:?}");
    assert!(START_UTC_NS / 1_000_000 < stamps[0]);
}
