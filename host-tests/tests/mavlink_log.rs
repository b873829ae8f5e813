//! The log of a node over MAVLink: fetched whole, in gaps, and while it changes.
//!
//! *Design.* Requests are built without the crate or by its client; answers are compared
//! with frames built without it, or understood by the client. The log is a vector here.
//!
//! *Limits.* The log of the board itself: `virtual-pixhawk/tests/board/log.rs`.

mod mavlink_frames;
mod mavlink_line;

use mavlink_frames::Frame;
use mavlink_line::{Board, GROUND, TIME, US, ask, node, note, parsed, polled};
use mavlink_node::client::{Client, Message};
use mavlink_node::{Refusal, RequestKind, Test, Version};
use proptest::prelude::*;

/// The stretches of a log among `messages`: where each begins, and its bytes.
fn stretches(messages: &[Message]) -> Vec<(u32, Vec<u8>)> {
    messages
        .iter()
        .map(|what| match what {
            Message::LogData {
                id: 1,
                offset,
                data,
                count,
            } => (*offset, data[..usize::from(*count)].to_vec()),
            other => panic!("{other:?}"),
        })
        .collect()
}

#[test]
fn the_log_is_listed() {
    for v2 in [false, true] {
        let mut node = node();
        note(
            &mut node,
            &Frame::message(v2, 117, 128, vec![0, 0, 0xff, 0xff, 1, 1]).bytes(),
        );
        let entry = node.poll(&Board::of(6_767)).expect("an entry");
        // u32 time_utc, u32 size, u16 id, u16 num_logs, u16 last_log_num.
        let mut payload = 1_795_320_000_u32.to_le_bytes().to_vec();
        payload.extend(6_767_u32.to_le_bytes());
        payload.extend([1, 0, 1, 0, 1, 0]);
        let expected = Frame {
            system: 1,
            component: 1,
            ..Frame::message(v2, 118, 56, payload)
        };
        assert_eq!(*entry, expected.bytes());
        assert_eq!(
            parsed(&entry),
            Some(Message::LogEntry {
                id: 1,
                logs: 1,
                time_utc: 1_795_320_000,
                size: 6_767
            })
        );
        assert!(!node.has_more());
    }
}

#[test]
fn the_whole_log_comes_in_pieces_of_90_bytes() {
    for version in [Version::V1, Version::V2] {
        for len in [0, 1, 89, 90, 91, 180, 6_767] {
            let board = Board::of(len);
            let mut node = node();
            note(
                &mut node,
                &Client::new(GROUND, version).log_data(US, 0, u32::MAX),
            );
            let pieces = stretches(&polled(&mut node, &board));
            assert_eq!(pieces.len(), len.div_ceil(90).max(1));
            for ((nth, piece), bytes) in (0_u32..).zip(&pieces).zip(board.0.chunks(90)) {
                assert_eq!(*piece, (90 * nth, bytes.to_vec()));
            }
            if len == 0 {
                assert_eq!(pieces, [(0, vec![])], "an empty piece");
            }
        }
    }
}

#[test]
fn what_lies_behind_the_end_is_answered_with_nothing() {
    let board = Board::of(100);
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    for (offset, count) in [(100, 90), (101, 1), (u32::MAX, u32::MAX), (0, 0), (100, 0)] {
        note(&mut node, &client.log_data(US, offset, count));
        assert_eq!(stretches(&polled(&mut node, &board)), [(offset, vec![])]);
    }
    // Another log than number 1, and the status from its middle on.
    let mut payload = [1, 0, 0, 0, 90, 0, 0, 0, 2, 0, 1, 1].to_vec();
    note(
        &mut node,
        &Frame::message(true, 119, 116, payload.clone()).bytes(),
    );
    payload[8] = 0;
    note(&mut node, &Frame::message(true, 119, 116, payload).bytes());
    assert!(!node.has_more());
    assert_eq!(node.counters().unknown, 2);
}

#[test]
fn a_new_request_takes_the_place_of_the_one_before() {
    let board = Board::of(6_767);
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    for nth in 0..5_u32 {
        let frame = node.poll(&board).expect("a piece");
        assert_eq!(stretches(&[parsed(&frame).unwrap()])[0].0, 90 * nth);
    }
    note(&mut node, &client.log_data(US, 90, 100));
    let pieces = stretches(&polled(&mut node, &board));
    assert_eq!(
        pieces,
        [
            (90, board.0[90..180].to_vec()),
            (180, board.0[180..190].to_vec())
        ]
    );
}

