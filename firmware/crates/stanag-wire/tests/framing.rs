//! The framer of serial lines beside a judge that tries every window of the stream.

use stanag_wire::{Framer, Header, Layout, NodeId, Sum, Wanted};
use timebase::{Stamp, StampedByte};

const US: NodeId = NodeId(0x0050_4301);
const STATION: NodeId = NodeId(0x0050_5F01);

/// A heartbeat, a request for a message, one for the time, a parameter.
const TABLE: [(u16, Layout); 4] = [
    (16_002, layout(1, &[5])),
    (17_002, layout(1, &[5, 2, 2, 2, 2, 5, 3, 2])),
    (52_000, layout(1, &[5, 3, 4])),
    (
        1,
        layout(3, &[5, 4, 4, 2, 2, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 2, 1, 2]),
    ),
];

const fn layout(vector: u8, sizes: &'static [u8]) -> Layout {
    Layout { vector, sizes }
}

struct Table;

impl Wanted for Table {
    fn layout(message: u16) -> Option<&'static Layout> {
        let mut rows = TABLE.iter();
        rows.find_map(|(number, layout)| (*number == message).then_some(layout))
    }
}

/// Numbers that look random.
struct Draw(u64);

impl Draw {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) as usize % limit
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.below(256) as u8).collect()
    }
}

/// A good frame of one of the wanted messages, with any of its fields.
fn frame(draw: &mut Draw) -> Vec<u8> {
    let (message, layout) = TABLE[draw.below(TABLE.len())];
    let mut data = vec![0; layout.vector.into()];
    for (field, &size) in layout.sizes.iter().enumerate() {
        if draw.below(2) == 0 {
            let byte = data.len().min(layout.vector.into()) - 1 - field / 8;
            data[byte] |= 1 << (field % 8);
            data.extend(draw.bytes(size.into()));
        }
    }
    let header = Header {
        source: STATION,
        destination: [US, NodeId::BROADCAST][draw.below(2)],
        message,
        wants_acknowledgement: draw.below(2) == 0,
        idd: Header::EDITION_3,
        sum: [Sum::Bytes2, Sum::Bytes4][draw.below(2)],
    };
    let mut out = [0; 80];
    let length = header.write(&data, &mut out).expect("it has room");
    out[..length].to_vec()
}

fn found(framer: &mut Framer<Table>, stream: &[u8], from: u32) -> Vec<(u32, Vec<u8>)> {
    let mut frames = Vec::new();
    for (&byte, at) in stream.iter().zip(from..) {
        let stamp = Stamp(at);
        let length = framer.push(StampedByte { stamp, byte });
        if length > 0 {
            let mut bytes = vec![0; length];
            let first = framer.take(length, &mut bytes);
            frames.push((first.0, bytes));
        }
    }
    frames
}

/// Whether these bytes are one whole frame that can be believed, by the rules' words.
fn is_frame(window: &[u8]) -> bool {
    let number = |bytes: &[u8]| bytes.iter().fold(0, |n, &it| n << 8 | u64::from(it));
    if window.len() < 17 || window[..2] != [0xFF, 0xFF] {
        return false;
    }
    let length = number(&window[2..4]) as usize;
    let is_for_us = [US.0, 0xFFFF_FFFF].contains(&(number(&window[8..12]) as u32));
    let properties = number(&window[14..16]) & 0x7FFF;
    let sum = match properties {
        0x1E40 => 2,
        0x1E80 => 4,
        _ => return false,
    };
    let Some(layout) = Table::layout(number(&window[12..14]) as u16) else {
        return false;
    };
    if !is_for_us || window.len() != 16 + length + sum {
        return false;
    }
    let (body, end) = window.split_at(16 + length);
    let width = usize::from(layout.vector);
    if length < width {
        return false;
    }
    let vector = number(&body[16..16 + width]);
    let present = layout.sizes.iter().enumerate();
    let present = present.filter(|(field, _)| vector >> field & 1 == 1);
    let says = width + present.map(|(_, &size)| usize::from(size)).sum::<usize>();
    let total = body.iter().map(|&it| u64::from(it)).sum::<u64>();
    says == length && vector >> layout.sizes.len() == 0 && number(end) == total
}

/// What every window of the stream says, from the left.
fn judged(stream: &[u8]) -> Vec<(u32, Vec<u8>)> {
    let mut frames = Vec::new();
    let mut free = 0;
    for end in 1..=stream.len() {
        let starts = free.max(end.saturating_sub(80))..end;
        if let Some(start) = starts.into_iter().find(|&it| is_frame(&stream[it..end])) {
            frames.push((start as u32, stream[start..end].to_vec()));
            free = end;
        }
    }
    frames
}

/// A piece of a stream that is hard to tell from a frame.
fn piece(draw: &mut Draw) -> Vec<u8> {
    let mut bytes = frame(draw);
    match draw.below(8) {
        0 => {
            let count = draw.below(20);
            draw.bytes(count)
        }
        1 => vec![[0xFF, 0, 0x1E, 0x40][draw.below(4)]; draw.below(20)],
        // Cut off, and cut in front.
        2 => bytes[..draw.below(bytes.len())].to_vec(),
        3 => bytes[draw.below(bytes.len())..].to_vec(),
        // Damaged.
        4 => {
            let at = draw.below(bytes.len());
            bytes[at] ^= 1 << draw.below(8);
            bytes
        }
        // A frame inside of another.
        5 => {
            let at = draw.below(bytes.len());
            bytes.splice(at..at, frame(draw));
            bytes
        }
        // One that writes over the end of another.
        6 => {
            let at = draw.below(bytes.len());
            bytes.truncate(at);
            bytes.extend(frame(draw));
            bytes
        }
        _ => bytes,
    }
}

