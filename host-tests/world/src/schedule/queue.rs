//! The queue of a receiver's line.
//!
//! *Design.* Messages leave one after the other. A line that is full of other messages
//! holds all of them back by the lag of the moment, and has been busy since the lag
//! began.

use super::{FaultKind, Schedule};
use crate::{Event, EventKind, WorldPicos};

/// A byte at 115200 baud, in ns.
const BYTE_NS: i64 = 86_800;
/// A gap of two byte times ends what is busy, in ns.
const GAP_NS: i64 = 2 * BYTE_NS;

/// A message that waits to leave.
pub(super) struct Ready {
    /// When it is ready to leave, in ns.
    pub(super) at_ns: i64,
    /// How long its frame is.
    pub(super) bytes: i64,
    /// What it says.
    pub(super) kind: EventKind,
}

impl Schedule {
    /// Lets messages leave one after the other.
    pub(super) fn queue(&self, ready: Vec<Ready>) -> Vec<Event> {
        let mut events = Vec::with_capacity(ready.len());
        let mut free_ns = i64::MIN;
        let mut busy_since_ns = i64::MIN;
        for message in ready {
            let made_s = message.at_ns as f64 * 1e-9;
            let mut start_ns = message.at_ns;
            let others_ns = self.others_ns(made_s);
            if start_ns > free_ns.saturating_add(GAP_NS) {
                // The line was idle; the others of its burst leave first.
                busy_since_ns = start_ns;
                start_ns += others_ns;
            }
            if let Some((begin_ns, lag_ns)) = self.lag(made_s) {
                start_ns = message.at_ns + lag_ns;
                busy_since_ns = busy_since_ns.min(begin_ns);
            }
            let start_ns = start_ns.max(free_ns);
            free_ns = start_ns + message.bytes * BYTE_NS;
            let busy_us = (start_ns - busy_since_ns + 999) / 1_000;
            events.push(Event {
                at: WorldPicos::from_nanos(start_ns),
                kind: with_busy(message.kind, busy_us.unsigned_abs()),
            });
        }
        events
    }

    /// For how long other messages leave first, in ns.
    fn others_ns(&self, at_s: f64) -> i64 {
        let ms: f64 = self
            .faults
            .iter()
            .map(|fault| match fault.kind {
                FaultKind::Queue { by_ms, edge_s } => by_ms * fault.share(at_s, edge_s),
                _ => 0.0,
            })
            .sum();
        (ms * 1e6) as i64
    }

    /// Since when the line is full, and by how much what is ready now leaves later, in
    /// ns.
    fn lag(&self, at_s: f64) -> Option<(i64, i64)> {
        let mut worst: Option<(f64, f64)> = None;
        for fault in self.faults_at(at_s) {
            if let FaultKind::Lag {
                peak_s,
                rise_s,
                fall_s,
            } = fault.kind
            {
                let rises = if rise_s > 0.0 {
                    (at_s - fault.from_s) / rise_s
                } else {
                    1.0
                };
                let falls = (fault.until_s - at_s) / fall_s;
                let lag_s = peak_s * rises.min(falls).clamp(0.0, 1.0);
                // Full since before the start: for longer than what it lags by.
                let begin_s = if rise_s > 0.0 {
                    fault.from_s
                } else {
                    fault.from_s - peak_s - 1.0
                };
                worst = Some(match worst {
                    Some((begin, lag)) => (begin_s.min(begin), lag_s.max(lag)),
                    None => (begin_s, lag_s),
                });
            }
        }
        worst.map(|(begin_s, lag_s)| ((begin_s * 1e9) as i64, (lag_s * 1e9) as i64))
    }
}

/// The same message with how long the line had been busy.
const fn with_busy(mut kind: EventKind, us: u64) -> EventKind {
    if let EventKind::Mark { busy_us, .. }
    | EventKind::Mark60 { busy_us, .. }
    | EventKind::TimTp { busy_us, .. }
    | EventKind::TimeLs { busy_us, .. } = &mut kind
    {
        *busy_us = Some(us);
    }
    kind
}
