//! The status line: once a second, everything that was counted, into the log.
//!
//! *Design.* Pairs of `key=value` after the word `status`, so that people and programs read the same
//! line. Counters that commonly stay 0 are left out while they are 0.
//!
//! *Limits.* A line is one frame of the log, and interrupts are masked while that is written: each byte
//! of it counts, and all of it should take less than the shortest tick. With the pulse and its
//! counters it takes more: up to 61 µs were measured (`docs/timing.md`).

use defmt::{Format, Formatter};
use embassy_time::{Duration, Ticker};
use utc_clock::{ClockState, Reading};

use crate::clock;
use crate::drivers::card::CardErrors;
use crate::drivers::time;
use crate::reports::{CARD, GNSS, GnssReport, MAVLINK, MavlinkReport};
use crate::settings::VARIANT;

/// Runs forever, on the low executor.
#[embassy_executor::task]
pub async fn run() {
    let mut beat = Ticker::every(Duration::from_secs(1));
    loop {
        beat.next().await;
        log();
    }
}

fn log() {
    let reading = clock::reading_at(time::now());
    let gnss = GNSS.get();
    let mavlink = MAVLINK.get();
    let clock = gnss.map(|report| report.clock).unwrap_or_default();
    defmt::info!(
        "status variant={} state={} source={} utc={} unc_ns={=u32} ppb={=i32} leap_known={=bool} marks={=u32} refused={=u32} pings={=u32} lost_ticks={=u32}{}{}{}{}",
        VARIANT,
        reading.state,
        gnss.map(|report| report.source).unwrap_or_default(),
        Utc(reading),
        reading.uncertainty_ns,
        gnss.map(|report| report.frequency.0).unwrap_or_default(),
        reading.leap_seconds_known,
        clock.accepted,
        clock.refused(),
        mavlink.map(|report| report.node.pings).unwrap_or_default(),
        time::lost_ticks(),
        Clock(clock),
        Gnss(gnss),
        Mavlink(mavlink),
        Slot(CARD.get()),
    );
}

/// Writes ` name=count` for each field that is not 0.
macro_rules! nonzero {
    ($f:ident, $counters:expr, $prefix:literal: $($field:ident),+) => {
        let counters = $counters;
        $(count($f, concat!($prefix, stringify!($field)), counters.$field);)+
    };
}

/// Writes ` name=count` if it is not 0. Not inlined, because there are dozens of calls.
#[inline(never)]
fn count(f: Formatter, name: &str, count: u32) {
    if count != 0 {
        defmt::write!(f, " {=str}={=u32}", name, count);
    }
}

/// What became of the marks.
struct Clock(utc_clock::Counters);

impl Format for Clock {
    fn format(&self, f: Formatter) {
        nonzero!(f, self.0, "": steps_forward, steps_back, holdovers);
        nonzero!(f, self.0, "mark_": date, time, unresolved, unconfirmed, inaccurate, calendar,
            too_old, leap_second, stamp, backlog, duplicate_epoch, epoch_back, outlier, late, early,
            drift, crystal);
        nonzero!(f, self.0, "": pulses, pulse_locks, pulse_unnumbered, pulse_off_second,
            pulse_off_line, pulse_doubled, pulse_stamp, pulse_backlog);
    }
}

/// What came over the receiver's line.
struct Gnss(Option<GnssReport>);

impl Format for Gnss {
    fn format(&self, f: Formatter) {
        let Some(report) = self.0 else { return };
        nonzero!(f, report.receiver.link, "gps_": bad_checksums, truncated, refused, false_lengths,
            other_messages, lone_syncs, nmea_starts, foreign_bytes);
        nonzero!(f, report.receiver.session, "cfg_": rounds, attempts, accepted, refused, unanswered);
        nonzero!(f, report.edges, "edges_": queued, followed, queue_full);
        nonzero!(f, report.receiver.line, "gps_": overrun, framing, noise, incoming_full, outgoing_full);
    }
}

/// What came over the MAVLink line.
struct Mavlink(Option<MavlinkReport>);

impl Format for Mavlink {
    fn format(&self, f: Formatter) {
        let Some(report) = self.0 else { return };
        nonzero!(f, report.node, "mav_": timesyncs, commands, parameters, logs, unknown, answers,
            for_others);
        nonzero!(f, report.node.framing, "mav_": crc_failures, abandoned, unknown_flags, signed,
            foreign_bytes);
        nonzero!(f, report.line, "mav_": overrun, framing, noise, incoming_full, outgoing_full);
    }
}

/// What went wrong with the card.
struct Slot(Option<CardErrors>);

impl Format for Slot {
    fn format(&self, f: Formatter) {
        let Some(errors) = self.0 else { return };
        nonzero!(f, errors, "card_": silent, crc, timeout, fifo, refused);
    }
}

/// The time in the calendar; `-` while the clock is unset.
struct Utc(Reading);

impl Format for Utc {
    fn format(&self, f: Formatter) {
        let Reading { utc, state, .. } = self.0;
        match utc.to_civil() {
            Some(t) if state != ClockState::Unset => defmt::write!(
                f,
                "{=u16:04}-{=u8:02}-{=u8:02}T{=u8:02}:{=u8:02}:{=u8:02}.{=u32:06}Z",
                t.year,
                t.month,
                t.day,
                t.hour,
                t.minute,
                t.second,
                t.nano.unsigned_abs() / 1_000
            ),
            _ => defmt::write!(f, "-"),
        }
    }
}
