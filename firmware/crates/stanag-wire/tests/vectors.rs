//! Frames of known bytes, ours and other people's, and all that damage does to them.

use stanag_wire::{Frame, Header, Layout, NodeId, Refusal, Sum};

/// Frames that the decoder of `synapse-cdm` 3.9.1 accepts, and a datagram of two.
const GOOD: [&str; 12] = [
    "ffff000600504301ffffffff3e821e0001c5b612267b",
    "ffff000600504301ffffffff3e821e4001c5b612267b09e1",
    "ffff000600504301ffffffff3e821e8001c5b612267b00000a21",
    "ffff000600505f01005043013e829e4001c5b612267b0715",
    "ffff000e0050430100505f0142681e400fc5b6122682c5b612267b3e8201098b",
    "ffff00090050430100505f0142681e400ec5b612267b3e82010750",
    "ffff001500505f01ffffffff00011e4000003fc5b612267bffffffffffffffff00000000001183",
    "ffff00160050430100505f0100021e40006067c5b612267bff000000ff00000001010000000008adffff00100050430100505f0100031e40003bc5b612267bff0000000000000300071e",
    "ffff001a00504301ffffffff0fa01e400000ffc5b612267b1a85958f5a74459400177003001effd8000210cd",
    "ffff000d00505f0100504301cb201e4007c5b612267b06f855000000070827",
    "ffff0020070001010700ff010fa01e400038ffc16d0ea36028e5bd760f8fdc520124f80304d802bcffce0222011114e81176",
    // Edition 4's with its CRC: as implementations have it, out of no one's decoder.
    "ffff000600504301ffffffff3e8220c001c5b612267b03380d79",
];

fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().as_chunks::<2>().0.iter();
    digits
        .map(|pair| {
            let digit = |it: u8| char::from(it).to_digit(16).expect("hexadecimal") as u8;
            digit(pair[0]) << 4 | digit(pair[1])
        })
        .collect()
}

fn frames(mut bytes: &[u8]) -> Result<Vec<Frame<'_>>, Refusal> {
    let mut frames = Vec::new();
    while !bytes.is_empty() {
        let (frame, rest) = Frame::read(bytes)?;
        frames.push(frame);
        bytes = rest;
    }
    Ok(frames)
}

#[test]
fn good_frames_are_read_and_written_again_to_the_byte() {
    for hex in GOOD {
        let bytes = bytes(hex);
        let mut again = Vec::new();
        for frame in frames(&bytes).unwrap() {
            let mut out = [0; 548];
            let length = frame.header.write(frame.data, &mut out).unwrap();
            again.extend_from_slice(&out[..length]);
        }
        assert_eq!(again, bytes, "{hex}");
    }
}

#[test]
fn a_heartbeat_says_what_it_says() {
    let bytes = bytes(GOOD[3]);
    let (frame, rest) = Frame::read(&bytes).unwrap();
    assert!(rest.is_empty());
    let expected = Header {
        source: NodeId(0x0050_5F01),
        destination: NodeId(0x0050_4301),
        message: 16_002,
        wants_acknowledgement: true,
        idd: 30,
        sum: Sum::Bytes2,
    };
    assert_eq!(frame.header, expected);
    assert_eq!(frame.header.source.to_string(), "00:50:5F:01");
    let layout = Layout {
        vector: 1,
        sizes: &[5],
    };
    let values = layout.values(frame.data).unwrap();
    assert_eq!(values.unsigned(0), Some(849_163_200_123));
}

#[test]
fn each_refusal_has_its_reason() {
    let good = GOOD[10];
    for (hex, refusal) in [
        (good.replace("1176", "1177"), Refusal::Sum),
        (
            good.replace("1e40", "2840").replace("1176", "1180"),
            Refusal::Idd(40),
        ),
        (good.replace("1e40", "1ec0"), Refusal::SumCode),
        (good.replace("ffff0020", "ffff0000"), Refusal::Length(0)),
        (good.replace("ffff0020", "ffff0211"), Refusal::Length(529)),
        (good.replace("ffff0020", "ffff0210"), Refusal::Short),
        (good[..40].to_owned(), Refusal::Short),
        // Edition 2's wrapper, with "Hello".
        (
            "322e350000000000000000000000000007d10000000500000001ffffffff48656c6c6f00000763".into(),
            Refusal::NoWrapper,
        ),
        // Edition 4's with another CRC, and with a sum.
        (
            "ffff000600504301ffffffff3e8220c001c5b612267b03380d78".into(),
            Refusal::Sum,
        ),
        (
            "ffff000600504301ffffffff3e82204001c5b612267b09e3".into(),
            Refusal::SumCode,
        ),
    ] {
        assert_eq!(frames(&bytes(&hex)).unwrap_err(), refusal, "{hex}");
    }
    let edition_4 = bytes("0000000600504301ffffffff3e82200001c5b612267b");
    assert_eq!(Frame::read(&edition_4).unwrap().0.header.idd, 32);
}

#[test]
fn every_cut_of_a_frame_is_short() {
    for hex in GOOD {
        let bytes = bytes(hex);
        let (_, rest) = Frame::read(&bytes).unwrap();
        for end in 0..bytes.len() - rest.len() {
            assert_eq!(
                Frame::read(&bytes[..end]),
                Err(Refusal::Short),
                "{hex} {end}"
            );
        }
    }
}

#[test]
fn every_single_damaged_byte_of_a_frame_with_a_sum_is_refused() {
    for hex in GOOD {
        let bytes = bytes(hex);
        let (frame, rest) = Frame::read(&bytes).unwrap();
        if frame.header.sum == Sum::None {
            continue;
        }
        let mut bytes = bytes[..bytes.len() - rest.len()].to_vec();
        for at in 0..bytes.len() {
            let right = bytes[at];
            for wrong in (0..=255).filter(|&wrong| wrong != right) {
                bytes[at] = wrong;
                // A shorter sum or none is no damage that the frame alone can show: then bytes
                // are left over, and the datagram does not divide into frames.
                assert!(frames(&bytes).is_err(), "{hex}: byte {at} is {wrong}");
            }
            bytes[at] = right;
        }
    }
}

/// The sum sees two damaged bytes in all but 0.16 % of cases: those whose changes cancel.
#[test]
fn few_pairs_of_damaged_bytes_pass() {
    let good = bytes(GOOD[8]);
    let mut state = 1_u64;
    let mut draw = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let (mut tried, mut passed) = (0_u32, 0_u32);
    while tried < 400_000 {
        let (a, b) = (draw(good.len()), draw(good.len()));
        if a == b {
            continue;
        }
        let mut damaged = good.clone();
        damaged[a] ^= draw(255) as u8 + 1;
        damaged[b] ^= draw(255) as u8 + 1;
        tried += 1;
        passed += u32::from(frames(&damaged).is_ok());
    }
    let share = f64::from(passed) / f64::from(tried);
    println!("{:.3} %", share * 100.0);
    assert!((0.001..0.004).contains(&share), "{share}");
}
