//! What happens to a board, in the order in which its tasks handle it.
//!
//! *Design.* Marks, pulses and forecasts of one receiver, merged. Each has the moment of its stamp
//! and the moment of its handling: a message's last byte, a pulse's interrupt, and a wake-up.

use utc_clock::UtcNanos;
use world::{Arrivals, Pulse, Pulses};

use crate::Scenario;
use crate::time::{FORECAST_AHEAD_NS, FORECAST_NS, FRAME_NS, PULSE_TASK_NS};

/// Something that happens to a board. Times are true time since the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// The moment that its stamp shows. \[ns\]
    pub stamped_ns: i64,
    /// The moment at which its task handles it. \[ns\]
    pub handled_ns: i64,
    /// What it is.
    pub kind: EventKind,
}

/// What can happen to a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// A good time mark.
    Mark {
        /// The epoch that it names.
        epoch: UtcNanos,
    },
    /// A rising edge of the time pulse.
    Pulse,
    /// TIM-TP, for the next pulse.
    Forecast {
        /// How late that pulse will be. \[ps\]
        late_ps: i32,
    },
}

/// The events of a scenario, without an end unless everything is lost.
pub(crate) fn events(scenario: &Scenario) -> Box<dyn Iterator<Item = Event>> {
    let lost = scenario.messages_lost.clone();
    let for_ever = lost.iter().find(|lost| lost.end == i64::MAX);
    let end_ns = for_ever.map_or(i64::MAX, |lost| lost.start);
    let mut marks = Arrivals::new(&scenario.receiver)
        .map(|arrival| Event {
            stamped_ns: arrival.first_byte_end.0.cast_signed(),
            handled_ns: arrival.first_byte.0.cast_signed() + FRAME_NS,
            kind: EventKind::Mark {
                epoch: UtcNanos(arrival.epoch_utc_ns),
            },
        })
        .take_while(move |event| event.stamped_ns < end_ns)
        .filter(move |event| !lost.iter().any(|lost| lost.contains(&event.stamped_ns)))
        .peekable();
    let Some(receiver) = &scenario.pulse else {
        return Box::new(marks);
    };
    let is_forecast = receiver.port.tim_tp_every > 0;
    let mut pulses = Pulses::new(receiver)
        .flat_map(move |pulse| {
            let forecast = forecast(&pulse).filter(|_| is_forecast);
            forecast.into_iter().chain([edge(&pulse)])
        })
        .peekable();
    Box::new(std::iter::from_fn(move || {
        let pulse_ns = pulses.peek().map(|event| event.handled_ns);
        let is_first = |mark: &Event| pulse_ns.is_none_or(|pulse_ns| mark.handled_ns <= pulse_ns);
        marks.next_if(is_first).or_else(|| pulses.next())
    }))
}

fn edge(pulse: &Pulse) -> Event {
    let edge_ns = pulse.edge.0.cast_signed();
    Event {
        stamped_ns: edge_ns,
        handled_ns: edge_ns + PULSE_TASK_NS,
        kind: EventKind::Pulse,
    }
}

/// The TIM-TP of a pulse; none for an edge that stands for no second.
fn forecast(pulse: &Pulse) -> Option<Event> {
    let stamped_ns = (pulse.edge.0.cast_signed() - FORECAST_AHEAD_NS).max(0);
    pulse.utc_s.is_some().then_some(Event {
        stamped_ns,
        handled_ns: stamped_ns + FORECAST_NS,
        kind: EventKind::Forecast {
            late_ps: pulse.late_ps,
        },
    })
}