#[test]
fn what_is_found_is_what_a_judge_of_all_windows_finds() {
    let mut draw = Draw(20);
    let mut frames = 0;
    for _ in 0..3_000 {
        let pieces = 1 + draw.below(12);
        let stream: Vec<u8> = (0..pieces).flat_map(|_| piece(&mut draw)).collect();
        let mut framer = Framer::<Table>::new(US);
        let found = found(&mut framer, &stream, 0);
        assert_eq!(found, judged(&stream), "{stream:02x?}");
        let counters = framer.counters();
        assert_eq!(counters.frames as usize, found.len());
        let framed: usize = found.iter().map(|(_, bytes)| bytes.len()).sum();
        assert_eq!(counters.foreign_bytes as usize, stream.len() - framed);
        frames += found.len();
    }
    assert!(frames > 5_000, "{frames}");
}

#[test]
fn every_split_of_a_frame_is_the_same_frame_and_a_silence_ends_it() {
    let mut draw = Draw(3);
    for _ in 0..100 {
        let bytes = frame(&mut draw);
        for split in 0..bytes.len() {
            let (one, two) = bytes.split_at(split);
            let mut framer = Framer::<Table>::new(US);
            assert!(found(&mut framer, one, 7).is_empty());
            assert_eq!(framer.newest().is_some(), split > 0);
            let whole = found(&mut framer, two, 7 + split as u32);
            assert_eq!(whole, [(7, bytes.clone())]);
            assert_eq!(framer.newest(), None);
            // Silent for long in between: what follows is the rest of nothing.
            assert!(found(&mut framer, one, 0).is_empty());
            framer.give_up();
            if split > 0 {
                assert!(found(&mut framer, two, 0).is_empty());
            }
            assert_eq!(found(&mut framer, &bytes, 9), [(9, bytes.clone())]);
        }
    }
}

#[test]
fn every_single_damaged_byte_is_refused() {
    let mut draw = Draw(5);
    for _ in 0..40 {
        let good = frame(&mut draw);
        let mut bytes = good.clone();
        for at in 0..bytes.len() {
            for wrong in (0..=255).filter(|&wrong| wrong != good[at]) {
                bytes[at] = wrong;
                // A source of another station is the one that the sum alone sees.
                let mut framer = Framer::<Table>::new(US);
                assert!(
                    found(&mut framer, &bytes, 0).is_empty(),
                    "byte {at} of {good:02x?} is {wrong}"
                );
                // Nor does it hurt the next one.
                assert_eq!(found(&mut framer, &good, 100), [(100, good.clone())]);
            }
            bytes[at] = good[at];
        }
    }
}

/// Fewer than in a datagram: what the wrapper has to agree in is not left to the sum.
#[test]
fn few_pairs_of_damaged_bytes_pass() {
    let mut draw = Draw(1);
    let (mut tried, mut passed) = (0_u32, 0_u32);
    while tried < 400_000 {
        let mut bytes = frame(&mut draw);
        for _ in 0..50 {
            let (a, b) = (draw.below(bytes.len()), draw.below(bytes.len()));
            if a == b {
                continue;
            }
            let [x, y] = [draw.below(255) as u8 + 1, draw.below(255) as u8 + 1];
            bytes[a] ^= x;
            bytes[b] ^= y;
            tried += 1;
            let mut framer = Framer::<Table>::new(US);
            passed += u32::from(!found(&mut framer, &bytes, 0).is_empty());
            bytes[a] ^= x;
            bytes[b] ^= y;
        }
    }
    let share = f64::from(passed) / f64::from(tried);
    println!("{:.3} %", share * 100.0);
    assert!((0.000_1..0.001).contains(&share), "{share}");
}

#[test]
fn what_cannot_be_believed_on_a_line_is_counted_by_its_reason() {
    let heartbeat = |properties: &str, end: &str| {
        let hex = format!("ffff000600505f01005043013e82{properties}01c5b612267b{end}");
        let pairs = hex.as_bytes().as_chunks::<2>().0.iter();
        let digit = |it: u8| char::from(it).to_digit(16).unwrap() as u8;
        pairs
            .map(|pair| digit(pair[0]) << 4 | digit(pair[1]))
            .collect::<Vec<_>>()
    };
    let counted = |bytes: &[u8]| {
        let mut framer = Framer::<Table>::new(US);
        let frames = found(&mut framer, bytes, 0).len();
        let it = framer.counters();
        (frames, it.sum_failures, it.length_failures, it.without_sum)
    };
    let good = heartbeat("1e40", "0695");
    assert_eq!(counted(&good), (1, 0, 0, 0));
    assert_eq!(counted(&heartbeat("1e40", "0696")), (0, 1, 0, 0));
    // Code 00, and 11.
    assert_eq!(counted(&heartbeat("1e00", "")), (0, 0, 0, 1));
    assert_eq!(counted(&heartbeat("1ec0", "03380d79")), (0, 0, 0, 1));
    // A vector with another bit, and the sum that is right for it.
    let mut longer = good.clone();
    (longer[16], longer[23]) = (2, 0x96);
    assert_eq!(counted(&longer), (0, 0, 1, 0));
    // To another node, of other editions: not ours to judge.
    let mut other = good.clone();
    other[11] = 2;
    assert_eq!(counted(&other), (0, 0, 0, 0));
    assert_eq!(counted(&heartbeat("2840", "069f")), (0, 0, 0, 0));
    assert_eq!(counted(&heartbeat("2000", "")), (0, 0, 0, 0));
    // As Edition 4 begins.
    let mut zeros = good;
    (zeros[0], zeros[1]) = (0, 0);
    assert_eq!(counted(&zeros), (0, 0, 0, 0));
}
