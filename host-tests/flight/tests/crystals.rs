//! Crystals that are farther off than is promised: refused in words, unset or within the claim.
//!
//! *Design.* Schedules of `integrity` without their faults, on a board whose crystal is off by so
//! much. 110 ppm are allowed for.

use flight::judge::Tally;
use flight::player::{self, Setup};
use flight::{Crystal, Flight, Knot};
use world::schedule::Schedule;

/// How long it takes to be noticed: 20 s of marks and 8 pulses, or five blocks of 50 s.
const NOTICED_S: (f64, f64) = (60.0, 270.0);

/// What became of a clock.
struct Played {
    tally: Tally,
    /// Readings that were set after the crystal had to be noticed, by the pulse or by messages.
    set_late: (u64, u64),
    refused_for_it: u64,
}

fn play(schedule: &Schedule, ppm: f64) -> Played {
    let mut flight = Flight::from(schedule);
    flight.header.crystal = Crystal::new(vec![Knot { at_s: 0.0, ppm }]);
    let mut tally = Tally::default();
    let mut set_late = (0, 0);
    let totals = player::play(&flight, &Setup::default(), |reading| {
        tally.push(reading, flight.header.utc_ns(reading.at));
        let (at_s, is_set) = (reading.at.as_secs(), reading.claim().is_some());
        set_late.0 += u64::from(is_set && at_s > NOTICED_S.0);
        set_late.1 += u64::from(is_set && at_s > NOTICED_S.1);
    });
    let refused = totals.counters.iter().find(|(name, _)| *name == "crystal");
    Played {
        tally,
        set_late,
        refused_for_it: refused.expect("it is counted").1,
    }
}

/// Schedules without faults, of receivers that know everything from the start.
fn healthy(has_pulse: bool) -> impl Iterator<Item = Schedule> {
    (0..)
        .map(Schedule::draw)
        .filter(move |schedule| {
            let receiver = &schedule.receiver;
            receiver.has_pulse == has_pulse
                && receiver.valid_from_s == 0.0
                && schedule.leap_at_s.is_none()
        })
        .map(|mut schedule| {
            schedule.faults.clear();
            schedule
        })
        .take(6)
}

#[test]
fn a_crystal_beyond_its_promise_never_misleads() {
    for ppm in [-500.0, -300.0, -150.0, 150.0, 300.0, 500.0] {
        for schedule in healthy(false).chain(healthy(true)) {
            let (seed, has_pulse) = (schedule.seed, schedule.receiver.has_pulse);
            let played = play(&schedule, ppm);
            assert!(!played.tally.is_misleading(), "{ppm} ppm, seed {seed}");
            let is_noticed = has_pulse || f64::abs(ppm) >= 300.0;
            if is_noticed {
                let set = if has_pulse {
                    played.set_late.0
                } else {
                    played.set_late.1
                };
                assert_eq!(set, 0, "{ppm} ppm, seed {seed}");
                assert!(played.refused_for_it > 0, "{ppm} ppm, seed {seed}");
            }
        }
    }
}

#[test]
fn one_within_its_promise_is_never_refused() {
    for ppm in [-97.0, 97.0] {
        for schedule in healthy(false).chain(healthy(true)) {
            let played = play(&schedule, ppm);
            assert!(!played.tally.is_misleading(), "seed {}", schedule.seed);
            assert_eq!(played.refused_for_it, 0, "seed {}", schedule.seed);
        }
    }
}
