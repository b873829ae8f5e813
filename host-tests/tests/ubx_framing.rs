//! Framing: exactly the frames of a brute force, whatever stands between them and
//! however the line is cut; every kind of damage counted as what it is.

use proptest::collection::vec;
use proptest::prelude::*;
use timebase::Cycles;
use ubx_link::{Event, Link, LinkCounters, Unwanted};
use world::ubx::{self, Claims};

mod ubx_line;

fn nav_pvt(second: i64) -> Vec<u8> {
    let claims = Claims {
        valid: 0x37,
        t_acc_ns: 22,
        fix_type: 3,
    };
    let payload = ubx::nav_pvt_payload((1_795_348_800 + second) * 1_000_000_000, claims);
    ubx::frame(0x01, 0x07, &payload)
}

fn ack(id: u8) -> Vec<u8> {
    ubx::frame(0x05, 0x01, &[0x06, id])
}

/// What a hostile line is made of.
fn fragment() -> impl Strategy<Value = Vec<u8>> {
    let whole = prop_oneof![
        (0..1_000_i64).prop_map(nav_pvt),
        vec(any::<u8>(), 92).prop_map(|payload| ubx::frame(0x01, 0x07, &payload)),
        (any::<u8>(), 0..2_u8).prop_map(|(id, yes)| ubx::frame(0x05, yes, &[6, id])),
        vec(any::<u8>(), 16).prop_map(|payload| ubx::frame(0x0d, 0x01, &payload)),
        vec(any::<u8>(), 24).prop_map(|payload| ubx::frame(0x01, 0x26, &payload)),
        vec(any::<u8>(), 0..120).prop_map(|payload| ubx::frame(0x0d, 0x01, &payload)),
    ];
    // Good frames inside the payload of a frame whose checksum fails or holds.
    let nested = (whole.clone(), 0..60_usize, any::<bool>()).prop_map(|(inner, at, spoil)| {
        let mut payload = vec![0xb5; 92];
        let inner = &inner[..inner.len().min(92 - at)];
        payload[at..at + inner.len()].copy_from_slice(inner);
        let mut frame = ubx::frame(0x01, 0x07, &payload);
        frame[98] ^= u8::from(spoil);
        frame
    });
    prop_oneof![
        4 => whole.clone(),
        2 => nested,
        3 => (whole.clone(), any::<proptest::sample::Index>(), 1..=255_u8).prop_map(
            |(mut frame, at, flips)| {
                let at = at.index(frame.len());
                frame[at] ^= flips;
                frame
            }
        ),
        3 => (whole, any::<proptest::sample::Index>()).prop_map(|(mut frame, at)| {
            frame.truncate(at.index(frame.len()));
            frame
        }),
        3 => (1..=6_usize, 1..20_usize).prop_map(|(length, times)| {
            [0xb5, 0x62, 0x01, 0x07, 0x5c, 0x00][..length].repeat(times)
        }),
        2 => (1..=6_usize, 1..20_usize).prop_map(|(length, times)| {
            [0xb5, 0x62, 0x0d, 0x01, 0x10, 0x00][..length].repeat(times)
        }),
        2 => (1..=6_usize, 1..20_usize).prop_map(|(length, times)| {
            [0xb5, 0x62, 0x01, 0x26, 0x18, 0x00][..length].repeat(times)
        }),
        2 => (1..=6_usize, 1..20_usize).prop_map(|(length, times)| {
            [0xb5, 0x62, 0x05, 0x01, 0x02, 0x00][..length].repeat(times)
        }),
        1 => vec(any::<u8>(), 0..40),
        1 => Just(b"$GNGGA,092721.00,4717.113,N,00833.915,E*5B\r\n".to_vec()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1_500))]

    #[test]
    fn finds_what_a_brute_force_finds_in_any_cutting(
        fragments in vec(fragment(), 0..24),
        cuts in vec(1..300_usize, 1..8),
        small in vec(1..9_usize, 1..8),
    ) {
        let bytes = fragments.concat();
        let expected = ubx_line::expected(&bytes);
        let mut counters = Vec::new();
        for cuts in [&cuts[..], &small, &[1]] {
            let mut link = Link::new();
            prop_assert_eq!(&ubx_line::receive(&mut link, &bytes, cuts), &expected);
            counters.push(link.counters());
        }
        prop_assert_eq!(counters[0], counters[1]);
        prop_assert_eq!(counters[0], counters[2]);
        prop_assert_eq!(ubx_line::accounted(&counters[0]), bytes.len() as u32);
    }
}

