//! Noise on the lines, of the kinds that hurt a framer most.

use virtual_pixhawk::Script;
use world::{Transmission, WorldNanos};

use crate::board::{BAUD, MS, SECOND, Subject, executed, executed_by};
use crate::table::{NoiseCosts, Row};

/// The line on which noise comes in.
#[derive(Clone, Copy)]
pub enum Line {
    /// The receiver's.
    Gps,
    /// The client's.
    Mavlink,
    /// The station's, which speaks STANAG 4586.
    Stanag,
}

/// The cost of a byte beyond the `byte` instructions of its interrupt, for each kind of noise: everything that the
/// board does more than in silence, over 1 000 bytes at full rate.
pub fn costs(subject: &Subject, line: Line, byte: u64) -> anyhow::Result<NoiseCosts> {
    const BYTES: usize = 1_000;
    let begin = match line {
        // The board looks for its receiver at this rate first, from its start on.
        Line::Gps => 300 * MS,
        Line::Mavlink | Line::Stanag => 2 * SECOND,
    };
    let start = WorldNanos(begin + 10 * MS);
    // 1 000 bytes last 87 ms; after the silence, the framer gives up what it held back.
    let window = (begin, begin + 300 * MS);
    let run = |bytes: Vec<u8>| {
        let script = Script::new([Transmission {
            start,
            bytes,
            baud: BAUD,
        }]);
        match line {
            Line::Gps => executed(subject, script, Script::default(), window),
            Line::Mavlink => executed(subject, Script::default(), script, window),
            Line::Stanag => executed_by(subject.board().telem2(script), window),
        }
    };
    let kinds = match line {
        Line::Gps => GPS_NOISE,
        Line::Mavlink => MAVLINK_NOISE,
        Line::Stanag => STANAG_NOISE,
    };
    let silence = run(Vec::new())?;
    let repeated = kinds
        .iter()
        .map(|&(name, bytes)| (name, bytes.iter().copied().cycle().take(BYTES).collect()));
    repeated
        .chain([("random bytes", random(BYTES))])
        .map(|(name, bytes)| Ok((name, (run(bytes)? - silence) / BYTES as f64 - byte as f64)))
        .collect()
}

/// Noise made to hurt the search for UBX frames.
const GPS_NOISE: &[(&str, &[u8])] = &[
    ("zeros", &[0]),
    ("first sync bytes", &[0xb5]),
    ("sync pairs", &[0xb5, 0x62]),
    ("NAV-PVT headers", &[0xb5, 0x62, 0x01, 0x07, 92, 0]),
    ("TIM-TP headers", &[0xb5, 0x62, 0x0d, 0x01, 16, 0]),
    ("ACK headers", &[0xb5, 0x62, 0x05, 0x01, 2, 0]),
    (
        "NAV-PVT and TIM-TP headers",
        &[0xb5, 0x62, 0x01, 0x07, 92, 0, 0xb5, 0x62, 0x0d, 0x01, 16, 0],
    ),
    (
        "NAV-PVT and ACK headers",
        &[0xb5, 0x62, 0x01, 0x07, 92, 0, 0xb5, 0x62, 0x05, 0x01, 2, 0],
    ),
    (
        "ACK frames with a wrong checksum",
        &[0xb5, 0x62, 0x05, 0x01, 2, 0, 6, 1, 0, 0],
    ),
    ("false lengths", &[0xb5, 0x62, 0x01, 0x07, 0xff, 0xff]),
    (
        "foreign frames",
        &[0xb5, 0x62, 0x0a, 0x04, 0, 0, 0x0e, 0x34],
    ),
    (
        "NMEA",
        b"$GNRMC,085001.60,A,4724.40,N,00833.00,E,0.0,,190717,,,A*7C\r\n",
    ),
];

