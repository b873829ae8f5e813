//! NAV-TIMELS: the answers to the firmware's polls.
//!
//! *Design.* The firmware polls often until the count is known, around an announced
//! event, and while the second is contradicted; else seldom.

use super::belief::Belief;
use super::queue::Ready;
use super::{FaultKind, LEAP_COUNT, Schedule};
use crate::EventKind;
use crate::chance::{Stream, even, stream};

const NS_PER_S: i64 = 1_000_000_000;
/// Bytes of its frame.
const TIME_LS_BYTES: i64 = 32;
/// The first poll of NAV-TIMELS, in s.
const FIRST_POLL_S: f64 = 1.05;
/// From poll to poll until the count is known, and then, in s.
const POLL_UNRESOLVED_S: f64 = 10.0;
const POLL_RESOLVED_S: f64 = 600.0;
/// Around an event it polls often, from so long before to so long after, in s.
const POLL_BEFORE_EVENT_S: f64 = 60.0;
const POLL_AFTER_EVENT_S: f64 = 120.0;
/// A contradicted second is asked about after so long, in s.
const POLL_CONTRADICTED_S: f64 = 1.0;
/// What NAV-TIMELS says of the past leap second: 2017-01-01, in s since 1970.
const LAST_LEAP_S: i64 = 1_483_228_800;
/// A leap second that is announced for months later, in s.
const MONTHS_S: i32 = 19_090_556;

impl Schedule {
    /// The answers to the polls of NAV-TIMELS, at the times at which the firmware polls.
    pub(super) fn leap_answers(&self) -> Vec<Ready> {
        let mut rng = stream(self.seed, Stream::ScheduleLeap);
        // Besides, it polls when the second is contradicted, and when that ends.
        let mut begins: Vec<f64> = self
            .faults
            .iter()
            .filter(|fault| fault.kind.is_contradiction())
            .flat_map(|fault| match fault.kind {
                FaultKind::Restart { silent_s, .. } => [fault.from_s + silent_s, fault.until_s],
                _ => [fault.from_s, fault.until_s],
            })
            .map(|at_s| at_s + POLL_CONTRADICTED_S)
            .collect();
        begins.sort_by(f64::total_cmp);
        let mut begins = begins.into_iter().peekable();
        let mut answers = Vec::new();
        let mut poll_s = FIRST_POLL_S;
        while poll_s < self.lasts_s {
            let ready_s = poll_s + 0.02 + 0.1 * even(&mut rng);
            let belief = self.belief(ready_s);
            let is_resolved = belief.leap_source != 0
                && belief.leap_count >= LEAP_COUNT
                && !matches!(belief.leap_source, 6 | 255);
            if !belief.is_silent {
                answers.push(Ready {
                    at_ns: (ready_s * 1e9) as i64,
                    bytes: TIME_LS_BYTES,
                    kind: self.time_ls(ready_s, &belief),
                });
            }
            let contradicted = self
                .faults_at(poll_s)
                .any(|fault| fault.kind.is_contradiction());
            let next_s = if is_resolved && !belief.is_silent && !contradicted {
                self.next_poll_s(poll_s)
            } else {
                poll_s + POLL_UNRESOLVED_S
            };
            while begins.next_if(|begin_s| *begin_s <= poll_s).is_some() {}
            poll_s = begins.peek().map_or(next_s, |begin_s| begin_s.min(next_s));
        }
        answers
    }

    /// When the firmware polls again where the count is known: often around an event.
    fn next_poll_s(&self, poll_s: f64) -> f64 {
        let seldom_s = poll_s + POLL_RESOLVED_S;
        let Some(leap_s) = self.leap_at_s else {
            return seldom_s;
        };
        let around = leap_s - POLL_BEFORE_EVENT_S..leap_s + POLL_AFTER_EVENT_S;
        if around.contains(&poll_s) {
            poll_s + POLL_UNRESOLVED_S
        } else if poll_s < around.start {
            seldom_s.min(around.start)
        } else {
            seldom_s
        }
    }

    fn time_ls(&self, at_s: f64, belief: &Belief) -> EventKind {
        let has_sky = belief.leap_source != 0;
        let mut change = 0;
        let to_event_s = match self.leap_at_s {
            _ if !has_sky => 0,
            _ if belief.is_leap_early => MONTHS_S,
            Some(leap_s) => {
                change = i8::from(!self.is_after_leap(at_s));
                let late_s = f64::from(u8::from(self.receiver.is_event_late));
                (leap_s + late_s - at_s).ceil() as i32
            }
            None => {
                let since_s = self.start_utc_ns / NS_PER_S + at_s as i64 - LAST_LEAP_S;
                -since_s as i32
            }
        };
        EventKind::TimeLs {
            source: belief.leap_source,
            count: belief.leap_count,
            change,
            to_event_s,
            busy_us: None,
        }
    }
}
