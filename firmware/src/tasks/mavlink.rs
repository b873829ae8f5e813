//! The MAVLink task: requests in, answers out, and what a good citizen says once
//! a second.
//!
//! *Design.* Answers go into the outgoing ring at once. What takes many frames, the
//! parameters and the log, follows at the line's own pace: a frame only while hardly
//! anything waits in the ring, so that there is room for the answers to all requests
//! that can come in meanwhile.

use core::future::pending;

use embassy_futures::select::{Either3, select3};
use embassy_time::{Duration, Ticker, Timer};
use heapless::{String, Vec};
use mavlink_node::{Command, Config, Node, PingReply, Request, RequestKind, Severity};
use sample_log::{Kept, Sample, SampleLog};
use timebase::{CORE_HZ, StampedByte};
use utc_clock::Reading;

use crate::drivers::time;
use crate::drivers::uart::{INCOMING, Reader, Writer};
use crate::holdings;
use crate::samples::SAMPLES;
use crate::settings;
use crate::shared::{self, CLOCK_EVENTS, ClockEvent, GNSS, MAVLINK, MavlinkReport};
use crate::storage::NotSaved;
use crate::system_id::system_id;

/// A solution is told for so long, in cycles: 2 s. Then the receiver is silent.
const FIX_LASTS: i64 = 2 * CORE_HZ as i64;

/// With so many bytes or fewer in the outgoing ring, the next frame of a long answer
/// may follow: they last 5.5 ms at 115200. 173 bytes at most wait then, of 1023: the
/// rest has room for an answer to each request in a full incoming ring (19, of 26 bytes
/// each) and for what is told each second.
const NEXT_BELOW: usize = 64;

/// How often that is looked at, shorter than these bytes last.
const PACE: Duration = Duration::from_millis(5);

/// Runs for ever, on the prompt executor.
#[embassy_executor::task]
pub async fn run(mut reader: Reader, mut writer: Writer) {
    let mut node = Node::new(Config {
        system_id: system_id(),
        component_id: 1,
        ping_reply: if settings::PING_ECHO {
            PingReply::Echo
        } else {
            PingReply::RtosTime
        },
    });
    let mut batch = [StampedByte::default(); INCOMING];
    let mut beat = Ticker::every(Duration::from_secs(1));
    loop {
        let has_more = node.has_more();
        let pace = async move {
            if has_more {
                Timer::after(PACE).await;
            } else {
                pending::<()>().await;
            }
        };
        let woken = select3(reader.wait(), beat.next(), pace).await;
        if matches!(woken, Either3::Second(())) {
            once_a_second(&mut node, &mut writer);
            MAVLINK.tell(MavlinkReport {
                node: node.counters(),
                line: reader.errors(),
            });
        }
        let now = time::now();
        let mut waiting = 0;
        reader.take(|bytes| {
            let end = waiting + bytes.len();
            if let Some(free) = batch.get_mut(waiting..end) {
                free.copy_from_slice(bytes);
                waiting = end;
            }
        });
        for &byte in batch.get(..waiting).unwrap_or_default() {
            if let Some(request) = node.push(byte, now) {
                serve(&mut node, &mut writer, &request);
            }
        }
        while node.has_more()
            && writer.waiting() <= NEXT_BELOW
            && let Some(frame) = node.poll(&holdings::Board)
        {
            writer.send(&frame);
        }
    }
}

/// Does what is asked, and answers.
#[inline(never)]
fn serve(node: &mut Node, writer: &mut Writer, request: &Request) {
    let (time, reading) = shared::told_at(request.arrival);
    match request.kind {
        RequestKind::Command(Command {
            meaning: Ok(test), ..
        }) => SAMPLES.handle_test(test),
        RequestKind::EraseLog => SAMPLES.with(SampleLog::clear),
        RequestKind::Command(_) | RequestKind::Ping { .. } | RequestKind::TimeSync { .. } => {}
    }
    let is_answered = writer.send(&node.answer(request, time));
    if let RequestKind::Ping { time_usec, seq } = request.kind
        && is_answered
    {
        record(time_usec, seq, time.rtos_ns(), reading);
    }
}

