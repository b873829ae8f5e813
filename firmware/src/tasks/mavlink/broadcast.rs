//! What is sent once a second without being asked for.

use mavlink_node::Node;
use timebase::CORE_HZ;

use super::words;
use crate::drivers::time;
use crate::drivers::uart::Writer;
use crate::reports::GNSS;
use crate::{clock, clock_events};

/// A solution is sent for this time after its arrival, in cycles: 2 s. Later the receiver counts as
/// silent.
const FIX_LASTS: i64 = 2 * CORE_HZ as i64;

/// HEARTBEAT, SYSTEM_TIME, GPS_RAW_INT, and a STATUSTEXT for each event.
#[inline(never)]
pub fn once_a_second(node: &mut Node, writer: &mut Writer) {
    let now = time::now();
    // Once a second is soon enough, and spares a timer at every burst of bytes.
    node.handle_timeout(now);
    let node_time = clock::node_time_at(now);
    writer.send(&node.heartbeat(node_time));
    writer.send(&node.system_time(node_time));
    let recent = GNSS
        .get()
        .and_then(|report| report.receiver.fix)
        .filter(|(arrival, _)| now.since(*arrival) < FIX_LASTS);
    let (fix_time, fix) = match recent {
        Some((arrival, fix)) => (clock::node_time_at(arrival), Some(fix)),
        None => (node_time, None),
    };
    writer.send(&node.gps_raw_int(fix_time, fix.as_ref()));
    while let Some(event) = clock_events::poll() {
        let (severity, text) = words::statustext(event);
        writer.send(&node.statustext(severity, &text));
    }
}
