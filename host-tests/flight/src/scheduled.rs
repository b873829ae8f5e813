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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_of_a_schedule_is_the_flight_that_was_judged() {
        for seed in 0..6 {
            let schedule = Schedule::draw(seed);
            let flight = Flight::from(&schedule);
            let read = Flight::parse(&flight.to_string());
            assert_eq!(read, Ok(flight.clone()), "{seed}");
            assert_eq!(flight.header.windows.len(), schedule.faults.len());
        }
    }

    #[test]
    fn true_utc_steps_back_at_the_end_of_second_60() {
        let leaping = (0..).map(Schedule::draw);
        let mut leaping = leaping.filter(|schedule| schedule.leap_at_s.is_some());
        let schedule = leaping.next().expect("one in twelve");
        let leap_s = schedule.leap_at_s.expect("it has one");
        let header = Flight::from(&schedule).header;
        let of_day_ns = |after_s: f64| {
            let at = WorldPicos::from_secs(leap_s + after_s);
            header.utc_ns(at) % 86_400_000_000_000
        };
        // Midnight, once with second 60 and once more after it.
        assert_eq!([0.0, 1.0].map(of_day_ns), [0, 0]);
    }
}
