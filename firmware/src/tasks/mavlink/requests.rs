//! Requests are served, and the PINGs among them recorded.

use mavlink_node::{Command, Node, Order, Refusal, Request, RequestKind, Test};
use sample_log::{BeginGuard, Kept, Sample, SampleLog};
use timebase::Cycles;
use utc_clock::Reading;

use super::outgoing::Outgoing;
use crate::bootloader;
use crate::clock;
use crate::clock_events::{self, ClockEvent};
use crate::samples::SAMPLES;

/// Bytes of the outgoing ring that are no answer's: HEARTBEAT and what else is sent each second takes
/// 233 of them in MAVLink 2, and has its place under any number of requests.
const KEPT: usize = 256;

/// Does what is asked, and answers; whether the log is another one now.
#[inline(never)]
pub fn serve(
    node: &mut Node,
    out: &mut dyn Outgoing,
    guard: &mut BeginGuard,
    request: &Request,
) -> bool {
    let mut is_new_log = false;
    let (time, reading) = clock::node_time_and_reading_at(request.arrival);
    let mut request = *request;
    match &mut request.kind {
        RequestKind::Command(Command { meaning, .. }) => {
            if let Ok(Order::Test(test)) = *meaning {
                if may_obey(guard, test, request.arrival) {
                    SAMPLES.handle_test(test);
                    is_new_log = test == Test::Begins;
                } else {
                    *meaning = Err(Refusal::NotYet);
                }
            }
        }
        RequestKind::EraseLog => {
            SAMPLES.with(SampleLog::clear);
            is_new_log = true;
        }
        RequestKind::Ping { .. } | RequestKind::TimeSync { .. } => {}
    }
    let is_answered = out.send_leaving(&node.answer(&request, time), KEPT);
    if let RequestKind::Ping { time_usec, seq } = request.kind
        && is_answered
    {
        record(time_usec, seq, time.rtos_ns(), reading);
    }
    if let RequestKind::Command(Command { meaning, .. }) = request.kind
        && meaning == Ok(Order::Bootloader)
        && is_answered
    {
        bootloader::call();
    }
    is_new_log
}

/// Whether no samples are lost by a command, and it has a log to act on.
fn may_obey(guard: &mut BeginGuard, test: Test, now: Cycles) -> bool {
    match test {
        Test::Begins => {
            let unsaved = SAMPLES.with(|log| log.unsaved());
            let may_begin = guard.handle_begin(unsaved, now);
            if !may_begin {
                clock_events::push(ClockEvent::Unsaved(unsaved));
            }
            may_begin
        }
        // Of a test that has not ended there is nothing to be saved again.
        Test::SavesAgain => SAMPLES.with(|log| log.is_frozen()),
        Test::Ends | Test::StopsSaving => true,
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
