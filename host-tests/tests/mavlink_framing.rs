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

/// Id, CRC_EXTRA, length in MAVLink 1 if it is wanted there, lengths in MAVLink 2: up
/// to the target's system at least.
const KINDS: [(u8, u8, Option<usize>, std::ops::RangeInclusive<usize>); 11] = [
    (4, 237, Some(14), 1..=14),
    (111, 34, Some(16), 1..=18),
    (76, 152, Some(33), 31..=33),
    (75, 158, Some(35), 31..=35),
    // PARAM_REQUEST_READ, _LIST, PARAM_SET.
    (20, 214, None, 3..=20),
    (21, 159, Some(2), 1..=2),
    (23, 168, None, 5..=23),
    // LOG_REQUEST_LIST, _DATA, LOG_ERASE, LOG_REQUEST_END.
    (117, 128, Some(6), 5..=6),
    (119, 116, Some(12), 11..=12),
    (121, 237, Some(2), 1..=2),
    (122, 203, Some(2), 1..=2),
];

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

/// Every window that is an intact frame, from the left.
fn intact_windows(stream: &[u8]) -> Vec<Found> {
    (0..stream.len())
        .filter_map(|start| intact_at(stream, start))
        .collect()
}

fn intact_at(stream: &[u8], start: usize) -> Option<Found> {
    let at = |n: usize| stream.get(start + n).copied();
    let len = usize::from(at(1)?);
    let (header, id, signed) = match at(0)? {
        0xfe => (6, at(5)?, false),
        0xfd if at(2)? <= 1 && at(8)? == 0 && at(9)? == 0 => (10, at(7)?, at(2)? == 1),
        _ => return None,
    };
    let (_, extra, v1, v2) = KINDS.iter().find(|kind| kind.0 == id)?;
    let possible = if header == 6 {
        Some(len) == *v1
    } else {
        v2.contains(&len)
    };
    let end = start + header + len;
    let sum = stream.get(end..end + 2)?;
    let mut covered = stream[start + 1..end].to_vec();
    covered.push(*extra);
    (possible && sum == mavlink_frames::crc(&covered).to_le_bytes()).then_some(Found {
        start,
        length: header + len + 2,
        signed,
    })
}

/// Takes windows in the order that they have, without overlap.
fn without_overlap(windows: Vec<Found>) -> Vec<Found> {
    let mut free_from = 0;
    windows
        .into_iter()
        .filter(|window| {
            let free = window.start >= free_from;
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
    without_overlap(windows)
}

fn from_the_left(stream: &[u8]) -> Vec<Found> {
    without_overlap(intact_windows(stream))
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
            assert_eq!(&frame.payload[..payload.len()], payload);
            assert!(frame.payload[payload.len()..].iter().all(|&byte| byte == 0));
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
        vec(any::<u8>(), 35),
        any::<u8>(),
    )
        .prop_map(
            |(kind, v2, [sequence, system, component, ..], mut payload, trim)| {
                let (id, extra, v1, lengths) = KINDS[kind].clone();
                let of_v2 =
                    lengths.start() + usize::from(trim) % (lengths.end() - lengths.start() + 1);
                let (v2, len) = match v1 {
                    Some(len) if !v2 => (false, len),
                    _ => (true, of_v2),
                };
                payload.truncate(len);
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
        let frame = Frame { flags: 0, ..frame }.bytes();
        let stream = [noise, frame.clone()].concat();
        // The noise may end a byte before what is, with this frame's magic, intact.
        prop_assume!(intact_windows(&stream).len() == 1);
        let last = framed(&stream).pop();
        let start = stream.len() - frame.len();
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
                let inner_len = inner.2.unwrap_or(*inner.3.end());
                let header =
                    Frame::message(false_v2, inner.0.into(), 0, vec![1; inner_len]).bytes();
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
        (&[0xfe, 0xfd, 2, 12, 4, 20, 21, 23, 119, 0], 5),
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
    assert!((330..=334).contains(&worst.0), "{worst:?}");
    assert_eq!(worst.1.len() % 3, 0, "{worst:?}");
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
        assert!(best <= 334, "{best} candidates: {pattern:02x?}");
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
