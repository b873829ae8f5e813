//! Real receivers' bytes, from the line to the clock.
//!
//! *Design.* A recording is replayed at 115200 as `world` does it, byte by byte
//! with its stamp, through `ubx-link` into the clock of a `board-model`. The claims of
//! the receiver are read from the file by other code than that under test.
//!
//! *Limits.* Skipped, with a message, where `PIXCLOCK_CAPTURES` is not set.

use board_model::Board;
use host_tests::captures;
use timebase::{StampedByte, TimeMark};
use ubx_link::{Event, Link};
use utc_clock::{ClockState, Outcome, Refusal, Settings, UtcNanos};
use world::{Recording, Talker, ubx};

/// 2020-01-01T00:00:00Z. [s]
const EARLIEST_S: i64 = 1_577_836_800;

/// Each mark of the recording with what it did to the clock.
fn replay(file: &[u8], board: &mut Board) -> Vec<(TimeMark, Outcome)> {
    let mut talker = Recording::new(file).expect("it holds NAV-PVT");
    let mut link = Link::new();
    let mut outcomes = Vec::new();
    while let Some(due) = talker.next_event() {
        while let Some(sent) = talker.poll(due) {
            // The task drains its ring every few ms.
            for (chunk, bytes) in sent.bytes.chunks(64).enumerate() {
                let end_of = |index: usize| i64::try_from(sent.byte_end(index).0).expect("short");
                board.pass_until(end_of(chunk * 64 + bytes.len() - 1));
                let stamped = (chunk * 64..).zip(bytes).map(|(index, byte)| StampedByte {
                    stamp: board.cycles(end_of(index)).stamp(),
                    byte: *byte,
                });
                link.push(&stamped.collect::<Vec<_>>());
                let now = board.cycles(board.now_ns);
                let marks: Vec<_> = std::iter::from_fn(|| link.poll(now)).collect();
                for event in marks {
                    if let Event::NavPvt { mark, .. } = event {
                        outcomes.push((mark, board.handle_mark(&mark)));
                    }
                }
            }
        }
    }
    outcomes
}

#[test]
fn a_cold_start_sets_the_clock_when_the_receiver_is_sure_and_not_before() {
    let Some(file) = captures::file("ubx-nav-solutions/coldstart-first-400kB.ubx") else {
        return;
    };
    let valid: Vec<u8> = ubx::find_frames(&file, |class, id, length| {
        (class, id) == ubx::NAV_PVT && length == ubx::NAV_PVT_LEN
    })
    .iter()
    .map(|frame| frame.payload[11])
    .collect();
    let sure = valid.iter().position(|valid| *valid == 0xf7);
    assert_eq!(sure, Some(50), "of {} epochs", valid.len());

    // Recorded before the dates that a release of today believes.
    let settings = Settings {
        date_floor: UtcNanos(EARLIEST_S * 1_000_000_000),
        ..Settings::DEFAULT
    };
    let mut board = Board::new(settings, 0.0);
    let outcomes = replay(&file, &mut board);
    assert_eq!(outcomes.len(), valid.len());
    let set = outcomes
        .iter()
        .position(|(_, outcome)| *outcome == Outcome::Set);
    println!("set at epoch {set:?} of {}", outcomes.len());
    assert_eq!(set, sure);
    for (_, outcome) in &outcomes[..50] {
        assert!(matches!(
            outcome,
            Outcome::Refused(Refusal::Date | Refusal::Time | Refusal::Unresolved)
        ));
    }
    for (_, outcome) in &outcomes[51..] {
        // Each of its marks has waited for a second's other messages, some 40 ms more than others.
        let is_well = match outcome {
            Outcome::Slewed { .. } => true,
            Outcome::Stepped { by_ns } => by_ns.abs() < 50_000_000,
            outcome => *outcome == Outcome::Refused(Refusal::Waited),
        };
        assert!(is_well, "{outcome:?}");
    }
    let reading = board.read();
    assert_ne!(reading.state, ClockState::Unset);
    // What they have waited is in the uncertainty.
    assert!(reading.uncertainty_ns > 390_000_000, "{reading:?}");
}
