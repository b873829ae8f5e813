//! The status line: once a second, everything that was counted, into the log; and over MAVLink when it
//! is asked for.
//!
//! *Design.* Pairs of `key=value` after the word `status`, so that people and programs read the same
//! line. Counters that commonly stay 0 are left out while they are 0. The counters are gone through
//! by one piece of code, whoever takes them ([`Counts`]): the log has a key as an index into the image's
//! strings, two bytes of the frame; MAVLink has its text.
//!
//! *Limits.* A line is one frame of the log, and tasks wait while that is written
//! ([`logger`]).

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use defmt::{Format, Formatter};
use embassy_time::{Duration, Ticker};
use mavlink_node::StatusWriter;
use ubx_link::Finding;
use utc_clock::{ClockState, Reading};

use crate::drivers::time;
use crate::logger;
use crate::not_saved::NotSaved;
use crate::reports::{CARD, CardReport, GNSS, GnssReport, LINKS, LinkReport, MAVLINK};
use crate::settings::VARIANT;
use crate::{clock, stack};

/// The most that the stack has held, in bytes, as of a moment in the last second.
static STACK: AtomicU32 = AtomicU32::new(0);

/// Runs forever, on the low executor.
#[embassy_executor::task]
pub async fn run() {
    let mut beat = Ticker::every(Duration::from_secs(1));
    loop {
        // It takes 240 µs to look through: after the line, which is about this moment.
        STACK.store(stack::high_water(), Relaxed);
        beat.next().await;
        log();
    }
}

/// Writes the line.
fn log() {
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
        mavlink.map_or(0, |links| links
            .iter()
            .flatten()
            .map(|link| link.node.pings)
            .sum()),
        time::lost_ticks(),
        STACK.load(Relaxed),
        InLog(&Clock(clock)),
        InLog(&Gnss(gnss)),
        InLog(&Mavlink(mavlink)),
        Slot(CARD.get()),
        InLog(&Log),
    );
}

/// The same as text, for MAVLink.
pub fn write(line: &mut StatusWriter<'_>) {
    let reading = clock::reading_at(time::now());
    let gnss = GNSS.get();
    let mavlink = MAVLINK.get();
    let clock = gnss.map(|report| report.clock).unwrap_or_default();
    let second = gnss.map(|report| report.second).unwrap_or_default();
    let source = gnss.map(|report| report.source).unwrap_or_default();
    let leap_known = if reading.leap_seconds_known {
        "true"
    } else {
        "false"
    };
    line.word("variant", VARIANT.name());
    line.word("state", reading.state.as_str());
    line.word("second", second.as_str());
    line.word("source", source.as_str());
    write_utc(line, reading);
    line.unsigned("unc_ns", reading.uncertainty_ns);
    let ppb = gnss.map_or(0, |report| report.frequency.0);
    line.number("ppb", ppb.into());
    line.word("leap_known", leap_known);
    line.unsigned("marks", clock.accepted.into());
    line.unsigned("refused", clock.refused().into());
    let pings: u32 = mavlink.map_or(0, |links| {
        links.iter().flatten().map(|link| link.node.pings).sum()
    });
    line.unsigned("pings", pings.into());
    line.unsigned("lost_ticks", time::lost_ticks().into());
    line.unsigned("stack", STACK.load(Relaxed).into());
    let slot = CARD.get();
    let card = slot.and_then(|report| report.not_saved);
    line.word("card", card.map_or("", NotSaved::advice));
    for part in [
        &Clock(clock) as &dyn Part,
        &Gnss(gnss),
        &Mavlink(mavlink),
        &Slot(slot),
        &Log,
    ] {
        part.write(line);
    }
}

/// The time in the calendar; `-` while the clock is unset.
fn write_utc(line: &mut StatusWriter<'_>, Reading { utc, state, .. }: Reading) {
    match utc.to_civil() {
        Some(t) if state != ClockState::Unset => {
            let parts = [
                (0, u64::from(t.year), 4),
                (b'-', t.month.into(), 2),
                (b'-', t.day.into(), 2),
                (b'T', t.hour.into(), 2),
                (b':', t.minute.into(), 2),
                (b':', t.second.into(), 2),
                (b'.', u64::from(t.nano.unsigned_abs() / 1_000), 6),
            ];
            line.padded("utc", &parts, b'Z');
        }
        _ => line.word("utc", "-"),
    }
}

