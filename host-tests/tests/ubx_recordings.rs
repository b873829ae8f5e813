//! Recordings of real receivers: every intact frame of ours comes out, and nothing
//! else.
//!
//! The counts were made with a brute force outside of this project (each offset
//! whose sync, length and checksum hold, from the left, not overlapping) and agree
//! with pyubx2 1.4.0 on every file, the damaged ones included.

use host_tests::captures;
use timebase::TimeMark;
use ubx_link::{Event, Fix, Link};

mod ubx_line;

/// A receiver that is switched on.
const COLD_START: &str = "ubx-nav-solutions/coldstart-first-400kB.ubx";

/// File, NAV-PVT of 92 bytes, ACK-ACK, ACK-NAK.
const COUNTS: [(&str, [u32; 3]); 23] = [
    ("ubx-gpsd/navisys-gr8013.log", [35, 0, 0]),
    ("ubx-gpsd/ublox-lea-m8f.log", [28, 39, 4]),
    ("ubx-gpsd/ublox-neo-m8n.log", [24, 0, 0]),
    ("ubx-gpsd/ublox-neo-m8p.log", [59, 0, 0]),
    ("ubx-gpsd/ublox-zed-f9r.log", [30, 0, 0]),
    ("ubx-gpsd/ublox-zed-f9t-rtcm3.log", [26, 0, 0]),
    ("ubx-gpsd/ublox8-uniqid-monhw.log", [7, 31, 2]),
    ("ubx-pyubx2/pygpsdata-BADCK2.log", [1, 0, 0]),
    ("ubx-pyubx2/pygpsdata-BADEOF1.log", [1, 0, 0]),
    ("ubx-pyubx2/pygpsdata-BADEOF2.log", [1, 0, 0]),
    ("ubx-pyubx2/pygpsdata-BADEOF3.log", [1, 0, 0]),
    ("ubx-pyubx2/pygpsdata-BADNMEAEOF.log", [2, 0, 0]),
    ("ubx-pyubx2/pygpsdata-MIXED-RTCM3.log", [1, 0, 0]),
    ("ubx-pyubx2/pygpsdata-MIXED-RTCM3BADCRC.log", [1, 0, 0]),
    ("ubx-pyubx2/pygpsdata-MIXED3.log", [3, 0, 0]),
    ("ubx-pyubx2/pygpsdata-MIXED3BADCK.log", [1, 0, 0]),
    (COLD_START, [88, 0, 0]),
    ("ubx-satpulse/f10t-tmode_navpvt.ubx", [8, 0, 0]),
    ("ubx-satpulse/f9p-pvt-out_navpvt.ubx", [12, 0, 0]),
    ("ubx-satpulse/m8-tmode_navpvt.ubx", [7, 0, 0]),
    ("ubx-satpulse/m8t-binary_navpvt.ubx", [3, 0, 0]),
    ("ubx-satpulse/m8t-pps_navpvt.ubx", [6, 0, 0]),
    ("ubx-satpulse/m8t-tmode_navpvt.ubx", [5, 0, 0]),
];

#[test]
fn every_intact_frame_comes_out() {
    let Some(folder) = captures::folder() else {
        return;
    };
    for (file, [nav_pvts, acks, naks]) in COUNTS {
        let bytes = std::fs::read(folder.join(file)).expect(file);
        // The cutting of a 1 ms poll at 115200, of a byte at a time, of bursts.
        for cuts in [&[11, 12][..], &[1], &[999, 3, 47]] {
            let mut link = Link::new();
            let events = ubx_line::receive(&mut link, &bytes, cuts);
            assert_eq!(events, ubx_line::expected(&bytes), "{file}");
            let counters = link.counters();
            assert_eq!(
                [counters.nav_pvts, counters.acks, counters.naks],
                [nav_pvts, acks, naks],
                "{file}"
            );
            let total = ubx_line::accounted(&counters);
            assert_eq!(total, bytes.len() as u32, "{file}");
            // One receiver sends TIM-TP.
            let tim_tps = if file == COLD_START { 38 } else { 0 };
            assert_eq!((counters.tim_tps, counters.refused), (tim_tps, 0), "{file}");
        }
    }
}

#[test]
fn a_cold_start_is_reported_as_it_was() {
    let Some(folder) = captures::folder() else {
        return;
    };
    let bytes = std::fs::read(folder.join(COLD_START)).expect(COLD_START);
    let events = ubx_line::receive(&mut Link::new(), &bytes, &[64]);
    let mut solutions = Vec::new();
    for event in events {
        match event {
            Event::NavPvt { mark, fix } => solutions.push((mark, fix)),
            // Each with a flag that its qErr has no value, and a second of UTC all the same.
            Event::TimTp(forecast) => assert_eq!(
                (forecast.late_ps, forecast.is_utc_base, forecast.week),
                (None, true, 2_363)
            ),
            // The source is a configuration that nobody made, and its own flag does not confirm
            // the count, before the sky has sent it: Galileo.
            Event::LeapSeconds(received) if solutions.len() < 51 => {
                assert_eq!((received.source, received.count), (7, None));
            }
            Event::LeapSeconds(received) => {
                assert_eq!((received.source, received.count), (5, Some(18)));
            }
            Event::Ack { .. } | Event::Nak { .. } => panic!("{event:?} stands in it"),
        }
    }
    let resolved = |(mark, _): &(TimeMark, Fix)| mark.validity.fully_resolved;
    assert_eq!(solutions.iter().position(resolved), Some(50));
    for (mark, fix) in &solutions[30..50] {
        // A 3D fix, and a time that must not be believed.
        assert_eq!((fix.fix_type, mark.t_acc_ns), (3, u32::MAX));
        assert!(mark.validity.date && mark.validity.time);
        assert!(!mark.validity.leap_seconds_known);
    }
}
