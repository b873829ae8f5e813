//! The framer against a brute force, on streams made to mislead it.
//!
//! *Purpose.* Whatever the stream and however it is cut, exactly the frames come
//! out that a search over every offset finds.
//!
//! *Design.* The brute force shares no code with the crate: its own table of
//! kinds, its own bitwise checksum, every window looked at. Two orders of taking:
//! by end, which is what the framer promises, and from the left, which is the same
//! as long as no intact frame lies inside another. The cost of noise is bounded by
//! what can be counted from outside: candidates that were checked in vain.
//!
//! *Limits.* Instructions are counted on the board (`cargo xtask bench`).

mod mavlink_frames;

use mavlink_frames::{Frame, SIGNED};
use mavlink_node::Requests;
use mavlink_node::framer::Framer;
use proptest::collection::vec;
use proptest::prelude::*;
use timebase::{Stamp, StampedByte};

/// A kind of frame that is wanted.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    id: u8,
    extra: u8,
    /// The length of its payload in MAVLink 1, if it is wanted there.
    v1: Option<usize>,
    /// The least and the greatest that is defined in MAVLink 2: up to the target's system at
    /// least. A later definition may be longer.
    v2: (usize, usize),
    /// It changes something.
    is_guarded: bool,
}

const fn wanted_kind(id: u8, extra: u8, v1: Option<usize>, v2: (usize, usize)) -> Wanted {
    let is_guarded = matches!(id, 76 | 75 | 23 | 119 | 121 | 122);
    Wanted {
        id,
        extra,
        v1,
        v2,
        is_guarded,
    }
}

const KINDS: [Wanted; 13] = [
    wanted_kind(4, 237, Some(14), (1, 14)),
    wanted_kind(111, 34, Some(16), (1, 18)),
    wanted_kind(76, 152, Some(33), (31, 33)),
    wanted_kind(75, 158, Some(35), (31, 35)),
    // PARAM_REQUEST_READ, _LIST, PARAM_SET.
    wanted_kind(20, 214, Some(20), (3, 20)),
    wanted_kind(21, 159, Some(2), (1, 2)),
    wanted_kind(23, 168, Some(23), (5, 23)),
    // LOG_REQUEST_LIST, _DATA, LOG_ERASE, LOG_REQUEST_END.
    wanted_kind(117, 128, Some(6), (5, 6)),
    wanted_kind(119, 116, Some(12), (11, 12)),
    wanted_kind(121, 237, Some(2), (1, 2)),
    wanted_kind(122, 203, Some(2), (1, 2)),
    // MISSION_REQUEST_LIST, FILE_TRANSFER_PROTOCOL.
    wanted_kind(43, 132, Some(2), (1, 3)),
    wanted_kind(110, 84, None, (2, 254)),
];

/// Bytes of a payload that are handed over.
const KNOWN: usize = 35;

/// A frame that was found: where it starts, how long it is, whether signed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Found {
    start: usize,
    length: usize,
    signed: bool,
}

impl Found {
    /// The first offset after it, its signature included.
    fn free_from(self) -> usize {
        self.start + self.length + if self.signed { 13 } else { 0 }
    }
}

/// A header at some offset: how long its frame is, its kind if that is wanted, whether it is signed.
fn header_at(stream: &[u8], start: usize) -> Option<(usize, Option<Wanted>, bool)> {
    let at = |n: usize| stream.get(start + n).copied();
    let len = usize::from(at(1)?);
    let (header, id, signed) = match at(0)? {
        0xfe => (6, Some(at(5)?), false),
        0xfd if at(2)? <= 1 => {
            let id = (at(8)? == 0 && at(9)? == 0).then_some(at(7)?);
            (10, id, at(2)? == 1)
        }
        _ => return None,
    };
    let is_possible = |kind: &Wanted| match header {
        6 => kind.v1.is_some_and(|least| len >= least),
        _ => len >= kind.v2.0,
    };
    let is_ambiguous = header == 6 && Some(at(1)?) == id && [0xfd, 0xfe].contains(&at(4)?);
    let kind = KINDS
        .into_iter()
        .find(|kind| Some(kind.id) == id && !is_ambiguous);
    Some((header + len + 2, kind.filter(is_possible), signed))
}

/// Every window that is an intact frame, from the left.
fn intact_windows(stream: &[u8]) -> Vec<Found> {
    (0..stream.len())
        .filter_map(|start| intact_at(stream, start))
        .collect()
}