/// Takes counters: the key for the log, the key as text, and the count.
trait Counts {
    /// A counter that is 0 is left out.
    fn count(&mut self, key: defmt::Str, text: &'static str, count: u32);

    /// A word; an empty one is left out.
    fn word(&mut self, key: defmt::Str, text: &'static str, word: &str);

    /// A counter of one of the links, whose name stands before the key.
    fn count_of(&mut self, link: &LinkName, key: defmt::Str, text: &'static str, count: u32);
}

/// What the keys of a link begin with.
struct LinkName {
    log: defmt::Str,
    text: &'static str,
}

macro_rules! link_name {
    ($name:literal) => {
        LinkName {
            log: defmt::intern!($name),
            text: $name,
        }
    };
}

/// Counters that go through [`Counts`].
trait Part {
    /// Hands over all of them.
    fn write(&self, counts: &mut dyn Counts);
}

/// A part in the log.
struct InLog<'a>(&'a dyn Part);

impl Format for InLog<'_> {
    fn format(&self, f: Formatter) {
        self.0.write(&mut Frame(f));
    }
}

/// A frame of the log.
struct Frame<'a>(Formatter<'a>);

impl Counts for Frame<'_> {
    fn count(&mut self, key: defmt::Str, _: &'static str, number: u32) {
        count(self.0, key, number);
    }

    fn word(&mut self, key: defmt::Str, _: &'static str, text: &str) {
        if !text.is_empty() {
            word(self.0, key, text);
        }
    }

    fn count_of(&mut self, link: &LinkName, key: defmt::Str, _: &'static str, number: u32) {
        count_of(self.0, link.log, key, number);
    }
}

/// Writes ` key=count` into the log if it is not 0.
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

impl Counts for StatusWriter<'_> {
    fn count(&mut self, _: defmt::Str, text: &'static str, count: u32) {
        Self::count_of(self, "", text, count);
    }

    fn word(&mut self, _: defmt::Str, text: &'static str, word: &str) {
        Self::word(self, text, word);
    }

    fn count_of(&mut self, link: &LinkName, _: defmt::Str, text: &'static str, count: u32) {
        Self::count_of(self, link.text, text, count);
    }
}

/// Hands over counters under their keys.
macro_rules! nonzero {
    ($counts:ident, $counters:expr, { $($key:literal: $field:ident,)+ }) => {
        let counters = $counters;
        $($counts.count(defmt::intern!($key), $key, counters.$field);)+
    };
}

/// The same for one of the links.
macro_rules! nonzero_of {
    ($link:ident, $counts:ident, $counters:expr, { $($key:literal: $field:ident,)+ }) => {
        let counters = $counters;
        $($counts.count_of($link, defmt::intern!($key), $key, counters.$field);)+
    };
}

/// What became of the marks.
struct Clock(utc_clock::Counters);

