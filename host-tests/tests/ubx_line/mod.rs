//! What the tests of the receiver's line share: bytes with stamps, and the judge.
//!
//! *Purpose.* What must come out of a stretch of line, found without code of
//! `ubx-link`'s: the brute force of `world::ubx` and fields read by their offsets.
//!
//! *Design.* Byte `n` is stamped as 115200 baud would have it. So a time mark's
//! arrival is the byte at which its frame began. The stretch has no gap, and before it
//! nobody has seen the line idle.
//!
//! *Limits.* Of a NAV-PVT all that `ubx-link` hands on is compared, nothing else.
#![allow(dead_code, reason = "each test file uses its own part of it")]

use timebase::{
    CivilTime, Cycles, LeapEvent, LeapSeconds, PulseForecast, StampedByte, TimeMark, Validity,
};
use ubx_link::{Event, Fix, Link, LinkCounters};
use world::ubx::{self, Found};

/// Cycles that a byte takes at 115200: 168 MHz · 10 / 115200, rounded.
pub const BYTE: u64 = 14_583;

/// When byte `index` of a stretch has arrived.
pub fn arrival(index: usize) -> Cycles {
    Cycles((index as u64 + 1) * BYTE)
}

/// `bytes`, stamped one after another from boot on.
pub fn stamped(bytes: &[u8]) -> Vec<StampedByte> {
    let stamp = |(index, byte): (usize, &u8)| StampedByte {
        stamp: arrival(index).stamp(),
        byte: *byte,
    };
    bytes.iter().enumerate().map(stamp).collect()
}

/// Lets `link` take `bytes`: all events.
pub fn drain(link: &mut Link, now: Cycles, bytes: &[StampedByte]) -> Vec<Event> {
    let mut events = Vec::new();
    let mut left = bytes.len();
    for chunk in bytes.chunks(Link::ROOM) {
        assert_eq!(link.push(chunk), chunk.len(), "there is room");
        left -= chunk.len();
        // The line was not idle behind it if more has come since.
        let more = chunk.last().filter(|_| left > 0);
        let then = more.map_or(now, |byte| byte.stamp.extend(now));
        events.extend(core::iter::from_fn(|| link.poll(then)));
    }
    // An idle line makes events, too.
    events.extend(core::iter::from_fn(|| link.poll(now)));
    events
}

/// Gives `link` the `bytes` in pieces of the lengths `cuts`, over and over, and
/// then an idle line.
pub fn receive(link: &mut Link, bytes: &[u8], cuts: &[usize]) -> Vec<Event> {
    let line = stamped(bytes);
    let mut events = Vec::new();
    let mut rest = &line[..];
    let mut done = 0;
    for cut in cuts.iter().cycle() {
        let (piece, behind) = rest.split_at((*cut).min(rest.len()));
        done += piece.len();
        events.extend(drain(link, arrival(done), piece));
        rest = behind;
        if rest.is_empty() {
            break;
        }
    }
    // Two polls: one may still be about what a good frame had behind it.
    let idle = arrival(done).plus(u64::from(Link::IDLE));
    events.extend(drain(link, idle, &[]));
    events.extend(drain(link, idle, &[]));
    events
}

/// Whether a frame is of a kind that we use.
pub fn ours(class: u8, id: u8, length: usize) -> bool {
    matches!(
        (class, id, length),
        (0x01, 0x07, 92) | (0x01, 0x26, 24) | (0x0d, 0x01, 16) | (0x05, 0x00 | 0x01, 2)
    )
}

/// What must come out of `bytes` when they arrive from boot on.
pub fn expected(bytes: &[u8]) -> Vec<Event> {
    ubx::find_frames(bytes, ours).iter().map(event).collect()
}

/// The bytes of all frames of ours that were counted, and of everything else that was.
pub fn accounted(counters: &LinkCounters) -> u32 {
    let good = counters.nav_pvts * 100 + counters.tim_tps * 24 + counters.nav_timels * 32;
    good + (counters.acks + counters.naks) * 10 + counters.foreign_bytes
}

/// For how long a line was busy that was never seen idle.
const ALWAYS_US: u32 = u32::MAX;

fn event(frame: &Found<'_>) -> Event {
    match frame.class {
        0x01 if frame.id == 0x07 => nav_pvt(frame),
        0x01 => {
            let p = frame.payload;
            Event::LeapSeconds(LeapSeconds {
                arrival: arrival(frame.offset),
                busy_us: ALWAYS_US,
                source: p[8],
                count: (p[23] & 1 != 0).then_some(p[9].cast_signed()),
                event: (p[23] & 2 != 0).then_some(LeapEvent {
                    change: p[11].cast_signed(),
                    in_s: i32::from_le_bytes([p[12], p[13], p[14], p[15]]),
                }),
            })
        }
        0x0d => {
            let p = frame.payload;
            let q_err = i32::from_le_bytes([p[8], p[9], p[10], p[11]]);
            Event::TimTp(PulseForecast {
                arrival: arrival(frame.offset),
                busy_us: ALWAYS_US,
                late_ps: (p[14] & 0x10 == 0).then(|| q_err.checked_neg().unwrap_or(i32::MAX)),
                tow_ms: u32::from_le_bytes([p[0], p[1], p[2], p[3]]),
                week: u16::from_le_bytes([p[12], p[13]]),
                is_utc_base: p[14] & 1 != 0,
                is_utc_available: p[14] & 2 != 0,
            })
        }
        _ => {
            let (class, id) = (frame.payload[0], frame.payload[1]);
            match frame.id {
                1 => Event::Ack { class, id },
                _ => Event::Nak { class, id },
            }
        }
    }
}

fn nav_pvt(frame: &Found<'_>) -> Event {
    let p = frame.payload;
    let four = |at: usize| u32::from_le_bytes([p[at], p[at + 1], p[at + 2], p[at + 3]]);
    let two = |at: usize| u16::from_le_bytes([p[at], p[at + 1]]);
    Event::NavPvt {
        mark: TimeMark {
            arrival: arrival(frame.offset),
            busy_us: ALWAYS_US,
            epoch: CivilTime {
                year: two(4),
                month: p[6],
                day: p[7],
                hour: p[8],
                minute: p[9],
                second: p[10],
                nano: four(16).cast_signed(),
            },
            t_acc_ns: four(12),
            validity: Validity {
                date: p[11] & 1 != 0,
                time: p[11] & 2 != 0,
                fully_resolved: p[11] & 4 != 0,
                confirmed: p[22] & 0x80 != 0,
                leap_seconds_known: p[11] & 0xf0 != 0xf0,
            },
        },
        fix: Fix {
            fix_type: p[20],
            fix_ok: p[21] & 1 != 0,
            satellites: p[23],
            longitude_1e7_deg: four(24).cast_signed(),
            latitude_1e7_deg: four(28).cast_signed(),
            height_ellipsoid_mm: four(32).cast_signed(),
            height_msl_mm: four(36).cast_signed(),
            horizontal_accuracy_mm: four(40),
            vertical_accuracy_mm: four(44),
            ground_speed_mm_s: four(60).cast_signed(),
            velocity_mm_s: [48, 52, 56].map(|at| four(at).cast_signed()),
            heading_1e5_deg: four(64).cast_signed(),
        },
    }
}
