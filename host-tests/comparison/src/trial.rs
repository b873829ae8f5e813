//! A trial: one world, two boards, all candidates on the same arrivals.
//!
//! *Purpose.* How far apart the published times of two equal boards are at the same
//! true moments.
//!
//! *Design.* Each board is run alone and read at moments that both have in common:
//! one in each 100 ms, anywhere in it, so that they stand in no relation to marks or
//! pulses. Then the two histories are compared.
//!
//! *Limits.* Both boards start at the same moment. The baselines use no pulse.

use board_model::{
    BYTE_NS, EventKind, Invariants, MS, OnViolation, SECOND, START, Scenario, nominal_ns,
};
use fastrand::Rng;
use utc_clock::{ClockState, Ppb, Settings};
use world::{
    Arrivals, CrystalSettings, Port, PulseFault, PulseFaultKind, PulseSettings, ReceiverSettings,
    WorldNanos,
};

use crate::baselines;
use crate::case::{Case, Lost, Pulse, SETTLED_S, Temperature};

/// How much worse than its crystal the clock's frequency may be: correlated jitter and wandering
/// floors teach a wrong one at first. 209 ppm were seen, on crystals within ±50 ppm. \[ppb\]
const MARGIN_PPB: f64 = 220_000.0;
/// From reading to reading, on average. \[ns\]
const READ_EVERY_NS: i64 = 100 * MS;
/// Rates are taken over a minute. \[readings\]
const RATE_OVER: usize = 600;
/// How far crystals are off, at most. \[ppb\]
const CRYSTAL_PPB: f64 = 50_000.0;
/// How far the TCXO of a receiver is off, at most. \[ppb\]
const RECEIVER_PPB: i32 = 1_000;
/// How far a stored frequency is off, at most: a crystal's ageing in a year, or
/// 10 °C where its curve is flat. \[ppb\]
const STORED_UNCERTAINTY_PPB: i32 = 500;

/// A candidate in a trial: the difference between its two boards.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Each one in the window. \[ns\]
    pub differences: Vec<u32>,
    /// When it had converged, after the start. \[ns\]
    pub converged_at: u64,
}

/// What our clock is measured by beside its track.
#[derive(Clone, Debug, Default)]
pub struct Own {
    /// Each board's error in the window, against floor time or under the pulse
    /// against UTC. \[ns\]
    pub errors: Vec<u32>,
    /// The sum of the uncertainties published with them. \[ns\]
    pub uncertainty_sum: u64,
    /// How many of the errors are within those.
    pub covered: u64,
    /// How many of the errors against UTC are within those and the uncertainty of an
    /// unknown latency together.
    pub covered_utc: u64,
    /// How far the rate of each minute in the window was off. \[10⁻¹²\]
    pub rates: Vec<u32>,
    /// By how much the difference changed from a loss to the window. \[ns\]
    pub grown: Option<u32>,
    /// Readings that violate an invariant.
    pub violations: u32,
    /// What the first of them did.
    pub first_violation: Option<String>,
}

/// A trial's result.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The source of its chance.
    pub seed: u64,
    /// The temperature.
    pub temperature: Temperature,
    /// Ours first, then the baselines in their order, where there is no pulse.
    pub tracks: Vec<Track>,
    /// Ours in depth.
    pub own: Own,
    /// How far apart the floors of the two receivers were in the window. \[ns\]
    pub floors: Vec<u32>,
    /// Sums over all moments at which ours was set on both boards: of its
    /// difference and of the floors'. \[ns\]
    pub ever: (u64, u64),
}

/// Runs one.
#[must_use]
pub fn run(case: &Case, temperature: Temperature, seed: u64) -> Trial {
    let mut rng = Rng::with_seed(seed);
    let utc_at_start_ns = START.0 + rng.i64(0..SECOND);
    let moments: Vec<i64> = (0..case.end_s().cast_signed() * SECOND / READ_EVERY_NS)
        .map(|number| number * READ_EVERY_NS + rng.i64(0..READ_EVERY_NS))
        .collect();
    let histories = [0, 1].map(|_| {
        let chance = Chance {
            seed: rng.u64(..),
            crystal_ppb: (rng.f64() * 2.0 - 1.0) * CRYSTAL_PPB,
            warms: rng.bool(),
            phase: rng.u32(0..1_000_000),
            stored_off_ppb: rng.i32(-STORED_UNCERTAINTY_PPB..=STORED_UNCERTAINTY_PPB),
            receiver_ppb: rng.i32(-RECEIVER_PPB..=RECEIVER_PPB),
        };
        let scenario = chance.scenario(case, temperature, utc_at_start_ns);
        History::of(&scenario, &moments)
    });
    let trial = Trial {
        seed,
        temperature,
        tracks: Vec::new(),
        own: Own::default(),
        floors: Vec::new(),
        ever: (0, 0),
    };
    compare(case, &moments, histories, trial)
}