/// Receives `bad` and then a NAV-PVT, right behind it: the counters, once the NAV-PVT
/// has come out unharmed.
fn harmless(bad: &[u8]) -> LinkCounters {
    let bytes = [bad, &nav_pvt(1)].concat();
    let mut link = Link::new();
    let events = ubx_line::receive(&mut link, &bytes, &[13]);
    assert_eq!(events, ubx_line::expected(&bytes));
    let last = events.last().expect("the NAV-PVT comes out");
    let Event::NavPvt { mark, .. } = last else {
        panic!("{last:?}")
    };
    assert_eq!(mark.arrival, ubx_line::arrival(bad.len()));
    link.counters()
}

#[test]
fn each_kind_of_bad_input_is_counted_as_what_it_is() {
    let none = LinkCounters {
        nav_pvts: 1,
        ..LinkCounters::default()
    };
    assert_eq!(harmless(b""), none);

    // Zeros, so that nothing within it looks like anything else.
    let mut damaged = ubx::frame(0x01, 0x07, &[0; 92]);
    damaged[40] ^= 0x10;
    let expected = LinkCounters {
        bad_checksums: 1,
        foreign_bytes: 100,
        ..none
    };
    assert_eq!(harmless(&damaged), expected);

    let flood = b"$GNRMC,120000.00,V,,,,,,,221126,,,N*66\r\n".repeat(200);
    let expected = LinkCounters {
        nmea_starts: 200,
        foreign_bytes: 8_000,
        ..none
    };
    assert_eq!(harmless(&flood), expected);

    let expected = LinkCounters {
        lone_syncs: 5_000,
        foreign_bytes: 5_000,
        ..none
    };
    assert_eq!(harmless(&[0xb5; 5_000]), expected);

    // NAV-PVT of an F9 before protocol 15, and one that claims 65535 bytes.
    let false_lengths = [
        &ubx::frame(0x01, 0x07, &[0; 84])[..],
        b"\xb5\x62\x01\x07\xff\xff",
    ];
    let expected = LinkCounters {
        false_lengths: 2,
        foreign_bytes: 98,
        ..none
    };
    assert_eq!(harmless(&false_lengths.concat()), expected);

    let expected = LinkCounters {
        other_messages: 1,
        foreign_bytes: 28,
        ..none
    };
    assert_eq!(harmless(&ubx::frame(0x01, 0x21, &[0; 20])), expected);

    // A truncated frame fails when the next one fills it up.
    let expected = LinkCounters {
        bad_checksums: 1,
        foreign_bytes: 60,
        ..none
    };
    assert_eq!(harmless(&damaged[..60]), expected);
}

#[test]
fn headers_without_end_hold_nothing_up() {
    for header in [
        b"\xb5\x62\x01\x07\x5c\x00",
        b"\xb5\x62\x0d\x01\x10\x00",
        b"\xb5\x62\x01\x26\x18\x00",
        b"\xb5\x62\x05\x01\x02\x00",
    ] {
        let counters = harmless(&header.repeat(500));
        assert_eq!(counters.bad_checksums, 500);
        assert_eq!(counters.foreign_bytes, 3_000);
    }
}

#[test]
fn a_forecast_is_late_by_what_the_receiver_will_have_added() {
    for (late_ps, flags) in [(10_417, 0x03), (-10_417, 0x03), (i32::MAX, 0x0b)] {
        let mut payload = ubx::tim_tp_payload(1_795_348_800_000_000_000, late_ps);
        payload[14] = flags;
        let bytes = [nav_pvt(0), ubx::frame(0x0d, 0x01, &payload)].concat();
        let events = ubx_line::receive(&mut Link::new(), &bytes, &[7]);
        let [Event::NavPvt { .. }, Event::TimTp(forecast)] = events[..] else {
            panic!("{events:?}")
        };
        assert_eq!(forecast.late_ps, Some(late_ps));
        assert_eq!(forecast.arrival, ubx_line::arrival(100));
    }
    // The least qErr has no opposite.
    let mut payload = [0; 16];
    payload[8..12].copy_from_slice(&i32::MIN.to_le_bytes());
    let bytes = ubx::frame(0x0d, 0x01, &payload);
    let events = ubx_line::receive(&mut Link::new(), &bytes, &[24]);
    assert_eq!(events, ubx_line::expected(&bytes));
    assert_eq!(events.len(), 1);
}

