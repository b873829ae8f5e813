//! What the board asks its receiver for, and what it reports on TELEM1 of the answers: NAV-TIMELS around an
//! announced leap second and while the second is contradicted, and the pulse that is followed and lost.

use mavlink_node::client::Message;
use timebase::ClockState;
use virtual_pixhawk::{Builder, Connector, Firmware, Pixhawk, ReceivedByte};
use world::{
    LeapKnowledge, PulseFault, PulseFaultKind, Receiver, ReceiverSettings, TimeFault, WorldNanos,
};

use crate::common::{MS, SECOND, image, messages, receiver_settings};

/// The poll of NAV-TIMELS (u-blox M8 receiver description).
const POLL: [u8; 8] = [0xb5, 0x62, 0x01, 0x26, 0, 0, 0x27, 0x76];

/// From one poll to the next while an event is near, or the second is contradicted. \[ns\]
const EACH: u64 = 10 * SECOND;

/// A poll waits for what is sent before it, and for the look at its timer. \[ns\]
const SLACK: u64 = SECOND + SECOND / 2;

/// 2026-12-31T23:56:40Z: the second 60 is to be 200 s later.
const BEFORE_LEAP_UTC_NS: i64 = (1_798_761_600 - 200) * 1_000_000_000;
const SECOND_60: WorldNanos = WorldNanos(200 * SECOND);

fn board(firmware: Firmware, settings: ReceiverSettings) -> Pixhawk {
    Builder::new(firmware)
        .crystal_ppb(37_000)
        .gps_and_pulse(Receiver::new(settings))
        .power_on()
        .unwrap()
}

/// When polls of NAV-TIMELS had left.
fn polls(sent: &[ReceivedByte]) -> Vec<WorldNanos> {
    let is_poll = |window: &&[ReceivedByte]| window.iter().map(|sent| sent.byte).eq(POLL);
    let windows = sent.windows(POLL.len()).filter(is_poll);
    windows.map(|window| window[POLL.len() - 1].at).collect()
}

/// Asserts that from `from` to `to` no time between polls was longer than it may be.
fn assert_polled(polls: &[WorldNanos], from: WorldNanos, to: WorldNanos) {
    let within = polls.iter().copied().filter(|at| (from..to).contains(at));
    let moments: Vec<_> = [from].into_iter().chain(within).chain([to]).collect();
    for pair in moments.array_windows() {
        let [earlier, later] = *pair;
        let apart_ns = later.0 - earlier.0;
        assert!(apart_ns <= EACH + SLACK, "{earlier:?} {later:?}: {polls:?}");
    }
}

#[test]
fn an_announced_leap_second_is_asked_about_and_passes_in_its_uncertainty() {
    let Some(firmware) = image() else { return };
    let settings = ReceiverSettings {
        utc_at_start_ns: BEFORE_LEAP_UTC_NS,
        leap: LeapKnowledge {
            second_60: Some(SECOND_60),
            ..LeapKnowledge::RESOLVED
        },
        ..receiver_settings()
    };
    let mut board = board(firmware, settings);
    board.run_to(WorldNanos(60 * SECOND)).unwrap();
    let over = SECOND_60.plus(SECOND);
    let mut polled = Vec::new();
    for n in 0.. {
        let at = WorldNanos(60 * SECOND + n * 370 * MS);
        if at >= WorldNanos(260 * SECOND) {
            break;
        }
        board.run_to(at).unwrap();
        let clock = board.clock().unwrap();
        let before_ns = clock.reading.utc.0 - BEFORE_LEAP_UTC_NS - clock.at.0.cast_signed();
        let after_ns = before_ns + SECOND.cast_signed();
        // The step takes its time around the end of the second 60; its neighbours are right.
        let off_ns = if clock.at.plus(50 * MS) < over {
            before_ns.abs()
        } else if clock.at > over.plus(50 * MS) {
            after_ns.abs()
        } else {
            before_ns.abs().min(after_ns.abs())
        };
        assert_ne!(clock.reading.state, ClockState::Unset, "{clock:?}");
        let most_ns = clock.reading.uncertainty_ns + 6;
        assert!(off_ns.unsigned_abs() <= most_ns, "{off_ns} ns: {clock:?}");
        // And it is known well but for two seconds on either side.
        let is_near = clock.at.plus(2 * SECOND) > SECOND_60 && clock.at < over.plus(2 * SECOND);
        assert!(is_near || off_ns <= 5_000, "{off_ns} ns: {clock:?}");
    }
    polled.extend(polls(&board.take_received(Connector::Gps).unwrap()));
    // Each 10 s from a minute before it to its end, and then once more.
    assert_polled(&polled, WorldNanos(140 * SECOND), over);
    assert!(
        polled
            .iter()
            .any(|at| (over..over.plus(EACH + SLACK)).contains(at))
    );
    // Seldom before: its minutes have no poll but the one that found it.
    let early = polled
        .iter()
        .filter(|at| (WorldNanos(20 * SECOND)..WorldNanos(75 * SECOND)).contains(at));
    assert!(early.count() <= 1, "{polled:?}");
}

