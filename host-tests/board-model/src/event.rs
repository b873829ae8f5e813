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
    /// The time pulse rises.
    Rise,
    /// It falls, after it rose at that moment. \[ns\]
    Fall {
        /// The stamp of its rise.
        rose_ns: i64,
    },
    /// TIM-TP, for the next pulse.
    Forecast {
        /// How late that pulse will be, where the receiver says so. \[ps\]
        late_ps: Option<i32>,
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
    let mut on_wire = Pulses::new(receiver).peekable();
    // A pulse that begins while another lasts is none on the wire.
    let on_wire = std::iter::from_fn(move || {
        let mut pulse = on_wire.next()?;
        while let Some(next) = on_wire.next_if(|next| next.edge.0 <= pulse.end.0) {
            pulse.end = pulse.end.max(next.end);
        }
        Some(pulse)
    });
    let mut pulses = on_wire
        .flat_map(move |pulse| {
            let [rise, fall] = edges(&pulse);
            forecast(&pulse, is_forecast)
                .into_iter()
                .chain([rise, fall])
        })
        .peekable();
    Box::new(std::iter::from_fn(move || {
        let pulse_ns = pulses.peek().map(|event| event.handled_ns);
        let is_first = |mark: &Event| pulse_ns.is_none_or(|pulse_ns| mark.handled_ns <= pulse_ns);
        marks.next_if(is_first).or_else(|| pulses.next())
    }))
}

fn edges(pulse: &Pulse) -> [Event; 2] {
    let rose_ns = pulse.edge.0.cast_signed();
    let at = |stamped_ns, kind| Event {
        stamped_ns,
        handled_ns: stamped_ns + PULSE_TASK_NS,
        kind,
    };
    [
        at(rose_ns, EventKind::Rise),
        at(pulse.end.0.cast_signed(), EventKind::Fall { rose_ns }),
    ]
}

/// The TIM-TP of a pulse; none for an edge that stands for no second.
fn forecast(pulse: &Pulse, says_late: bool) -> Option<Event> {
    let stamped_ns = (pulse.edge.0.cast_signed() - FORECAST_AHEAD_NS).max(0);
    pulse.utc_s.is_some().then_some(Event {
        stamped_ns,
        handled_ns: stamped_ns + FORECAST_NS,
        kind: EventKind::Forecast {
            late_ps: says_late.then_some(pulse.late_ps),
        },
    })
}