#[test]
fn a_forecast_without_an_error_still_names_its_second() {
    // As in a cold start: the base is UTC, which is available, and qErr is invalid.
    let mut payload = ubx::tim_tp_payload(1_795_348_800_000_000_000, 10_417);
    payload[14] = 0x1b;
    let bytes = ubx::frame(0x0d, 0x01, &payload);
    let events = ubx_line::receive(&mut Link::new(), &bytes, &[24]);
    assert_eq!(events, ubx_line::expected(&bytes));
    let [Event::TimTp(forecast)] = events[..] else {
        panic!("{events:?}")
    };
    assert_eq!(forecast.late_ps, None);
    assert!(forecast.is_utc_base && forecast.is_utc_available);
    // 2026-11-22 is a Sunday, the first day of the week.
    assert_eq!(forecast.tow_ms, 43_200_000);
}

/// For how long the line had been busy, in µs.
fn busy_us(event: &Event) -> u32 {
    match event {
        Event::NavPvt { mark, .. } => mark.busy_us,
        Event::TimTp(forecast) => forecast.busy_us,
        Event::LeapSeconds(received) => received.busy_us,
        Event::Ack { .. } | Event::Nak { .. } => panic!("{event:?}"),
    }
}

#[test]
fn with_each_message_comes_for_how_long_the_line_had_been_busy() {
    let forecast = ubx::frame(0x0d, 0x01, &ubx::tim_tp_payload(0, 0));
    let leap_seconds = ubx::frame(0x01, 0x26, &[0; 24]);
    let noise = vec![0x5a; 1_000];
    // Each after a pause, in byte times beside its own.
    let stretches = [
        (0, vec![nav_pvt(0)]),
        (3, vec![nav_pvt(1), forecast.clone()]),
        (2, vec![nav_pvt(2)]),
        (3, vec![noise.clone(), leap_seconds, nav_pvt(3)]),
        (100_000, vec![nav_pvt(4)]),
    ];
    let byte_us = ubx_line::BYTE as f64 / 168.0;
    for cut in [1, 57, 400] {
        let mut link = Link::new();
        let mut at = Cycles(5_000_000_000);
        let mut busy = Vec::new();
        for (pause, frames) in &stretches {
            at = at.plus(pause * ubx_line::BYTE);
            let mut line = Vec::new();
            for byte in frames.concat() {
                at = at.plus(ubx_line::BYTE);
                line.push(timebase::StampedByte {
                    stamp: at.stamp(),
                    byte,
                });
            }
            for piece in line.chunks(cut) {
                let now = piece[piece.len() - 1].stamp.extend(at);
                busy.extend(ubx_line::drain(&mut link, now, piece).iter().map(busy_us));
            }
        }
        let bytes = |count: usize| (count as f64 * byte_us) as u32;
        let expected = [
            // Nobody had seen it idle.
            u32::MAX,
            0,
            bytes(100),
            // Two byte times are no gap: 124 bytes, and the pause.
            bytes(124 + 2),
            bytes(1_000),
            bytes(1_032),
            0,
        ];
        assert_eq!(busy, expected, "in pieces of {cut}");
    }
}

#[test]
fn a_message_that_is_not_used_is_named() {
    let rawx = ubx::frame(0x02, 0x15, &[0; 16]);
    let rmc = b"$GNRMC,120000.00,V,,,,,,,221126,,,N*66\r\n".to_vec();
    let ubx = Unwanted::Ubx {
        class: 0x02,
        id: 0x15,
    };
    for (bytes, expected) in [
        (nav_pvt(0), None),
        (rawx, Some(ubx)),
        (rmc, Some(Unwanted::Nmea)),
        // Dollars alone are in any data.
        (b"$$G$GN,$GNrmc,$GNRM\x00".to_vec(), None),
    ] {
        let mut link = Link::new();
        ubx_line::receive(&mut link, &bytes, &[200]);
        assert_eq!(link.poll_unwanted(), expected);
        assert_eq!(link.poll_unwanted(), None);
    }
}

