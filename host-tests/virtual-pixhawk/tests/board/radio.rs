//! TELEM1 at the rate that a SiK radio has out of its box, 57600 Bd: an image with
//! `PIXCLOCK_MAVLINK_BAUD=57600`.

use mavlink_node::Version;
use mavlink_node::client::Message;
use virtual_pixhawk::{Builder, Connector, Firmware, Script};
use world::{Receiver, WorldNanos};

use crate::common::{
    MS, SECOND, START_UTC_NS, image, messages, ping_answers, pings, receiver_settings,
};

const RADIO_BAUD: u32 = 57_600;

/// A byte of 10 bits at that rate: it is stamped when it is whole. \[ns\]
const RADIO_BYTE_NS: i64 = 173_611;

#[test]
fn a_radio_at_its_own_rate_gets_broadcasts_and_answers_that_are_stamped_at_once() {
    let variable = "PIXCLOCK_IMAGE_TELEM1_57600BD";
    let Some(firmware) = Firmware::from_variable(variable).unwrap() else {
        return;
    };
    let sent_at: Vec<_> = (0..100)
        .map(|n| WorldNanos(50 * SECOND + n * 97 * MS))
        .collect();
    let mut requests = pings(Version::V2, sent_at.iter().copied());
    for request in &mut requests {
        request.baud = RADIO_BAUD;
    }
    let mut board = Builder::new(firmware)
        .gps_and_pulse(Receiver::new(receiver_settings()))
        .telem1(Script::new(requests))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(62 * SECOND)).unwrap();
    let received = board.take_received(Connector::Telem1).unwrap();
    let answers = ping_answers(&received);
    assert_eq!(answers.len(), sent_at.len());
    for (&(_, us), sent_at) in answers.iter().zip(&sent_at) {
        let whole_at_ns = START_UTC_NS + sent_at.0.cast_signed() + RADIO_BYTE_NS;
        let late_ns = us.cast_signed() * 1_000 - whole_at_ns;
        // Answers have whole µs.
        assert!((-1_500..=3_000).contains(&late_ns), "{late_ns} ns");
    }
    let system_times = messages(&received)
        .into_iter()
        .filter(|(_, what)| matches!(what, Message::SystemTime { .. }));
    assert!(system_times.count() >= 60);
    let log = board.take_log().unwrap();
    let last = log
        .iter()
        .rfind(|logged| logged.line.text.starts_with("status "));
    let last = &last.unwrap().line.text;
    for counter in [
        "mav_overrun",
        "mav_framing",
        "mav_outgoing_full",
        "mav_crc_failures",
    ] {
        assert!(!last.contains(counter), "{last}");
    }
}

#[test]
fn a_board_at_another_rate_than_its_radio_says_so_by_its_counters() {
    let Some(firmware) = image() else { return };
    let mut requests = pings(
        Version::V2,
        (0..20).map(|n| WorldNanos(SECOND + n * 100 * MS)),
    );
    for request in &mut requests {
        request.baud = RADIO_BAUD;
    }
    let mut board = Builder::new(firmware)
        .telem1(Script::new(requests))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(5 * SECOND)).unwrap();
    let received = board.take_received(Connector::Telem1).unwrap();
    assert_eq!(ping_answers(&received), []);
    let log = board.take_log().unwrap();
    let last = log
        .iter()
        .rfind(|logged| logged.line.text.starts_with("status "));
    let last = &last.unwrap().line.text;
    assert!(last.contains("mav_framing="), "{last}");
}
