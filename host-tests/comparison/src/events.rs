//! What happens to a board, in the order in which it gets round to it.
//!
//! *Purpose.* Marks, pulses and forecasts of one receiver as one row.
//!
//! *Design.* Each has the moment that it is stamped with and the one at which its
//! task has it: a frame's last byte, a pulse's interrupt and wake-up.
//!
//! *Limits.* The tasks of a board are never late.

use world::{Arrivals, Pulses, ReceiverSettings};

use crate::case::{Case, Lost, Pulse, SECOND};

/// From a frame's first byte to its handling, in ns: 100 bytes at 115200 baud.
pub const FRAME_NS: u64 = 8_700_000;
/// A TIM-TP begins so long before its pulse, in ns.
const FORECAST_AHEAD_NS: u64 = 500_000_000;
/// And takes 24 bytes.
const FORECAST_NS: u64 = 2_100_000;
/// From a pulse's edge to its handling, in ns.
const PULSE_TASK_NS: u64 = 20_000;

/// Something that happened, in ns of the world's time.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// When: its stamp.
    pub happened: u64,
    /// When its task has it.
    pub handled: u64,
    /// What it was.
    pub what: What,
}

/// What can happen.
#[derive(Clone, Copy, Debug)]
pub enum What {
    /// A time message.
    Mark {
        /// What it tells.
        epoch_utc_ns: i64,
    },
    /// An edge of the time pulse.
    Pulse,
    /// What the receiver says about its next pulse.
    Forecast {
        /// By how much that will be late, in ps.
        late_ps: i32,
    },
}

/// The events of a board with such a receiver, for ever or until nothing is left.
pub fn events(case: &Case, receiver: &ReceiverSettings) -> impl Iterator<Item = Event> {
    let ends = |what| match case.lost {
        Some((lost, second)) if lost == what => second * SECOND,
        _ => u64::MAX,
    };
    let marks_end = ends(Lost::Messages);
    let pulses_end = ends(Lost::Pulse);
    let marks = Arrivals::new(receiver)
        .map(|arrival| Event {
            happened: arrival.first_byte_end.0,
            handled: arrival.first_byte.0 + FRAME_NS,
            what: What::Mark {
                epoch_utc_ns: arrival.epoch_utc_ns,
            },
        })
        .take_while(move |event| event.happened < marks_end);
    let forecasts = case.pulse == Some(Pulse::Forecast);
    let pulses = case
        .pulse
        .map(|_| Pulses::new(receiver))
        .into_iter()
        .flatten()
        .take_while(move |pulse| pulse.edge.0 < pulses_end)
        .flat_map(move |pulse| {
            let edge = pulse.edge.0;
            let happened = edge.saturating_sub(FORECAST_AHEAD_NS);
            let forecast = forecasts.then_some(Event {
                happened,
                handled: happened + FORECAST_NS,
                what: What::Forecast {
                    late_ps: pulse.late_ps,
                },
            });
            let pulse = Event {
                happened: edge,
                handled: edge + PULSE_TASK_NS,
                what: What::Pulse,
            };
            forecast.into_iter().chain([pulse])
        });
    Merged {
        one: marks.peekable(),
        other: pulses.peekable(),
    }
}

/// Two rows as one, the earlier first.
struct Merged<A: Iterator, B: Iterator> {
    one: std::iter::Peekable<A>,
    other: std::iter::Peekable<B>,
}

impl<A, B> Iterator for Merged<A, B>
where
    A: Iterator<Item = Event>,
    B: Iterator<Item = Event>,
{
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        let pulse = self.other.peek().map(|event| event.handled);
        let first = |mark: &Event| pulse.is_none_or(|pulse| mark.handled <= pulse);
        self.one.next_if(first).or_else(|| self.other.next())
    }
}