fn intact_at(stream: &[u8], start: usize) -> Option<Found> {
    let (length, kind, signed) = header_at(stream, start)?;
    let end = start + length - 2;
    let sum = stream.get(end..end + 2)?;
    let mut covered = stream[start + 1..end].to_vec();
    covered.push(kind?.extra);
    (sum == mavlink_frames::crc(&covered).to_le_bytes()).then_some(Found {
        start,
        length,
        signed,
    })
}

/// Whether a reader that takes one frame after the other, and has `stream` so far, is inside of
/// a frame at `offset`, or does not know yet.
fn is_claimed(stream: &[u8], offset: usize) -> bool {
    let mut at = 0;
    while at < offset {
        at += match header_at(stream, at) {
            None => 1,
            Some((length, kind, signed)) => {
                let whole = length + if signed { 13 } else { 0 };
                if kind.is_none() || intact_at(stream, at).is_some() {
                    whole
                } else if at + length <= stream.len() {
                    1
                } else {
                    return true;
                }
            }
        };
    }
    at > offset
}

/// Takes windows in the order that they have, without overlap, and what changes something outside
/// of claims only.
fn without_overlap(stream: &[u8], windows: Vec<Found>) -> Vec<Found> {
    let mut free_from = 0;
    windows
        .into_iter()
        .filter(|window| {
            let (_, kind, _) = header_at(stream, window.start).expect("a header");
            let is_guarded = kind.is_some_and(|kind| kind.is_guarded);
            let so_far = &stream[..window.start + window.length];
            let free =
                window.start >= free_from && !(is_guarded && is_claimed(so_far, window.start));
            if free {
                free_from = window.free_from();
            }
            free
        })
        .collect()
}

fn by_end(stream: &[u8]) -> Vec<Found> {
    let mut windows = intact_windows(stream);
    windows.sort_by_key(|window| (window.start + window.length, window.start));
    without_overlap(stream, windows)
}

fn from_the_left(stream: &[u8]) -> Vec<Found> {
    without_overlap(stream, intact_windows(stream))
}

fn any_is_inside_another(stream: &[u8]) -> bool {
    let windows = intact_windows(stream);
    windows.windows(2).any(|pair| {
        let ends = [pair[0], pair[1]].map(|window| window.start + window.length);
        ends[1] <= ends[0]
    })
}

/// What the framer finds; the stamps are the offsets, so that a frame's stamp is
/// where its first byte was.
fn framed(stream: &[u8]) -> Vec<Found> {
    let mut framer = Framer::<Requests>::new();
    let mut found = Vec::new();
    for (offset, &byte) in (0..).zip(stream) {
        let length = framer.push(StampedByte {
            stamp: Stamp(offset),
            byte,
        });
        if length != 0 {
            let frame = framer.take(length);
            let start = offset as usize + 1 - usize::from(length);
            assert_eq!(
                frame.stamp,
                Stamp(start as u32),
                "the stamp of the first byte"
            );
            let header = if stream[start] == 0xfe { 6 } else { 10 };
            let payload = &stream[start + header..offset as usize - 1];
            let known = payload.len().min(KNOWN);
            assert_eq!(frame.payload[..known], payload[..known]);
            assert!(frame.payload[known..].iter().all(|&byte| byte == 0));
            found.push(Found {
                start,
                length: usize::from(length),
                signed: frame.signed,
            });
        }
    }
    let counters = framer.counters();
    assert_eq!(counters.frames as usize, found.len());
    let framed_bytes: usize = found.iter().map(|frame| frame.length).sum();
    assert_eq!(counters.foreign_bytes as usize, stream.len() - framed_bytes);
    found
}

/// A frame of a wanted kind with anything in it.
fn wanted() -> impl Strategy<Value = Frame> {
    (
        0..KINDS.len(),
        any::<bool>(),
        any::<[u8; 5]>(),
        vec(any::<u8>(), 255),
        any::<u8>(),
        prop_oneof![6 => Just(0), 1 => 1..255_usize],
    )
        .prop_map(
            |(kind, v2, [sequence, system, component, ..], mut payload, trim, more)| {
                let Wanted {
                    id,
                    extra,
                    v1,
                    v2: (least, most),
                    ..
                } = KINDS[kind];
                let of_v2 = least + usize::from(trim) % (most - least + 1);
                let (v2, len) = match v1 {
                    Some(len) if !v2 => (false, len),
                    _ => (true, of_v2),
                };
                payload.truncate(len + more);
                Frame {
                    v2,
                    flags: if v2 && trim > 200 { SIGNED } else { 0 },
                    sequence,
                    system,
                    component,
                    id: id.into(),
                    extra,
                    payload,
                }
            },
        )
}

