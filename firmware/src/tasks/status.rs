//! The status line: once a second, everything that was counted, into the log.
//!
//! *Design.* Pairs of `key=value` after the word `status`, so that people and programs read the same
//! line. Counters that commonly stay 0 are left out while they are 0.
//!
//! *Limits.* A line is one frame of the log, and tasks wait while that is written
//! ([`logger`]).

use defmt::{Format, Formatter};
use embassy_time::{Duration, Ticker};
use ubx_link::Finding;
use utc_clock::{ClockState, Reading};

use crate::drivers::time;
use crate::logger;
use crate::reports::{CARD, CardReport, GNSS, GnssReport, LINKS, LinkReport, MAVLINK};
use crate::settings::VARIANT;
use crate::{clock, stack};

/// Runs forever, on the low executor.
#[embassy_executor::task]
pub async fn run() {
    let mut beat = Ticker::every(Duration::from_secs(1));
    let mut stack = stack::high_water();
    loop {
        beat.next().await;
        log(stack);
        // It takes 240 µs to look through: after the line, which is about this moment.
        stack = stack::high_water();
    }
}

/// Writes the line; `stack` is the most that it has held, in bytes.
fn log(stack: u32) {
    let reading = clock::reading_at(time::now());
    let gnss = GNSS.get();
    let mavlink = MAVLINK.get();
    let clock = gnss.map(|report| report.clock).unwrap_or_default();
    defmt::info!(
        "status variant={} state={} second={} source={} utc={} unc_ns={=u64} ppb={=i32} leap_known={=bool} marks={=u32} refused={=u32} pings={=u32} lost_ticks={=u32} stack={=u32}{}{}{}{}{}",
        VARIANT,
        reading.state,
        gnss.map(|report| report.second).unwrap_or_default(),
        gnss.map(|report| report.source).unwrap_or_default(),
        Utc(reading),
        reading.uncertainty_ns,
        gnss.map(|report| report.frequency.0).unwrap_or_default(),
        reading.leap_seconds_known,
        clock.accepted,
        clock.refused(),
        mavlink.map_or(0, |links| links.iter().map(|link| link.node.pings).sum()),
        time::lost_ticks(),
        stack,
        Clock(clock),
        Gnss(gnss),
        Mavlink(mavlink),
        Slot(CARD.get()),
        Log,
    );
}

/// Writes ` key=count` for each counter that is not 0.
macro_rules! nonzero {
    ($f:ident, $counters:expr, { $($key:literal: $field:ident,)+ }) => {
        let counters = $counters;
        $(count($f, defmt::intern!($key), counters.$field);)+
    };
}

/// The same with ` link_key=count`.
macro_rules! nonzero_of {
    ($link:ident, $f:ident, $counters:expr, { $($key:literal: $field:ident,)+ }) => {
        let counters = $counters;
        $(count_of($f, $link, defmt::intern!($key), counters.$field);)+
    };
}

/// Writes ` key=count` if it is not 0. Not inlined, because there are dozens of calls. The key is an
/// index into the image's strings, two bytes of the frame and none of the flash.
#[inline(never)]
fn count(f: Formatter, key: defmt::Str, count: u32) {
    if count != 0 {
        defmt::write!(f, " {=istr}={=u32}", key, count);
    }
}

/// The same with ` link_key=count`.
#[inline(never)]
fn count_of(f: Formatter, link: defmt::Str, key: defmt::Str, count: u32) {
    if count != 0 {
        defmt::write!(f, " {=istr}_{=istr}={=u32}", link, key, count);
    }
}

/// What became of the marks.
struct Clock(utc_clock::Counters);

impl Format for Clock {
    fn format(&self, f: Formatter) {
        nonzero!(f, self.0, {
            "steps_forward": steps_forward,
            "steps_back": steps_back,
            "holdovers": holdovers,
            "mark_date": date,
            "mark_time": time,
            "mark_unresolved": unresolved,
            "mark_unconfirmed": unconfirmed,
            "mark_inaccurate": inaccurate,
            "mark_calendar": calendar,
            "mark_too_old": too_old,
            "mark_leap_second": leap_second,
            "mark_stamp": stamp,
            "mark_backlog": backlog,
            "mark_duplicate_epoch": duplicate_epoch,
            "mark_epoch_back": epoch_back,
            "mark_outlier": outlier,
            "mark_late": late,
            "mark_early": early,
            "mark_drift": drift,
            "mark_waited": waited,
            "pulses": pulses,
            "pulse_locks": pulse_locks,
            "pulse_unnumbered": pulse_unnumbered,
            "pulse_width": pulse_width,
            "pulse_unproved": pulse_unproved,
            "pulse_off_second": pulse_off_second,
            "pulse_off_line": pulse_off_line,
            "pulse_doubled": pulse_doubled,
            "pulse_stamp": pulse_stamp,
            "pulse_backlog": pulse_backlog,
            "pulse_q_err": pulse_q_err,
        });
    }
}

