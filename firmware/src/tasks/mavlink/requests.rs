//! Requests are served, and the PINGs among them recorded.

use mavlink_node::{Command, Node, Order, Request, RequestKind};
use sample_log::{Kept, Sample, SampleLog};
use utc_clock::Reading;

use crate::clock;
use crate::clock_events::{self, ClockEvent};
use crate::drivers::uart::Writer;
use crate::samples::SAMPLES;

/// Bytes of the outgoing ring that are no answer's: HEARTBEAT and what else is sent each second takes
/// 233 of them in MAVLink 2, and has its place under any number of requests.
const KEPT: usize = 256;

/// Does what is asked, and answers.
#[inline(never)]
pub fn serve(node: &mut Node, writer: &mut Writer, request: &Request) {
    let (time, reading) = clock::node_time_and_reading_at(request.arrival);
    match request.kind {
        RequestKind::Command(Command {
            meaning: Ok(Order::Test(test)),
            ..
        }) => SAMPLES.handle_test(test),
        RequestKind::EraseLog => SAMPLES.with(SampleLog::clear),
        RequestKind::Command(_) | RequestKind::Ping { .. } | RequestKind::TimeSync { .. } => {}
    }
    let is_answered = writer.send_leaving(&node.answer(request, time), KEPT);
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
        clock_events::push(ClockEvent::LogFull);
    }
}