/// What chance gave to a board.
struct Chance {
    seed: u64,
    crystal_ppb: f64,
    /// Which way the temperature drives its crystal.
    warms: bool,
    /// Where its floor's wander begins.
    phase: u32,
    stored_off_ppb: i32,
    /// The error of the receiver's own crystal.
    receiver_ppb: i32,
}

impl Chance {
    fn scenario(&self, case: &Case, temperature: Temperature, utc_at_start_ns: i64) -> Scenario {
        let receiver = self.receiver(case, utc_at_start_ns);
        Scenario {
            settings: self.settings(case),
            crystal: CrystalSettings {
                ramp: temperature.ramp(self.warms),
                ..CrystalSettings::new(self.crystal_ppb)
            },
            pulse: case.pulse.map(|_| receiver.clone()),
            receiver,
            messages_lost: (case.lost.into_iter())
                .filter(|(lost, _)| *lost == Lost::Messages)
                .map(|(_, from_s)| from_s.cast_signed() * SECOND..i64::MAX)
                .collect(),
        }
    }

    fn receiver(&self, case: &Case, utc_at_start_ns: i64) -> ReceiverSettings {
        let wander = case.floor.wander(self.phase);
        let mut receiver = ReceiverSettings {
            seed: self.seed,
            latency: (case.latency)().with_wander(wander),
            port: Port::CONFIGURED,
            crystal_ppb: self.receiver_ppb,
            pulse: match case.pulse {
                Some(Pulse::HalfCorrelated) => PulseSettings::m8_correlated(),
                _ => PulseSettings::m8(),
            },
            ..ReceiverSettings::new(utc_at_start_ns)
        };
        receiver.port.tim_tp_every = u8::from(case.pulse == Some(Pulse::Forecast));
        if let Some((Lost::Pulse, from_s)) = case.lost {
            receiver.pulse.faults.push(PulseFault {
                from: board_model::at_s(from_s),
                until: WorldNanos(u64::MAX),
                kind: PulseFaultKind::Cut,
            });
        }
        receiver
    }

    fn settings(&self, case: &Case) -> Settings {
        // Under the pulse nothing depends on the receiver's latency. Without it, the
        // clock's own part of the uncertainty is what is measured.
        let latency_uncertainty_ns = match case.pulse {
            Some(_) => Settings::DEFAULT.latency_uncertainty_ns,
            None => 0,
        };
        let unknown = Settings {
            latency_uncertainty_ns,
            // Its own part as well: the receivers' pulses are UTC here.
            pulse_uncertainty_ns: 0,
            // What the filters claim themselves is what is measured.
            hidden_turn_ns: 0,
            ..Settings::DEFAULT
        };
        if case.stored {
            Settings {
                frequency: Ppb(self.stored_off_ppb - self.crystal_ppb.round() as i32),
                frequency_uncertainty: Ppb(STORED_UNCERTAINTY_PPB),
                ..unknown
            }
        } else {
            unknown
        }
    }
}

/// What a board's candidates published less UTC, at each moment.
struct History {
    /// Our clock's error and uncertainty, while it is set. \[ns\]
    ours: Vec<Option<(i64, u64)>>,
    /// Each baseline's error, while it is set. \[ns\]
    baselines: Vec<Vec<Option<i64>>>,
    /// The floor of the receiver's latency. \[ns\]
    floors: Vec<u64>,
    /// The least floor, to the end of the first byte. \[ns\]
    least: i64,
    violations: u32,
    first_violation: Option<String>,
}

impl History {
    fn of(scenario: &Scenario, moments: &[i64]) -> Self {
        let mut run = scenario.start();
        run.board.read_every_ns = None;
        run.board.invariants = Invariants::new(OnViolation::Count);
        run.board.invariants.margin_ppb = MARGIN_PPB;
        let mut floors = Arrivals::new(&scenario.receiver);
        let mut baselines = match scenario.pulse {
            None => baselines::all(),
            Some(_) => Vec::new(),
        };
        let mut history = Self {
            ours: Vec::with_capacity(moments.len()),
            baselines: vec![Vec::with_capacity(moments.len()); baselines.len()],
            floors: Vec::with_capacity(moments.len()),
            least: scenario.receiver.latency.least_ns.cast_signed() + BYTE_NS,
            violations: 0,
            first_violation: None,
        };
        for &moment in moments {
            while let Some(event) = run.next_until(moment) {
                if let EventKind::Mark { epoch } = event.kind {
                    let arrival_ns = nominal_ns(run.board.cycles(event.stamped_ns));
                    for baseline in &mut baselines {
                        baseline.handle_mark(arrival_ns, epoch.0);
                    }
                }
            }
            run.until(moment);
            let (reading, truth) = (run.board.read(), run.board.truth());
            let is_set = reading.state != ClockState::Unset;
            let error_ns = reading.utc.since(truth);
            let ours = is_set.then_some((error_ns, reading.uncertainty_ns));
            history.ours.push(ours);
            let now_ns = nominal_ns(run.board.cycles(moment));
            for (baseline, errors) in baselines.iter().zip(&mut history.baselines) {
                errors.push(baseline.utc_ns(now_ns).map(|utc| utc - truth.0));
            }
            let floor_ns = floors.floor_ns(WorldNanos(moment.unsigned_abs()));
            history.floors.push(floor_ns);
        }
        let (violations, first) = run.board.invariants.violations();
        history.violations = violations;
        history.first_violation = first.map(str::to_owned);
        history
    }
}

