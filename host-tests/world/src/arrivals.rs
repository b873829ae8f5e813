//! The receiver's solutions: when each is ready, and what it claims to be.
//!
//! *Purpose.* One source of time marks for [`Receiver`](crate::Receiver), which
//! sends them as bytes, and for [`Arrivals`], which gives only their times: a day
//! of them in a fraction of a second.
//!
//! *Design.* Epochs stand on the grid of UTC that the rate gives, each moved to
//! the nearest 1 kHz tick of the receiver's own crystal, as its `nano` then shows.
//! A stall holds back what becomes ready in it; after the backlog its last epoch
//! comes once more, as a real Pixhawk's log shows it. A fault of its time moves the
//! reported epochs and nothing else.
//!
//! *Limits.* A faulty receiver's epochs keep to the grid of true UTC: what it reports
//! is off the grid by its error. A leap second is such an error, for ever.

use crate::faults::{Stall, TimeFault, drifted_ns, time_error_ns};
use crate::latency::LatencySource;
use crate::settings::ReceiverSettings;
use crate::talker::{WorldNanos, line_ns};
use crate::ubx;

/// The tick on which solutions are computed. \[ns\]
const SOLUTION_TICK_NS: i64 = 1_000_000;

/// A solution that is on its way to the line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    /// The epoch on the grid of UTC, since 1970. \[ns\]
    pub wanted_utc_ns: i64,
    /// The epoch that it claims to be computed for, since 1970. \[ns\]
    pub reported_utc_ns: i64,
    /// By how much that is ahead of the truth. \[ns\]
    pub error_ns: i64,
    /// When it may begin to leave.
    pub ready: WorldNanos,
    /// When the stall that holds it back is over.
    held_until: Option<WorldNanos>,
}

/// Where solutions come from.
#[derive(Clone, Debug)]
pub(crate) struct Solver {
    utc_at_start_ns: i64,
    crystal_ppb: i32,
    latency: LatencySource,
    stalls: Vec<Stall>,
    time_faults: Vec<TimeFault>,
    last: Option<Solution>,
    /// A solution that waits for the repetition of the one before it.
    next: Option<Solution>,
}

impl Solver {
    pub(crate) fn new(settings: &ReceiverSettings) -> Self {
        Self {
            utc_at_start_ns: settings.utc_at_start_ns,
            crystal_ppb: settings.crystal_ppb,
            latency: LatencySource::new(settings.latency, settings.seed),
            stalls: settings.stalls.clone(),
            time_faults: settings.all_time_faults(),
            last: None,
            next: None,
        }
    }

    /// The floor of the latency at `at`. \[ns\]
    pub(crate) fn floor_ns(&mut self, at: WorldNanos) -> u64 {
        self.latency.floor_ns(at)
    }

    /// What follows the solution whose epoch on the grid was `utc_ns`, with
    /// `period_ns` from epoch to epoch.
    pub(crate) fn solve_after(&mut self, utc_ns: i64, period_ns: i64) -> Solution {
        let drawn = match self.next.take() {
            Some(next) => next,
            None => self.draw(utc_ns, period_ns),
        };
        let solution = match self.last {
            Some(last) if last.held_until.is_some() && last.held_until != drawn.held_until => {
                self.next = Some(drawn);
                Solution {
                    held_until: None,
                    ..last
                }
            }
            _ => drawn,
        };
        self.last = Some(solution);
        solution
    }

    /// The first solution whose epoch on the grid is after `utc_ns`.
    fn draw(&mut self, utc_ns: i64, period_ns: i64) -> Solution {
        let wanted_utc_ns = (utc_ns.div_euclid(period_ns) + 1) * period_ns;
        // The crystal's ticks drift through UTC; the one nearest to the wanted
        // epoch lies up to half a tick to either side of it.
        let since_start_ns = wanted_utc_ns - self.utc_at_start_ns;
        let off_ns = drifted_ns(since_start_ns, self.crystal_ppb) + SOLUTION_TICK_NS / 2;
        let off_ns = off_ns.rem_euclid(SOLUTION_TICK_NS) - SOLUTION_TICK_NS / 2;
        let epoch = WorldNanos(u64::try_from(since_start_ns + off_ns).unwrap_or(0));
        let mut ready = epoch.plus(self.latency.draw_ns(epoch));
        let stall = self.stalls.iter().find(|stall| stall.holds(ready));
        let held_until = stall.map(Stall::end);
        if let Some(end) = held_until {
            ready = end;
        }
        let error_ns = time_error_ns(&self.time_faults, epoch);
        Solution {
            wanted_utc_ns,
            reported_utc_ns: wanted_utc_ns + off_ns + error_ns,
            error_ns,
            ready,
            held_until,
        }
    }
}

