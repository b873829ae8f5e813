//! What is not known is visible: by the LED, in STATUSTEXTs and in what ground stations plot.

use crate::common::{MS, SECOND, image, messages, receiver_settings};
use console::Status;
use mavlink_node::client::Message;
use utc_clock::ClockState;
use virtual_pixhawk::{Builder, Connector, Firmware, Pixhawk};
use world::{Receiver, WorldNanos};

/// How long the LED is lit and dark in turn, in ms, from its first change on for two seconds.
fn flashes(board: &mut Pixhawk) -> anyhow::Result<Vec<(bool, u64)>> {
    const STEP_MS: u64 = 10;
    let mut flashes: Vec<(bool, u64)> = Vec::new();
    for _ in 0..300 {
        board.run_for(STEP_MS * MS)?;
        let is_lit = board.is_led_lit()?;
        match flashes.last_mut() {
            Some((was_lit, ms)) if *was_lit == is_lit => *ms += STEP_MS,
            _ => flashes.push((is_lit, STEP_MS)),
        }
    }
    // The first and the last one are cut.
    flashes.pop();
    Ok(flashes.drain(1..).collect())
}

/// Asserts that flashes are those of a pattern: lit and dark in turn, in ms.
fn assert_pattern(flashes: &[(bool, u64)], pattern: &[u64]) {
    assert!(flashes.len() >= pattern.len(), "{flashes:?}");
    let is_as = |from: usize| {
        let expected = pattern.iter().cycle().skip(from);
        flashes
            .iter()
            .zip(expected)
            .enumerate()
            .all(|(nth, (&(is_lit, ms), &expected))| {
                is_lit == (from + nth).is_multiple_of(2) && ms.abs_diff(expected) <= 10
            })
    };
    assert!((0..pattern.len()).any(is_as), "{flashes:?} {pattern:?}");
}

#[test]
fn each_state_has_its_own_flashes() {
    let Some(firmware) = image() else { return };
    let mut settings = receiver_settings();
    settings.cold_start_ns = 4 * SECOND;
    settings.stalls = vec![world::Stall {
        from: WorldNanos(26 * SECOND),
        lasts_ns: 60 * SECOND,
    }];
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(settings))
        .power_on()
        .unwrap();
    for (at_s, state, pattern) in [
        (1, ClockState::Unset, &[100, 100][..]),
        (22, ClockState::Set, &[50, 950]),
        (31, ClockState::Holdover, &[500, 500]),
    ] {
        board.run_to(WorldNanos(at_s * SECOND)).unwrap();
        assert_eq!(
            board
                .clock()
                .map_or(ClockState::Unset, |clock| clock.reading.state),
            state
        );
        assert_pattern(&flashes(&mut board).unwrap(), pattern);
    }
}

#[test]
fn a_second_that_is_not_proved_has_flashes_of_its_own() {
    // The paper's clock proves none.
    let variable = "PIXCLOCK_IMAGE_PAPER_STEP1";
    let Some(firmware) = Firmware::from_variable(variable).unwrap() else {
        return;
    };
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(receiver_settings()))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(6 * SECOND)).unwrap();
    assert_eq!(board.clock().unwrap().reading.state, ClockState::Unproved);
    assert_pattern(&flashes(&mut board).unwrap(), &[50, 200, 50, 700]);
}

#[test]
fn what_is_known_is_reported_when_it_changes_and_plotted_each_second() {
    let Some(firmware) = image() else { return };
    let mut settings = receiver_settings();
    settings.cold_start_ns = 3 * SECOND;
    let mut board = Builder::new(firmware)
        .gps(Receiver::new(settings))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(20 * SECOND + 500 * MS)).unwrap();
    let log = board.take_log().unwrap();
    let sent = messages(&board.take_received(Connector::Telem1).unwrap());

    let texts: Vec<&str> = sent
        .iter()
        .filter_map(|(_, what)| match what {
            Message::StatusText { text, .. } => Some(text.as_str()),
            _ => None,
        })
        .collect();
    let place = |wanted: &str| texts.iter().position(|text| *text == wanted);
    let named = place("GNSS: u-blox 8 SPG 3.01, UBX 18.00");
    assert!(named.is_some() && named < place("clock set"), "{texts:?}");
    let proved = texts
        .iter()
        .position(|text| *text == "clock: second proved");
    assert!(proved.is_some(), "{texts:?}");

    let plotted = |wanted: &str| -> Vec<f32> {
        let values = sent.iter().filter_map(|(_, what)| match what {
            Message::Plotted { name, value } if name.as_str() == wanted => Some(*value),
            _ => None,
        });
        values.collect()
    };
    let uncertainties = plotted("CLK_UNC_NS");
    assert!(uncertainties.len() >= 19, "{uncertainties:?}");
    assert!(uncertainties[1].is_nan(), "not set: {uncertainties:?}");
    let last = uncertainties.last().copied().unwrap();
    assert!((1e3..2e8).contains(&last), "{last}");
    let unproved = plotted("CLK_UNPROV");
    // No second, no pulse, no receiver; and at the end no pulse alone.
    assert_eq!((unproved[1], unproved.last()), (13.0, Some(&4.0)));
    assert_eq!(plotted("CLK_SOURCE").last(), Some(&1.0));
    assert!(plotted("CLK_PPB").last().unwrap().abs() < 100_000.0);

    // A SYSTEM_TIME has UTC from the proof on, and not before.
    let proved_at = log
        .iter()
        .find(|line| line.line.text == "the second is proved")
        .expect("the proof is reported")
        .at;
    for (at, what) in &sent {
        if let Message::SystemTime { time_unix_usec, .. } = what {
            // A frame takes its time.
            let is_after = at.0 > proved_at.0 + 50 * MS;
            assert!(
                is_after || *time_unix_usec == 0 || at.0 > proved_at.0,
                "{at:?}"
            );
            assert!(!is_after || *time_unix_usec > 0, "{at:?}");
        }
    }
    let mut statuses = log.iter().filter_map(|line| Status::parse(&line.line.text));
    let last = statuses.next_back().unwrap();
    assert_eq!(last.get("second"), Some("proved"));
    assert_eq!(last.state(), Some(ClockState::Set));
}