impl Part for Clock {
    #[inline(never)] // For the log and for MAVLink.
    fn write(&self, counts: &mut dyn Counts) {
        nonzero!(counts, self.0, {
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
            "mark_crystal": crystal,
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

impl Part for Gnss {
    #[inline(never)] // For the log and for MAVLink.
    fn write(&self, counts: &mut dyn Counts) {
        let Some(report) = self.0 else { return };
        receiver(counts, report.receiver.finding);
        nonzero!(counts, report.receiver.link, {
            "gps_bad_checksums": bad_checksums,
            "gps_truncated": truncated,
            "gps_refused": refused,
            "gps_false_lengths": false_lengths,
            "gps_other_messages": other_messages,
            "gps_lone_syncs": lone_syncs,
            "gps_nmea_starts": nmea_starts,
            "gps_foreign_bytes": foreign_bytes,
        });
        nonzero!(counts, report.receiver.session, {
            "cfg_rounds": rounds,
            "cfg_attempts": attempts,
            "cfg_accepted": accepted,
            "cfg_refused": refused,
            "cfg_unanswered": unanswered,
        });
        nonzero!(counts, report.edges, {
            "edges_queued": queued,
            "edges_followed": followed,
            "edges_unclear": unclear,
            "edges_queue_full": queue_full,
        });
        nonzero!(counts, report.receiver.line, {
            "gps_overrun": overrun,
            "gps_framing": framing,
            "gps_noise": noise,
            "gps_incoming_full": incoming_full,
            "gps_outgoing_full": outgoing_full,
        });
    }
}

/// What is known of the receiver; blanks of its words are underscores.
fn receiver(counts: &mut dyn Counts, finding: Finding) {
    let (identity, why, without_name) = match &finding {
        Finding::Searching => (None, "", "searching"),
        Finding::Silent => (None, "", "none"),
        Finding::Unnamed => (None, "", "unnamed"),
        Finding::Used(identity) => (Some(identity), "", ""),
        Finding::Unused(identity, why) => (Some(identity), why.reason(), ""),
    };
    let model = identity.map_or(without_name, |identity| identity.model());
    let firmware = identity.map_or("", |identity| identity.firmware());
    let protocol = identity.map_or(0, ubx_link::Identity::protocol);
    counts.word(defmt::intern!("receiver_unused"), "receiver_unused", why);
    counts.word(defmt::intern!("receiver"), "receiver", model);
    counts.word(
        defmt::intern!("receiver_firmware"),
        "receiver_firmware",
        firmware,
    );
    counts.count(
        defmt::intern!("receiver_protocol"),
        "receiver_protocol",
        protocol.into(),
    );
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
struct Mavlink(Option<[Option<LinkReport>; LINKS]>);

impl Part for Mavlink {
    #[inline(never)] // For the log and for MAVLink.
    fn write(&self, counts: &mut dyn Counts) {
        #[cfg(not(stanag))]
        let names = [link_name!("mav"), link_name!("mav2"), link_name!("usb")];
        #[cfg(stanag)]
        let names = [link_name!("mav"), link_name!("usb")];
        for (link, report) in names.iter().zip(self.0.iter().flatten()) {
            let Some(report) = report else { continue };
            nonzero_of!(link, counts, report.node, {
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
            nonzero_of!(link, counts, report.node.framing, {
                "crc_failures": crc_failures,
                "abandoned": abandoned,
                "unknown_flags": unknown_flags,
                "signed": signed,
                "claimed": claimed,
                "foreign_bytes": foreign_bytes,
            });
            nonzero_of!(link, counts, report.line, {
                "overrun": overrun,
                "framing": framing,
                "noise": noise,
                "incoming_full": incoming_full,
                "outgoing_full": outgoing_full,
            });
        }
        #[cfg(stanag)]
        stanag(counts);
    }
}

/// What came over the line that speaks STANAG 4586.
#[cfg(stanag)]
fn stanag(counts: &mut dyn Counts) {
    let Some(report) = crate::reports::STANAG.get() else {
        return;
    };
    nonzero!(counts, report.node, {
        "sta_requests": requests,
        "sta_malformed": malformed,
        "sta_no_key": no_key,
        "sta_loi": loi,
        "sta_unknown": unknown,
        "sta_from_our_id": from_our_id,
    });
    nonzero!(counts, report.node.framing, {
        "sta_foreign_bytes": foreign_bytes,
        "sta_sum_failures": sum_failures,
        "sta_length_failures": length_failures,
        "sta_without_sum": without_sum,
        "sta_abandoned": abandoned,
    });
    nonzero!(counts, report.line, {
        "sta_overrun": overrun,
        "sta_framing": framing,
        "sta_noise": noise,
        "sta_incoming_full": incoming_full,
        "sta_outgoing_full": outgoing_full,
    });
}

/// What went wrong with the card.
struct Slot(Option<CardReport>);

impl Format for Slot {
    fn format(&self, f: Formatter) {
        if let Some(why) = self.0.and_then(|report| report.not_saved) {
            defmt::write!(f, " card={}", why);
        }
        self.write(&mut Frame(f));
    }
}

impl Part for Slot {
    #[inline(never)] // For the log and for MAVLink.
    fn write(&self, counts: &mut dyn Counts) {
        let Some(report) = self.0 else { return };
        nonzero!(counts, report.errors, {
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

impl Part for Log {
    #[inline(never)] // For the log and for MAVLink.
    fn write(&self, counts: &mut dyn Counts) {
        counts.count(
            defmt::intern!("log_dropped"),
            "log_dropped",
            logger::dropped(),
        );
        #[cfg(loaded)]
        counts.count(
            defmt::intern!("load_left_out"),
            "load_left_out",
            crate::load::left_out(),
        );
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