/// A time mark without its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// The epoch in its fields, UTC since 1970. \[ns\]
    pub epoch_utc_ns: i64,
    /// By how much that epoch is ahead of the true one, in ns: 0 unless the
    /// receiver has a [`TimeFault`].
    pub error_ns: i64,
    /// When the start bit of its first byte begins.
    pub first_byte: WorldNanos,
    /// When that byte's stop bit ends: the moment at which a UART has received it.
    pub first_byte_end: WorldNanos,
}

/// The time marks of a receiver that sends nothing but NAV-PVT, at every epoch and
/// at the rate and speed of its port, from the world's start on and for ever.
///
/// A [`Receiver`](crate::Receiver) of the same settings that needs no configuration
/// sends the same at the same moments; only in the backlog of a stall can TIM-TP
/// come between.
#[derive(Clone, Debug)]
pub struct Arrivals {
    solver: Solver,
    period_ns: i64,
    baud: u32,
    solved_utc_ns: i64,
    line_free: WorldNanos,
}

impl Arrivals {
    /// The arrivals from a receiver like this.
    #[must_use]
    pub fn new(settings: &ReceiverSettings) -> Self {
        Self {
            solver: Solver::new(settings),
            period_ns: settings.port.period_ns(),
            baud: settings.port.baud,
            solved_utc_ns: settings.utc_at_start_ns,
            line_free: WorldNanos(0),
        }
    }

    /// The floor of the latency at `at`, in ns: the least from an epoch then to the
    /// first start bit.
    pub fn floor_ns(&mut self, at: WorldNanos) -> u64 {
        self.solver.floor_ns(at)
    }
}

impl Iterator for Arrivals {
    type Item = Arrival;