/// Keeps a PING that was answered in the log.
fn record(ping_us: u64, sequence: u32, board_ns: i64, reading: Reading) {
    let sample = Sample {
        board_ns,
        ping_us,
        sequence,
        state: reading.state,
        uncertainty_ns: reading.uncertainty_ns,
    };
    if SAMPLES.with(|log| log.record(&sample)) == Kept::Last {
        // A full queue means that nobody listens; PC_LOG_MISSED has it.
        let _ = CLOCK_EVENTS.try_send(ClockEvent::LogFull);
    }
}

/// HEARTBEAT, SYSTEM_TIME, GPS_RAW_INT, and what the clock did.
#[inline(never)]
fn once_a_second(node: &mut Node, writer: &mut Writer) {
    let now = time::now();
    // Once a second is soon enough, and spares a timer at every burst of bytes.
    node.handle_timeout(now);
    let node_time = shared::node_time(now);
    writer.send(&node.heartbeat(node_time));
    writer.send(&node.system_time(node_time));
    let recent = GNSS
        .get()
        .and_then(|report| report.fix)
        .filter(|(arrival, _)| now.since(*arrival) < FIX_LASTS);
    let (fix_time, fix) = match recent {
        Some((arrival, fix)) => (shared::node_time(arrival), Some(fix)),
        None => (node_time, None),
    };
    writer.send(&node.gps_raw_int(fix_time, fix.as_ref()));
    while let Ok(news) = CLOCK_EVENTS.try_receive() {
        let severity = match news {
            ClockEvent::Set | ClockEvent::PulseFollowed | ClockEvent::Saved { .. } => {
                Severity::Notice
            }
            ClockEvent::Stepped { .. }
            | ClockEvent::PulseLost
            | ClockEvent::LogFull
            | ClockEvent::NotSaved(_) => Severity::Warning,
        };
        writer.send(&node.statustext(severity, &in_words(news)));
    }
}

/// What happened, in less than the 50 characters of a STATUSTEXT.
fn in_words(news: ClockEvent) -> String<50> {
    let mut text = String::new();
    let (before, number, behind) = match news {
        ClockEvent::Set => ("clock set", None, ""),
        ClockEvent::Stepped { by_ns } => ("clock stepped by ", Some(by_ns), " ns"),
        ClockEvent::PulseFollowed => ("clock follows the pulse", None, ""),
        ClockEvent::PulseLost => ("clock lost the pulse", None, ""),
        ClockEvent::LogFull => ("log full", None, ""),
        ClockEvent::Saved { file, samples } => {
            push_number(&mut text, samples.into());
            (" samples saved to the card, file ", Some(file.into()), "")
        }
        ClockEvent::NotSaved(why) => {
            let why = match why {
                NotSaved::NoSlot => "this board has no card slot",
                NotSaved::NoCard => "no card in the slot",
                NotSaved::NotFat => "format the card as FAT32",
                NotSaved::WriteProtected => "the card is write-protected",
                NotSaved::Full => "the card is full",
                NotSaved::Pulled => "the card was pulled",
                NotSaved::Failed => "the card fails",
                NotSaved::Cleared => "a new test has begun",
            };
            ("log not saved: ", None, why)
        }
    };
    // All of it fits.
    let _ = text.push_str(before);
    if let Some(number) = number {
        push_number(&mut text, number);
    }
    let _ = text.push_str(behind);
    text
}

/// Writes a number by hand: `core::fmt` would bring 2 KB for this one.
fn push_number(text: &mut String<50>, number: i64) {
    let mut digits = Vec::<u8, 20>::new();
    let mut rest = number.unsigned_abs();
    while rest > 0 || digits.is_empty() {
        // 2⁶⁴ has 20 digits.
        let _ = digits.push(b'0' + (rest % 10) as u8);
        rest /= 10;
    }
    if number < 0 {
        let _ = text.push('-');
    }
    for digit in digits.iter().rev() {
        let _ = text.push(char::from(*digit));
    }
}