#[test]
fn an_event_comes_with_the_last_byte_of_its_frame() {
    let bytes = [ack(8), nav_pvt(0), ack(1)].concat();
    let line = ubx_line::stamped(&bytes);
    let mut link = Link::new();
    let mut ends = Vec::new();
    for (index, byte) in line.iter().enumerate() {
        for _ in ubx_line::drain(&mut link, ubx_line::arrival(index), &[*byte]) {
            ends.push(index + 1);
        }
    }
    assert_eq!(ends, [10, 110, 120]);
}

#[test]
fn a_frame_cut_short_does_not_hold_up_the_answer_behind_an_idle_line() {
    let mut link = Link::new();
    let cut = ubx_line::stamped(&nav_pvt(0)[..50]);
    let last = ubx_line::arrival(49);
    assert!(ubx_line::drain(&mut link, last, &cut).is_empty());
    let idle = last.plus(u64::from(Link::IDLE));
    assert_eq!(link.poll_timeout(last), Some(idle));
    assert!(ubx_line::drain(&mut link, Cycles(idle.0 - 1), &[]).is_empty());
    assert_eq!(link.counters().truncated, 0);
    assert!(ubx_line::drain(&mut link, idle, &[]).is_empty());
    assert_eq!(link.counters().truncated, 1);
    assert_eq!(link.counters().foreign_bytes, 50);
    assert_eq!(link.poll_timeout(idle), None);

    let answer = ubx_line::stamped(&ack(8));
    let later = idle.plus(u64::from(Link::IDLE));
    let events = ubx_line::drain(&mut link, later, &answer);
    assert_eq!(events, [Event::Ack { class: 6, id: 8 }]);
}

#[test]
fn an_answer_inside_a_frame_cut_short_comes_out_when_the_line_is_idle() {
    let bytes = [&nav_pvt(0)[..50], &ack(8)].concat();
    let mut link = Link::new();
    let line = ubx_line::stamped(&bytes);
    let last = ubx_line::arrival(line.len() - 1);
    assert!(ubx_line::drain(&mut link, last, &line).is_empty());
    let events = ubx_line::drain(&mut link, last.plus(u64::from(Link::IDLE)), &[]);
    assert_eq!(events, [Event::Ack { class: 6, id: 8 }]);
    assert_eq!(link.counters().truncated, 1);
}

#[test]
fn a_pause_shorter_than_idle_breaks_no_frame() {
    let bytes = nav_pvt(0);
    let mut line = ubx_line::stamped(&bytes);
    let pause = u64::from(Link::IDLE) - 2 * ubx_line::BYTE;
    for (index, byte) in line.iter_mut().enumerate().skip(50) {
        byte.stamp = ubx_line::arrival(index).plus(pause).stamp();
    }
    let mut link = Link::new();
    let mut now = Cycles::BOOT;
    let mut events = Vec::new();
    for byte in line {
        let arrived = byte.stamp.extend(Cycles(1 << 32));
        let arrived = Cycles(arrived.0 & 0xffff_ffff);
        // A poll each ms, bytes or none.
        while now < arrived {
            events.extend(ubx_line::drain(&mut link, now, &[]));
            now = now.plus(168_000);
        }
        events.extend(ubx_line::drain(&mut link, now, &[byte]));
    }
    assert_eq!(events, ubx_line::expected(&bytes));
}

#[test]
fn stamps_are_extended_across_the_end_of_their_word() {
    for (first, now_after) in [
        // The word ends inside the frame.
        (0x3_ffff_fff0_u64, 200 * 14_583),
        // Drained 20 s late.
        (0x1_2345_6789, 20 * 168_000_000),
        // The drain began before the bytes came.
        (0x7_0000_0000, -10_000_000),
    ] {
        let mut line = ubx_line::stamped(&nav_pvt(0));
        for (index, byte) in line.iter_mut().enumerate() {
            byte.stamp = Cycles(first + index as u64 * ubx_line::BYTE).stamp();
        }
        let now = Cycles(first.saturating_add_signed(now_after));
        let events = ubx_line::drain(&mut Link::new(), now, &line);
        let [Event::NavPvt { mark, .. }] = events[..] else {
            panic!("{events:?}")
        };
        assert_eq!(mark.arrival, Cycles(first));
    }
}