/// What came over the receiver's line.
struct Gnss(Option<GnssReport>);

impl Format for Gnss {
    fn format(&self, f: Formatter) {
        let Some(report) = self.0 else { return };
        receiver(f, report.receiver.finding);
        nonzero!(f, report.receiver.link, {
            "gps_bad_checksums": bad_checksums,
            "gps_truncated": truncated,
            "gps_refused": refused,
            "gps_false_lengths": false_lengths,
            "gps_other_messages": other_messages,
            "gps_lone_syncs": lone_syncs,
            "gps_nmea_starts": nmea_starts,
            "gps_foreign_bytes": foreign_bytes,
        });
        nonzero!(f, report.receiver.session, {
            "cfg_rounds": rounds,
            "cfg_attempts": attempts,
            "cfg_accepted": accepted,
            "cfg_refused": refused,
            "cfg_unanswered": unanswered,
        });
        nonzero!(f, report.edges, {
            "edges_queued": queued,
            "edges_followed": followed,
            "edges_unclear": unclear,
            "edges_queue_full": queue_full,
        });
        nonzero!(f, report.receiver.line, {
            "gps_overrun": overrun,
            "gps_framing": framing,
            "gps_noise": noise,
            "gps_incoming_full": incoming_full,
            "gps_outgoing_full": outgoing_full,
        });
    }
}

/// What is known of the receiver; blanks of its words are underscores.
fn receiver(f: Formatter, finding: Finding) {
    let identity = match finding {
        Finding::Searching => return word(f, defmt::intern!("receiver"), "searching"),
        Finding::Silent => return word(f, defmt::intern!("receiver"), "none"),
        Finding::Unnamed => return word(f, defmt::intern!("receiver"), "unnamed"),
        Finding::Used(identity) => identity,
        Finding::Unused(identity, why) => {
            word(f, defmt::intern!("receiver_unused"), why.reason());
            identity
        }
    };
    word(f, defmt::intern!("receiver"), identity.model());
    word(f, defmt::intern!("receiver_firmware"), identity.firmware());
    defmt::write!(f, " receiver_protocol={=u16}", identity.protocol());
}

/// Writes ` key=text`, its blanks as underscores.
fn word(f: Formatter, key: defmt::Str, text: &str) {
    defmt::write!(f, " {=istr}", key);
    for (nth, part) in text.split(' ').enumerate() {
        let before = if nth == 0 { '=' } else { '_' };
        defmt::write!(f, "{=char}{=str}", before, part);
    }
}

/// What came over the MAVLink links, the keys of each with a word of its own before them.
struct Mavlink(Option<[LinkReport; LINKS]>);

impl Format for Mavlink {
    fn format(&self, f: Formatter) {
        let names = [defmt::intern!("mav"), defmt::intern!("mav2")];
        for (link, report) in names.into_iter().zip(self.0.iter().flatten()) {
            nonzero_of!(link, f, report.node, {
                "timesyncs": timesyncs,
                "commands": commands,
                "parameters": parameters,
                "logs": logs,
                "missing": missing,
                "unknown": unknown,
                "answers": answers,
                "for_others": for_others,
                "from_nobody": from_nobody,
            });
            nonzero_of!(link, f, report.node.framing, {
                "crc_failures": crc_failures,
                "abandoned": abandoned,
                "unknown_flags": unknown_flags,
                "signed": signed,
                "claimed": claimed,
                "foreign_bytes": foreign_bytes,
            });
            nonzero_of!(link, f, report.line, {
                "overrun": overrun,
                "framing": framing,
                "noise": noise,
                "incoming_full": incoming_full,
                "outgoing_full": outgoing_full,
            });
        }
    }
}

/// What went wrong with the card.
struct Slot(Option<CardReport>);

impl Format for Slot {
    fn format(&self, f: Formatter) {
        let Some(report) = self.0 else { return };
        if let Some(why) = report.not_saved {
            defmt::write!(f, " card={}", why);
        }
        nonzero!(f, report.errors, {
            "card_silent": silent,
            "card_crc": crc,
            "card_timeout": timeout,
            "card_fifo": fifo,
            "card_refused": refused,
        });
    }
}

/// What is not in the log.
struct Log;

impl Format for Log {
    fn format(&self, f: Formatter) {
        count(f, defmt::intern!("log_dropped"), logger::dropped());
        #[cfg(loaded)]
        count(f, defmt::intern!("load_left_out"), crate::load::left_out());
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