/// Compares the histories of two boards.
fn compare(case: &Case, moments: &[i64], [one, other]: [History; 2], mut trial: Trial) -> Trial {
    let window_s = case.window_s.start.cast_signed()..case.window_s.end.cast_signed();
    let window = window_s.start * SECOND..window_s.end * SECOND;
    let in_window: Vec<usize> = (0..moments.len())
        .filter(|&index| window.contains(&moments[index]))
        .take(if case.one_moment { 1 } else { usize::MAX })
        .collect();
    let at = |history: &History, index: usize| history.ours[index].map(|(error, _)| error);
    let ours: Vec<_> = (0..moments.len())
        .map(|index| difference(at(&one, index), at(&other, index)))
        .collect();
    let baselines = one
        .baselines
        .iter()
        .zip(&other.baselines)
        .map(|(one, other)| {
            let pairs = one.iter().zip(other);
            pairs.map(|(one, other)| difference(*one, *other)).collect()
        });
    let all: Vec<Vec<_>> = std::iter::once(ours).chain(baselines).collect();
    let tracks = all.iter().map(|differences| Track {
        differences: in_window.iter().filter_map(|&i| differences[i]).collect(),
        converged_at: converged_at(case, moments, differences),
    });
    let floors: Vec<u32> = one
        .floors
        .iter()
        .zip(&other.floors)
        .map(|(one, other)| one.abs_diff(*other) as u32)
        .collect();

    trial.tracks = tracks.collect();
    trial.floors = in_window.iter().map(|&index| floors[index]).collect();
    for (difference, floor) in all[0].iter().zip(&floors) {
        if let Some(difference) = difference {
            trial.ever.0 += u64::from(*difference);
            trial.ever.1 += u64::from(*floor);
        }
    }
    if let Some((_, lost_s)) = case.lost
        && let Some(&then) = in_window.first()
    {
        let last = moments.partition_point(|&moment| moment < lost_s.cast_signed() * SECOND) - 1;
        let apart = |index| Some(at(&one, index)? - at(&other, index)?);
        trial.own.grown = difference(apart(last), apart(then));
    }
    for history in [one, other] {
        trial.own.add(case, &in_window, history);
    }
    trial
}

impl Own {
    fn add(&mut self, case: &Case, window: &[usize], history: History) {
        let floor = if case.pulse.is_some() {
            0
        } else {
            history.least
        };
        let latency_uncertainty = u64::from(Settings::DEFAULT.latency_uncertainty_ns);
        for &index in window {
            let Some((error, uncertainty)) = history.ours[index] else {
                continue;
            };
            let against_floor = (error + floor).unsigned_abs();
            self.errors.push(capped(against_floor));
            self.uncertainty_sum += uncertainty;
            self.covered += u64::from(against_floor <= uncertainty);
            self.covered_utc +=
                u64::from(error.unsigned_abs() <= uncertainty + latency_uncertainty);
        }
        for &index in window.iter().step_by(10) {
            let later = index + RATE_OVER;
            if window.contains(&later)
                && let (Some((before, _)), Some((after, _))) =
                    (history.ours[index], history.ours[later])
            {
                // Moments stand anywhere in their 100 ms: good to 0.2 % of a minute.
                let minute = RATE_OVER as f64 * READ_EVERY_NS as f64;
                let rate = (after - before) as f64 / minute * 1e12;
                self.rates.push(rate.abs().round() as u32);
            }
        }
        self.violations += history.violations;
        self.first_violation = self.first_violation.take().or(history.first_violation);
    }
}

/// How far two are apart, where there are two.
fn difference(one: Option<i64>, other: Option<i64>) -> Option<u32> {
    Some(capped(one?.abs_diff(other?)))
}

/// 4.3 s stand for more.
fn capped(ns: u64) -> u32 {
    u32::try_from(ns).unwrap_or(u32::MAX)
}

/// The first moment from which on the difference is within the case's limit until
/// convergence is over.
fn converged_at(case: &Case, moments: &[i64], differences: &[Option<u32>]) -> u64 {
    let until = moments.partition_point(|&moment| moment < SETTLED_S.cast_signed() * SECOND);
    let outside = differences[..until]
        .iter()
        .rposition(|difference| difference.is_none_or(|ns| ns > case.converged_ns));
    outside.map_or(0, |last| moments[last].unsigned_abs())
}