/// Noise made to hurt the search for MAVLink frames.
const MAVLINK_NOISE: &[(&str, &[u8])] = &[
    ("zeros", &[0]),
    ("MAVLink 1 markers", &[0xfe]),
    ("MAVLink 2 markers", &[0xfd]),
    ("PING 1 headers, each third byte", &[0xfe, 14, 4]),
    ("PING 1 headers", &[0xfe, 14, 0, 255, 190, 4]),
    ("TIMESYNC 1 headers, each third byte", &[0xfe, 16, 111]),
    ("COMMAND_LONG 1 headers, each third byte", &[0xfe, 33, 76]),
    (
        "PARAM_REQUEST_LIST 1 headers, each third byte",
        &[0xfe, 2, 21],
    ),
    (
        "LOG_REQUEST_LIST 1 headers, each third byte",
        &[0xfe, 6, 117],
    ),
    (
        "LOG_REQUEST_DATA 1 headers, each third byte",
        &[0xfe, 12, 119],
    ),
    (
        "MAVLink 1 frames of 2, 14 and 35 bytes with one end",
        &[0xfe, 2, 4, 0xfe, 35, 121, 0xfe, 14, 75],
    ),
    (
        "MAVLink 1 frames of 12 and 33 bytes with one end",
        &[0xfe, 12, 76, 0xfe, 33, 119],
    ),
    (
        "MAVLink 1 frames of 6 and 33 bytes with one end",
        &[0xfe, 6, 76, 0xfe, 33, 117],
    ),
    (
        "MAVLink 1 frames of 2 and 35 bytes with one end",
        &[0xfe, 2, 75, 0xfe, 35, 122],
    ),
    (
        "MAVLink 1 frames of 14 and 35 bytes with one end",
        &[0xfe, 14, 75, 0xfe, 35, 4],
    ),
    (
        "PARAM_REQUEST_READ 1 headers, each second byte",
        &[0xfe, 20],
    ),
    ("PARAM_SET 1 headers, each second byte", &[0xfe, 23]),
    (
        "MAVLink 1 frames of 21 and 23 bytes with one end, each second byte",
        &[0xfe, 21, 0xfe, 23],
    ),
    (
        "MAVLink 1 headers of longer frames than are known",
        &[0xfe, 0xfe, 0xfe, 0xfe, 0xfe, 4, 4, 4, 4, 4],
    ),
    (
        "MAVLink 1 headers of a kind that is not known",
        &[0xfe, 0, 0, 0, 0, 30],
    ),
    ("PING 2 headers", &[0xfd, 14, 0, 0, 0, 255, 190, 4, 0, 0]),
    (
        "PING 2 headers, two in ten bytes",
        &[0xfd, 4, 0, 0, 0xfd, 1, 0, 4, 0, 0],
    ),
    (
        "PARAM_REQUEST_READ 2 headers, two in ten bytes",
        &[0xfd, 20, 0, 0, 0xfd, 20, 0, 20, 0, 0],
    ),
    (
        "PARAM_SET 2 headers, two in ten bytes",
        &[0xfd, 23, 0, 0, 0xfd, 23, 0, 23, 0, 0],
    ),
    (
        "LOG_ERASE 2 headers",
        &[0xfd, 1, 0, 0, 0, 255, 190, 121, 0, 0],
    ),
    (
        "shortest PING 2 headers",
        &[0xfd, 1, 0, 0, 0, 255, 190, 4, 0, 0],
    ),
    (
        "PING 2 headers of all lengths",
        &[
            0xfd, 14, 0, 0, 0, 1, 1, 4, 0, 0, 0xfd, 9, 0, 0, 0, 1, 1, 4, 0, 0, 0xfd, 4, 0, 0, 0, 1,
            1, 4, 0, 0, 0xfd, 1, 0, 0, 0, 1, 1, 4, 0, 0,
        ],
    ),
    (
        "signed PING 2 headers",
        &[0xfd, 14, 1, 0, 0, 255, 190, 4, 0, 0],
    ),
    ("unknown flags", &[0xfd, 14, 2, 0, 0, 255, 190, 4, 0, 0]),
    ("foreign frames", &[0xfe, 1, 0, 255, 190, 200, 0, 0, 0]),
];

/// Noise made to hurt the search for frames of STANAG 4586.
const STANAG_NOISE: &[(&str, &[u8])] = &[
    ("zeros", &[0]),
    ("first bytes", &[0xff]),
    ("Message Properties, each second byte", &[0x1e, 0x40]),
    (
        "types and Message Properties, each fourth byte",
        &[0x3e, 0x82, 0x1e, 0x40],
    ),
    (
        "the last type that is looked for, each fourth byte",
        &[0xcb, 0x25, 0x1e, 0x40],
    ),
    (
        "types that are not looked for, each fourth byte",
        &[0x0f, 0xa0, 0x1e, 0x40],
    ),
    (
        "headers of heartbeats",
        &[
            0xff, 0xff, 0, 6, 0, 0x50, 0x5f, 1, 0xff, 0xff, 0xff, 0xff, 0x3e, 0x82, 0x1e, 0x40,
        ],
    ),
    (
        "headers of clock requests",
        &[
            0xff, 0xff, 0, 13, 0, 0x50, 0x5f, 1, 0xff, 0xff, 0xff, 0xff, 0xcb, 0x20, 0x1e, 0x40,
        ],
    ),
    (
        "two headers in 26 bytes",
        &[
            0xff, 0xff, 0, 6, 0, 0x50, 0x5f, 1, 0xff, 0xff, 0xff, 0xff, 0, 1, 0x1e, 0x40, 0, 0,
            0xff, 0xff, 0xff, 0xff, 0x3e, 0x82, 0x1e, 0x40,
        ],
    ),
    (
        "shortest heartbeats with a wrong sum",
        &[
            0xff, 0xff, 0, 1, 0, 0x50, 0x5f, 1, 0xff, 0xff, 0xff, 0xff, 0x3e, 0x82, 0x1e, 0x40, 0,
            0, 0,
        ],
    ),
    (
        "frames with a sum and another length than their vector says",
        &[
            0xff, 0xff, 0, 2, 0, 0x50, 0x5f, 1, 0xff, 0xff, 0xff, 0xff, 0x3e, 0x82, 0x1e, 0x40, 0,
            0, 0x07, 0x88,
        ],
    ),
    (
        "shortest heartbeats without a sum",
        &[
            0xff, 0xff, 0, 1, 0, 0x50, 0x5f, 1, 0xff, 0xff, 0xff, 0xff, 0x3e, 0x82, 0x1e, 0, 0,
        ],
    ),
];

/// Bytes of a linear congruential generator.
fn random(count: usize) -> Vec<u8> {
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    (0..count).map(|_| next()).collect()
}

/// The most expensive kind of noise as a row.
pub fn worst(job: &'static str, costs: &NoiseCosts, budget: f64, peers: &'static str) -> Row {
    let dearest = costs.iter().map(|&(_, cost)| cost).fold(0.0, f64::max);
    Row::new(job, dearest, budget, peers)
}