    fn next(&mut self) -> Option<Arrival> {
        let solution = self.solver.solve_after(self.solved_utc_ns, self.period_ns);
        self.solved_utc_ns = solution.wanted_utc_ns;
        let first_byte = solution.ready.max(self.line_free);
        self.line_free = first_byte.plus(line_ns(ubx::NAV_PVT_FRAME_LEN, self.baud));
        Some(Arrival {
            epoch_utc_ns: solution.reported_utc_ns,
            error_ns: solution.error_ns,
            first_byte,
            first_byte_end: first_byte.plus(line_ns(1, self.baud)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Latency, Port, Receiver, Talker, Wander};

    const NOON_NS: i64 = 1_795_348_800_000_000_000;
    const SECOND: u64 = 1_000_000_000;
    const MS: u64 = 1_000_000;
    /// A NAV-PVT at 115200.
    const FRAME_NS: u64 = 8_680_555;

    fn settings(latency: Latency) -> ReceiverSettings {
        ReceiverSettings {
            latency,
            port: Port::CONFIGURED,
            ..ReceiverSettings::new(NOON_NS)
        }
    }

    fn at(seconds: u64) -> WorldNanos {
        WorldNanos(seconds * SECOND)
    }

    /// The true latency of an arrival. \[ns\]
    fn latency_ns(arrival: &Arrival) -> i64 {
        NOON_NS + arrival.first_byte.0 as i64 - (arrival.epoch_utc_ns - arrival.error_ns)
    }

    #[test]
    fn a_receiver_sends_the_same_at_the_same_moments() {
        let healthy = ReceiverSettings {
            seed: 7,
            time_faults: vec![TimeFault::jump(at(200), 1_000_000_000)],
            ..settings(Latency::m8().with_wander(Wander::WALK_8_MS))
        };
        let stalling = ReceiverSettings {
            stalls: vec![Stall {
                from: at(100),
                lasts_ns: 1_560 * MS,
            }],
            ..healthy.clone()
        };
        // TIM-TP leaves behind a NAV-PVT and delays none but in a backlog.
        let mut forecasting = healthy;
        forecasting.port.tim_tp_every = 1;
        for settings in [stalling, forecasting] {
            let mut receiver = Receiver::new(settings.clone());
            while receiver.next_event().is_some_and(|event| event < at(300)) {
                let now = receiver.next_event().unwrap();
                receiver.poll(now);
            }
            assert!(receiver.truth().len() > 1_490);
            for (sent, arrival) in receiver.truth().iter().zip(Arrivals::new(&settings)) {
                assert_eq!(
                    (sent.epoch_utc_ns, sent.first_byte),
                    (arrival.epoch_utc_ns, arrival.first_byte)
                );
                // Ten bits at 115200.
                assert_eq!(arrival.first_byte_end.0 - arrival.first_byte.0, 86_805);
            }
        }
    }

    #[test]
    fn a_stall_ends_in_a_backlog_and_a_repetition() {
        let mut settings = settings(Latency::constant(50 * MS));
        settings.crystal_ppb = 0;
        settings.stalls = vec![Stall {
            from: at(10),
            lasts_ns: 1_560 * MS,
        }];
        let all: Vec<Arrival> = Arrivals::new(&settings).take(100).collect();
        let late: Vec<&Arrival> = all.iter().filter(|a| latency_ns(a) > 50_000_000).collect();
        // The epochs from 10.0 to 11.4 s are ready in it, and the last comes again.
        let epochs: Vec<i64> = late
            .iter()
            .map(|a| (a.epoch_utc_ns - NOON_NS) / 1_000_000)
            .collect();
        assert_eq!(
            epochs,
            [
                10_000, 10_200, 10_400, 10_600, 10_800, 11_000, 11_200, 11_400, 11_400
            ]
        );
        for (place, arrival) in late.iter().enumerate() {
            let back_to_back = 11_560 * MS + place as u64 * FRAME_NS;
            assert_eq!(arrival.first_byte.0, back_to_back);
        }
        // Before and after it is as ever.
        assert_eq!(all[48].first_byte, WorldNanos(9_850 * MS));
        assert_eq!(all[58].first_byte, WorldNanos(11_650 * MS));
        assert!(all.is_sorted_by(|one, next| next.first_byte.0 - one.first_byte.0 >= FRAME_NS));
    }

    #[test]
    fn time_jumps_and_drifts_as_set() {
        let mut settings = settings(Latency::m8());
        settings.time_faults = vec![
            TimeFault::jump(at(100), -18_000_000_000).until(at(200)),
            TimeFault::drift(at(300), 2_000).until(at(400)),
        ];
        let honest = Arrivals::new(&ReceiverSettings {
            time_faults: Vec::new(),
            ..settings.clone()
        });
        for (is, was) in Arrivals::new(&settings).zip(honest).take(2_500) {
            // Only the reported epoch has changed, by the stated error.
            assert_eq!(is.first_byte, was.first_byte);
            assert_eq!(is.epoch_utc_ns, was.epoch_utc_ns + is.error_ns);
            assert_eq!(was.error_ns, 0);
            let epoch_ns = (was.epoch_utc_ns - NOON_NS) as u64;
            let expected = match epoch_ns / SECOND {
                100..200 => -18_000_000_000,
                // 2 µs a second.
                300..400 => (epoch_ns - 300 * SECOND) as i64 * 2 / 1_000_000,
                _ => 0,
            };
            assert_eq!(is.error_ns, expected);
        }
    }

    #[test]
    fn nothing_arrives_before_the_floor_and_some_at_it() {
        let settings = settings(Latency::f9().with_wander(Wander::sine_8_ms(60 * SECOND, 0)));
        let mut floors = Arrivals::new(&settings);
        let mut nearest = i64::MAX;
        for arrival in Arrivals::new(&settings).take(50_000) {
            let epoch = WorldNanos((arrival.epoch_utc_ns - NOON_NS) as u64);
            let above = latency_ns(&arrival) - floors.floor_ns(epoch) as i64;
            assert!(above >= 0);
            nearest = nearest.min(above);
        }
        assert!(nearest < 1_000, "{nearest}");
    }

    #[test]
    fn the_same_seed_brings_the_same() {
        let bring = |seed| {
            let settings = ReceiverSettings {
                seed,
                ..settings(Latency::gamma().with_memory(20 * SECOND))
            };
            Arrivals::new(&settings).take(100).collect::<Vec<_>>()
        };
        assert_eq!(bring(1), bring(1));
        assert_ne!(bring(1), bring(2));
    }
}