/// The second that the receiver names is another one for half a minute; then the wire of the pulse is cut
/// for a while.
#[test]
fn what_contradicts_and_what_is_lost_is_reported_on_telem1_and_asked_about() {
    let Some(firmware) = image() else { return };
    let contradicts = [95, 125].map(|s| WorldNanos(s * SECOND));
    let cut = [150, 170].map(|s| WorldNanos(s * SECOND));
    let mut settings = receiver_settings();
    settings.time_faults =
        vec![TimeFault::jump(contradicts[0], 2 * SECOND.cast_signed()).until(contradicts[1])];
    settings.pulse.faults = vec![PulseFault {
        from: cut[0],
        until: cut[1],
        kind: PulseFaultKind::Cut,
    }];
    let mut board = board(firmware, settings);
    board.run_to(WorldNanos(230 * SECOND)).unwrap();
    let received = board.take_received(Connector::Telem1).unwrap();
    let texts: Vec<_> = messages(&received)
        .into_iter()
        .filter_map(|(at, what)| match what {
            Message::StatusText { text, .. } => Some((at, text.as_str().to_owned())),
            _ => None,
        })
        .collect();
    println!("{texts:?}");
    // Each is received within 20 s, in this order: a pulse takes so long to be proved anew.
    let mut rest = texts.iter();
    for (text, from, within) in [
        ("clock: second proved", WorldNanos(0), 20 * SECOND),
        ("clock follows the pulse", WorldNanos(0), 40 * SECOND),
        ("clock: second contradicted", contradicts[0], 3 * SECOND),
        ("clock: second proved", contradicts[1], 3 * SECOND),
        ("clock lost the pulse", cut[0], 15 * SECOND),
        ("clock follows the pulse", cut[1], 40 * SECOND),
    ] {
        let found = rest.find(|(_, found)| found == text);
        let &(at, _) = found.unwrap_or_else(|| panic!("no \"{text}\" in its place: {texts:?}"));
        assert!(
            (from..from.plus(within)).contains(&at),
            "{text} at {at:?}: {texts:?}"
        );
    }
    // NAV-TIMELS is asked for at once, and each 10 s for as long as it lasts.
    let polled = polls(&board.take_received(Connector::Gps).unwrap());
    println!("{polled:?}");
    let first = polled.iter().find(|at| **at > contradicts[0]);
    assert!(
        first.is_some_and(|at| *at < contradicts[0].plus(3 * SECOND)),
        "{polled:?}"
    );
    assert_polled(&polled, contradicts[0], contradicts[1]);
    // And not while there is nothing to ask.
    let idle = polled
        .iter()
        .filter(|at| (WorldNanos(30 * SECOND)..contradicts[0]).contains(at));
    assert_eq!(idle.count(), 0, "{polled:?}");
}