#[test]
fn a_transfer_ends_when_that_is_asked_for() {
    let board = Board::of(6_767);
    let mut client = Client::new(GROUND, Version::V1);
    let mut node = node();
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&board).is_some());
    note(&mut node, &client.end_log(US));
    assert!(!node.has_more());

    note(&mut node, &client.log_data(US, 0, u32::MAX));
    let request = ask(&mut node, &client.erase_log(US));
    assert_eq!(request.kind, RequestKind::EraseLog);
    assert!(!node.has_more());
    match parsed(&node.answer(&request, TIME)) {
        Some(Message::StatusText { severity: 5, text }) => assert_eq!(text.as_str(), "log erased"),
        other => panic!("{other:?}"),
    }

    note(&mut node, &client.log_data(US, 0, u32::MAX));
    let mut begin = ask(&mut node, &client.test(US, Test::Begins));
    // Refused, as over samples that are not saved, it leaves the transfer alone.
    if let RequestKind::Command(command) = &mut begin.kind {
        command.meaning = Err(Refusal::NotYet);
    }
    node.answer(&begin, TIME);
    assert!(node.has_more());
    let begin = ask(&mut node, &client.test(US, Test::Begins));
    node.answer(&begin, TIME);
    assert!(!node.has_more());

    // The end of a test does not end it: the log does not change by that.
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    ask(&mut node, &client.test(US, Test::Ends));
    assert!(node.has_more());
}

#[test]
fn a_log_may_grow_or_shrink_while_it_is_sent() {
    let mut board = Board::of(200);
    let mut client = Client::new(GROUND, Version::V2);
    let mut node = node();
    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&board).is_some());
    board = Board::of(300);
    let pieces = stretches(&polled(&mut node, &board));
    let bytes: Vec<u8> = pieces.into_iter().flat_map(|(_, bytes)| bytes).collect();
    assert_eq!(bytes, board.0[90..]);

    note(&mut node, &client.log_data(US, 0, u32::MAX));
    assert!(node.poll(&board).is_some());
    assert_eq!(
        stretches(&polled(&mut node, &Board::of(10))),
        [(90, vec![])]
    );
}

proptest! {
    /// A line that loses frames: a client that asks again for what is missing has it all in the
    /// end.
    #[test]
    fn a_log_with_gaps_is_completed(
        len in 1..5_000_usize,
        lost in prop::collection::vec(any::<bool>(), 64),
        v2: bool,
    ) {
        let board = Board::of(len);
        let version = if v2 { Version::V2 } else { Version::V1 };
        let mut client = Client::new(GROUND, version);
        let mut node = node();
        let mut copy = vec![None; len];
        let mut losses = lost.into_iter().cycle();
        let mut has_lost = [false; 2];
        for round in 0.. {
            prop_assert!(round < 500);
            let Some(from) = copy.iter().position(Option::is_none) else { break };
            let missing = copy[from..].iter().take_while(|byte| byte.is_none()).count();
            note(&mut node, &client.log_data(US, from as u32, missing as u32));
            for (offset, bytes) in stretches(&polled(&mut node, &board)) {
                // Each piece is lost in the first rounds, if at all.
                let is_lost = round < 40 && losses.next() == Some(true);
                has_lost[usize::from(is_lost)] = true;
                if !is_lost {
                    for (place, byte) in copy[offset as usize..].iter_mut().zip(bytes) {
                        *place = Some(byte);
                    }
                }
            }
        }
        let copy: Vec<u8> = copy.into_iter().flatten().collect();
        prop_assert_eq!(copy, board.0);
    }
}

/// The text of the status in `messages`, whose pieces follow each other.
fn status(messages: &[Message]) -> String {
    let mut text = Vec::new();
    for (nth, what) in messages.iter().enumerate() {
        let Message::LogData {
            id: Client::STATUS,
            offset,
            data,
            count,
        } = what
        else {
            panic!("{what:?}");
        };
        assert_eq!(*offset as usize, text.len());
        let is_last = nth + 1 == messages.len();
        assert_eq!(*count < 90, is_last, "a piece that is not full is the last");
        text.extend(&data[..usize::from(*count)]);
    }
    String::from_utf8(text).expect("ASCII")
}

#[test]
fn the_status_is_a_text_of_whole_words() {
    for version in [Version::V1, Version::V2] {
        for counters in [0, 1, 2, 3, 4, 5, 6, 50, 200] {
            let mut node = node();
            let mut client = Client::new(GROUND, version);
            note(&mut node, &client.status(US));
            let board = Board::of(counters);
            let mut expected =
                "status state=set utc=2026-01T07Z unc_ns=18446744073709551615 ppb=-120 \
                                why=no_card "
                    .to_owned();
            for nth in (0..counters).filter(|nth| nth % 251 % 3 != 0) {
                let count = nth as u64 % 251 % 3 * 1_000_000_007;
                expected += &format!("counter_{nth}={count} ");
            }
            assert_eq!(status(&polled(&mut node, &board)), expected);
        }
    }
}

#[test]
fn a_status_begins_anew_when_it_is_asked_for_again_and_leaves_the_log_alone() {
    let board = Board::of(300);
    let mut node = node();
    let mut client = Client::new(GROUND, Version::V2);
    note(&mut node, &client.log_data(US, 0, 100));
    note(&mut node, &client.status(US));
    assert!(node.poll(&board).is_some());
    note(&mut node, &client.status(US));
    let messages = polled(&mut node, &board);
    let (of_status, of_log) = messages.split_at(messages.len() - 2);
    assert!(status(of_status).starts_with("status state=set "));
    assert_eq!(
        stretches(of_log),
        [(0, board.0[..90].to_vec()), (90, board.0[90..100].to_vec())]
    );
}
