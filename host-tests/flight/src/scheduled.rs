//! A drawn schedule as a flight.

use world::schedule::Schedule;

use crate::{Crystal, Flight, Header, Knot, LeapStep, PulseShape, Window, WorldPicos};

/// Each fault is a window, and its figures are a comment.
impl From<&Schedule> for Flight {
    fn from(schedule: &Schedule) -> Self {
        let knots = schedule
            .crystal
            .iter()
            .map(|&(at_s, ppm)| Knot { at_s, ppm })
            .collect();
        let windows = schedule.faults.iter().map(|fault| Window {
            from_s: fault.from_s,
            until_s: fault.until_s.min(schedule.lasts_s),
            name: fault.kind.name().to_owned(),
        });
        // True UTC goes on through second 60 and steps at its end.
        let leaps = schedule.leap_at_s.iter().map(|leap_s| LeapStep {
            at: WorldPicos::from_secs(leap_s + 1.0),
            by_ns: -1_000_000_000,
        });
        let mut comments = vec![
            format!("seed {}", schedule.seed),
            format!("{:?}", schedule.receiver),
        ];
        comments.extend(schedule.faults.iter().map(ToString::to_string));
        Self {
            header: Header {
                crystal: Crystal::new(knots),
                start_utc_ns: schedule.start_utc_ns,
                leaps: leaps.collect(),
                pulse: Some(PulseShape {
                    width_ns: (schedule.receiver.width_ms * 1e6) as u32,
                    is_high: true,
                }),
                windows: windows.collect(),
                comments,
                ..Header::default()
            },
            events: schedule.events(),
        }
    }
}
