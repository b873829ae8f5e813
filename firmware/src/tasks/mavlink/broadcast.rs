//! What is sent once a second without being asked for.

use heapless::Vec;
use mavlink_node::{Node, Plotted};
use timebase::{CORE_HZ, ClockState, Cycles};
use utc_clock::{Reading, SecondProof, Source};

use super::link::Link;
use super::outgoing::Outgoing;
use super::source::number;
use super::words;
use crate::clock;
use crate::clock_events::{self, ClockEvent};
use crate::drivers::time;
use crate::reports::{GNSS, GnssReport};
use crate::settings::VARIANT;

/// A solution is sent for this time after its arrival, in cycles: 2 s. Later the receiver counts as
/// silent.
const FIX_LASTS: i64 = 2 * CORE_HZ as i64;

/// What happened since the second before, for all links.
pub type News = Vec<ClockEvent, { clock_events::ROOM }>;

/// Takes what happened.
pub fn news() -> News {
    core::iter::from_fn(clock_events::poll)
        .take(clock_events::ROOM)
        .collect()
}

/// HEARTBEAT, SYSTEM_TIME, GPS_RAW_INT, what is plotted, and a STATUSTEXT for each event, on every link that is open.
#[inline(never)]
pub fn once_a_second<'a>(links: impl Iterator<Item = &'a mut Link>, news: &News) {
    let report = GNSS.get();
    for link in links {
        let now = time::now();
        // Once a second is soon enough, and spares a timer at every burst of bytes.
        link.node.handle_timeout(now);
        if let Some(out) = link.port.open() {
            broadcast(&mut link.node, out, now, report.as_ref(), news);
        }
    }
}

fn broadcast(
    node: &mut Node,
    out: &mut dyn Outgoing,
    now: Cycles,
    report: Option<&GnssReport>,
    news: &News,
) {
    let (node_time, reading) = clock::node_time_and_reading_at(now);
    out.send(&node.heartbeat(node_time));
    out.send(&node.system_time(node_time, is_reported(reading.state)));
    let recent = report
        .and_then(|report| report.receiver.fix)
        .filter(|(arrival, _)| now.since(*arrival) < FIX_LASTS);
    let (fix_time, fix) = match recent {
        Some((arrival, fix)) => (clock::node_time_at(arrival), Some(fix)),
        None => (node_time, None),
    };
    out.send(&node.gps_raw_int(fix_time, fix.as_ref()));
    for what in Plotted::ALL {
        out.send(&node.plot(node_time, what, value(what, &reading, report)));
    }
    for event in news {
        let (severity, text) = words::statustext(*event);
        out.send(&node.statustext(severity, &text));
    }
}

/// Whether SYSTEM_TIME has UTC: a PX4 sends what it has, and so do the paper's variants.
fn is_reported(state: ClockState) -> bool {
    state.is_proved() || VARIANT.is_papers()
}

/// The value of what is plotted.
fn value(what: Plotted, reading: &Reading, report: Option<&GnssReport>) -> f32 {
    let source = report.map_or(Source::Nothing, |report| report.source);
    match what {
        Plotted::Uncertainty if reading.state == ClockState::Unset => f32::NAN,
        // Rounded, and then by one unit up, so that the interval holds UTC.
        Plotted::Uncertainty => (reading.uncertainty_ns as f32).next_up(),
        Plotted::Frequency => report.map_or(0.0, |report| report.frequency.0 as f32),
        Plotted::Source => f32::from(number(source)),
        Plotted::Unproved => {
            let second = report.map_or(SecondProof::Open, |report| report.second);
            let parts = [
                (1, second == SecondProof::Open),
                (2, second == SecondProof::Contradicted),
                (4, source != Source::Pulse),
                (8, source == Source::Nothing),
            ];
            let unproved = parts.into_iter().filter(|(_, is_unproved)| *is_unproved);
            f32::from(unproved.map(|(bit, _)| bit).sum::<u8>())
        }
    }
}