/// Bytes that look like the beginnings of frames.
fn misleading() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop::sample::select(
        &[
            0xfe, 0xfd, 14, 16, 33, 35, 4, 111, 76, 75, 2, 6, 12, 20, 21, 23, 117, 121, 0, 1, 200,
        ][..],
    );
    let header = wanted().prop_map(|frame| {
        let bytes = frame.bytes();
        bytes[..bytes.len().min(12)].to_vec()
    });
    prop_oneof![vec(byte, 0..40), header]
}

/// A frame, whole, cut short, damaged or with another one inside.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        4 => wanted().prop_map(|frame| frame.bytes()),
        2 => (wanted(), any::<u8>()).prop_map(|(frame, cut)| {
            let bytes = frame.bytes();
            bytes[..usize::from(cut) % bytes.len()].to_vec()
        }),
        2 => (wanted(), any::<u16>()).prop_map(|(frame, bit)| {
            let mut bytes = frame.bytes();
            let bit = usize::from(bit) % (8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
            bytes
        }),
        3 => misleading(),
        1 => vec(any::<u8>(), 0..60),
    ]
}

/// A command whose parameters are themselves a whole frame.
fn nested() -> impl Strategy<Value = Vec<u8>> {
    (wanted(), wanted(), 0..10_usize).prop_map(|(mut outer, inner, at)| {
        let inner = inner.bytes();
        let room = outer.payload.len().saturating_sub(at);
        if inner.len() <= room {
            outer.payload[at..at + inner.len()].copy_from_slice(&inner);
        }
        outer.bytes()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn finds_what_a_search_over_every_offset_finds(pieces in vec(piece(), 0..12)) {
        let stream = pieces.concat();
        let found = framed(&stream);
        prop_assert_eq!(&found, &by_end(&stream));
        // One damaged frame in 65 536 is intact by chance, perhaps around another.
        if !any_is_inside_another(&stream) {
            prop_assert_eq!(&found, &from_the_left(&stream));
        }
    }

    #[test]
    fn an_inner_frame_does_not_wait_for_an_outer_one(
        pieces in vec(prop_oneof![nested(), piece()], 0..8),
    ) {
        let stream = pieces.concat();
        prop_assert_eq!(framed(&stream), by_end(&stream));
    }

    #[test]
    fn nothing_panics(stream in vec(any::<u8>(), 0..2_000)) {
        prop_assert_eq!(framed(&stream), by_end(&stream));
    }

    #[test]
    fn a_frame_comes_out_at_its_last_byte_whatever_began_before(
        noise in misleading(),
        frame in wanted(),
    ) {
        let id = frame.id;
        let frame = Frame { flags: 0, ..frame }.bytes();
        let stream = [noise, frame.clone()].concat();
        // The noise may end a byte before what is, with this frame's magic, intact.
        prop_assume!(intact_windows(&stream).len() == 1);
        // What changes something waits for its client to repeat it.
        let start = stream.len() - frame.len();
        let guarded = KINDS.iter().any(|kind| kind.is_guarded && u32::from(kind.id) == id);
        prop_assume!(!(guarded && is_claimed(&stream, start)));
        let last = framed(&stream).pop();
        prop_assert_eq!(last, Some(Found { start, length: frame.len(), signed: false }));
    }
}

#[test]
fn a_false_header_anywhere_in_a_frame_does_it_no_harm() {
    for (v2, id, extra, len) in [
        (false, 75, 158, 35),
        (true, 75, 158, 35),
        (true, 76, 152, 33),
        (true, 4, 237, 14),
    ] {
        for (at, false_v2) in (0..len).flat_map(|at| [(at, false), (at, true)]) {
            for inner in KINDS {
                let mut payload = vec![0x55; len];
                let inner_len = inner.v1.unwrap_or(inner.v2.1);
                let header =
                    Frame::message(false_v2, inner.id.into(), 0, vec![1; inner_len]).bytes();
                for (place, byte) in payload[at..len - 1].iter_mut().zip(&header[..10]) {
                    *place = *byte;
                }
                let frame = Frame::message(v2, id, extra, payload).bytes();
                // Its stamp is compared, too.
                assert_eq!(framed(&frame).len(), 1, "{inner:?} at {at} in {frame:02x?}");
            }
        }
    }
}

/// Most candidates a thousand bytes of `pattern` repeated: each one is checked in
/// vain at its end.
fn checked_in_vain(pattern: &[u8]) -> u32 {
    let mut framer = Framer::<Requests>::new();
    let mut count = || {
        for &byte in pattern.iter().cycle().take(1_000) {
            let stamp = Stamp(0);
            if framer.push(StampedByte { stamp, byte }) != 0 {
                return None;
            }
        }
        Some(framer.counters().crc_failures)
    };
    // The first thousand fill the windows; a pattern with intact frames is no noise.
    let first = count();
    first.and_then(|first| Some(count()? - first)).unwrap_or(0)
}

#[test]
fn the_worst_noise_has_one_candidate_in_three_bytes() {
    // Every short pattern of the bytes that can be part of a header: of one length and
    // one id for each version, then of those that are lengths and ids.
    let mut worst = (0, Vec::new());
    for (bytes, longest) in [
        (&[0xfe, 0xfd, 14, 16, 4, 111, 0][..], 6),
        (&[0xfe, 0xfd, 2, 12, 4, 20, 21, 23, 119, 200, 0], 5),
    ] {
        for period in 1..=longest {
            for number in 0..bytes.len().pow(period) {
                let pattern: Vec<u8> = (0..period)
                    .map(|place| bytes[number / bytes.len().pow(place) % bytes.len()])
                    .collect();
                worst = worst.max((checked_in_vain(&pattern), pattern));
            }
        }
    }
    // Beside it there are the few that are longer than known.
    assert!((330..=400).contains(&worst.0), "{worst:?}");
    println!("{worst:?}");
}

#[test]
fn longer_patterns_are_no_worse() {
    // A search that keeps what it cannot better: random changes to random
    // patterns, with a fixed seed.
    let bytes = [
        0xfe, 0xfd, 14, 16, 33, 35, 4, 111, 76, 75, 2, 6, 12, 20, 21, 23, 117, 119, 122, 0, 1, 0x55,
    ];
    let mut random = fastrand::Rng::with_seed(0x6d61_766c);
    for _ in 0..60 {
        let mut pattern: Vec<u8> = (0..random.usize(7..40))
            .map(|_| bytes[random.usize(..bytes.len())])
            .collect();
        let mut best = checked_in_vain(&pattern);
        for _ in 0..600 {
            let mut changed = pattern.clone();
            for _ in 0..random.usize(1..4) {
                let place = random.usize(..changed.len());
                changed[place] = bytes[random.usize(..bytes.len())];
            }
            let count = checked_in_vain(&changed);
            if count >= best {
                (best, pattern) = (count, changed);
            }
        }
        assert!(best <= 400, "{best} candidates: {pattern:02x?}");
    }
}

#[test]
fn what_has_begun_can_be_given_up() {
    let mut framer = Framer::<Requests>::new();
    let ping = Frame::ping(true, 0, 1).bytes();
    let (head, tail) = ping.split_at(12);
    let feed = |framer: &mut Framer<Requests>, bytes: &[u8]| {
        let mut stamped = (1..).map(Stamp).zip(bytes);
        stamped.any(|(stamp, &byte)| framer.push(StampedByte { stamp, byte }) != 0)
    };
    assert_eq!(framer.newest(), None);
    assert!(!feed(&mut framer, head));
    assert_eq!(framer.newest(), Some(Stamp(12)));
    framer.give_up();
    assert_eq!(framer.newest(), None);
    assert_eq!(framer.counters().abandoned, 1);
    assert!(!feed(&mut framer, tail));
    framer.give_up();
    framer.give_up();
    assert_eq!(
        framer.counters().abandoned,
        1,
        "what was given up is counted once"
    );
    assert!(feed(&mut framer, &ping), "and the next frame is found");
}

#[test]
fn unknown_flags_drop_a_frame_and_are_counted() {
    let mut framer = Framer::<Requests>::new();
    let mut frame = Frame::ping(true, 0, 1);
    for flags in [0x02, 0x80, 0x03] {
        frame.flags = flags;
        for byte in frame.bytes() {
            assert_eq!(
                framer.push(StampedByte {
                    stamp: Stamp(0),
                    byte
                }),
                0
            );
        }
    }
    assert_eq!(framer.counters().unknown_flags, 3);
}

#[test]
fn a_signature_hides_nothing_and_is_no_beginning() {
    // A signature that is full of magics, then a frame at once.
    let mut signed = Frame::ping(true, 7, 1);
    signed.flags = SIGNED;
    let mut stream = signed.bytes();
    let end = stream.len();
    stream[end - 13..].copy_from_slice(&[0xfe, 14, 0, 0, 0, 4, 0xfd, 14, 0, 0, 0, 0xfe, 0xfd]);
    stream.extend(Frame::ping(false, 8, 1).bytes());
    let found = framed(&stream);
    assert_eq!(found.len(), 2);
    assert!(found[0].signed && !found[1].signed);
    assert_eq!(found, by_end(&stream));
}

/// The commands of row 7: a LOG_ERASE in a TUNNEL to system 42.
const ERASE_IN_TUNNEL: [u8; 27] = [
    0xfd, 0x0f, 0, 0, 0, 0xff, 0, 0x81, 1, 0, 0, 0, 0x2a, 1, 0x0a, 0xfe, 2, 0, 0xff, 0, 0x79, 1, 1,
    0, 0x56, 0x3a, 0x35,
];

#[test]
fn what_changes_something_is_not_obeyed_inside_of_another_message() {
    let inner = Frame::message(false, 121, 237, vec![1, 1]).bytes();
    let tunnel = |inner: &[u8]| {
        let payload = [&[0, 0, 42, 1, 10], inner, &[7]].concat();
        Frame::message(true, 0x181, 147, payload).bytes()
    };
    assert_eq!(framed(&inner).len(), 1);
    for stream in [ERASE_IN_TUNNEL.to_vec(), tunnel(&inner)] {
        assert_eq!(framed(&stream), []);
        // Behind it is another matter.
        let behind = [stream.clone(), inner.clone()].concat();
        assert_eq!(framed(&behind).len(), 1);
        // So is a PING in it, which changes nothing.
        let ping = Frame::ping(true, 1, 0).bytes();
        assert_eq!(framed(&tunnel(&ping)).len(), 1);
        assert_eq!(
            framed(&[tunnel(&[ping, inner.clone()].concat())].concat()).len(),
            1
        );
    }
}

#[test]
fn a_claim_ends_with_its_length_its_checksum_or_the_silence_of_the_line() {
    let command = Frame::command_long(true, 512, [1, 1]).bytes();
    let erase = Frame::message(false, 121, 237, vec![1, 1]).bytes();
    // Half a PING: its checksum fails before a command's last byte, and behind an erasing.
    let half = &Frame::ping(false, 1, 0).bytes()[..6];
    assert_eq!(framed(&[half, &command].concat()).len(), 1);
    assert_eq!(framed(&[half, &erase].concat()), []);
    assert_eq!(framed(&[half, &erase, &erase].concat()).len(), 1);
    // A kind that is not known claims what it says.
    let unknown = [0xfe, 60, 0, 1, 1, 30];
    assert_eq!(framed(&[&unknown[..], &command].concat()), []);
    assert_eq!(
        framed(&[&unknown[..], &[0; 62], &command].concat()).len(),
        1
    );
    // And nothing behind a silence.
    let mut framer = Framer::<Requests>::new();
    let lengths = |bytes: &[u8], framer: &mut Framer<Requests>| {
        let stamp = Stamp(0);
        let pushed = bytes.iter();
        pushed
            .map(|&byte| framer.push(StampedByte { stamp, byte }))
            .max()
    };
    assert_eq!(lengths(&unknown, &mut framer), Some(0));
    assert_eq!(lengths(&erase, &mut framer), Some(0));
    assert_eq!(framer.counters().claimed, 1);
    framer.give_up();
    assert_eq!(lengths(&erase, &mut framer), Some(10));
}

#[test]
fn a_payload_that_is_longer_than_known_is_read_by_its_known_part() {
    for len in 15..=255 {
        for v2 in [false, true] {
            let Frame { payload, .. } = Frame::ping(false, 7, 0);
            let mut payload = payload;
            payload.resize(len, 0xfe);
            let frame = Frame::message(v2, 4, 237, payload).bytes();
            // Behind headers of other long ones, fewer than there is room for.
            let others = [0xfe, 255, 0, 0, 0, 4].repeat(2);
            let stream = [others, frame.clone()].concat();
            let found = framed(&stream);
            assert_eq!(found.len(), 1, "{len}");
            assert_eq!(found[0].length, frame.len());
        }
    }
    // A TIMESYNC of MAVLink 1 with its targets, as node-mavlink sends it.
    let timesync = [
        0xfe, 0x12, 0, 0xff, 0xbe, 0x6f, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        0x48, 0x16,
    ];
    assert_eq!(framed(&timesync).len(), 1);
}
