//! A trial: one world, two boards, everybody's clock on the same arrivals.
//!
//! *Purpose.* What two equal boards published at the same true moments, and how far
//! it was apart.
//!
//! *Design.* Each board lives alone through its events (a mark when its frame has
//! come in, a pulse when its task has got round to it) and is asked at moments that
//! both have in common: one in each 100 ms, anywhere in it, so that they stand in no
//! relation to marks or pulses. Then the two lives are laid side by side.
//!
//! *Limits.* Both boards start at the same moment. The others hear no pulse.

use fastrand::Rng;
use timebase::{Cycles, PulseForecast, PulseMark};
use utc_clock::{ClockState, Ppb, Published, Settings};
use world::others::{self, Other};
use world::{
    Arrivals, Crystal, CrystalSettings, Port, PulseSettings, ReceiverSettings, WorldNanos,
};

use crate::board::{Board, nominal_ns};
use crate::case::{Case, Pulse, SECOND, SETTLED_S, Temperature};
use crate::events::{What, events};

/// 2026-11-22T01:02:03Z; each world starts within the second that follows.
const START_UTC_NS: i64 = 1_795_309_323_000_000_000;
/// The clocks are asked once in so many ns.
const ASKED_EVERY_NS: u64 = 100_000_000;
/// Rates are taken over so many askings: a minute.
const RATE_OVER: usize = 600;
/// One byte at 115200 baud, in ns: a mark is stamped at its end.
const FIRST_BYTE_NS: i64 = 86_806;
/// Crystals lie within so many ppb.
const CRYSTAL_PPB: f64 = 50_000.0;
/// Receivers have a TCXO that is within so many ppb.
const RECEIVER_PPB: i32 = 1_000;
/// A stored frequency is off by at most so many ppb: a crystal's ageing in a year,
/// or 10 °C where its curve is flat.
const STORED_UNCERTAINTY_PPB: i32 = 500;

/// A contestant in a trial: the difference between its two boards, in ns.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Each one in the window.
    pub differences: Vec<u32>,
    /// When it had converged, in ns after the start.
    pub converged_at: u64,
}

/// What our clock is measured by beside its track.
#[derive(Clone, Debug, Default)]
pub struct Own {
    /// Each board's error in the window, against floor time or under the pulse
    /// against UTC, in ns.
    pub errors: Vec<u32>,
    /// The sum of the uncertainties published with them, in ns.
    pub uncertainty_sum: u64,
    /// How many of the errors those held.
    pub covered: u64,
    /// How many of the errors against UTC they held, with the uncertainty about an
    /// unknown latency added.
    pub covered_utc: u64,
    /// How far each minute's rate in the window was off, in 10⁻¹².
    pub rates: Vec<u32>,
    /// What the difference did from the moment of a loss to the window, in ns.
    pub grown: Option<u32>,
    /// Readings that broke the referee's rules, and what the first did.
    pub fouls: u32,
    /// See [`Own::fouls`].
    pub first_foul: Option<String>,
}

/// A trial's result.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Where its chance came from.
    pub seed: u64,
    /// What the temperature did.
    pub temperature: Temperature,
    /// Ours first, then [`others::ALL`] in its order, where there is no pulse.
    pub tracks: Vec<Track>,
    /// Ours in depth.
    pub own: Own,
    /// How far apart the floors of the two receivers were in the window, in ns.
    pub floors: Vec<u32>,
    /// Sums over all moments at which ours was set on both boards: of its
    /// difference and of the floors', in ns.
    pub ever: (u64, u64),
}

/// Runs one.
#[must_use]
pub fn run(case: &Case, temperature: Temperature, seed: u64) -> Trial {
    let mut rng = Rng::with_seed(seed);
    let utc_at_start_ns = START_UTC_NS + rng.i64(0..SECOND.cast_signed());
    let moments: Vec<u64> = (0..case.end_s() * SECOND / ASKED_EVERY_NS)
        .map(|number| number * ASKED_EVERY_NS + rng.u64(0..ASKED_EVERY_NS))
        .collect();
    let lives = [0, 1].map(|_| {
        let world = BoardWorld {
            utc_at_start_ns,
            seed: rng.u64(..),
            crystal_ppb: (rng.f64() * 2.0 - 1.0) * CRYSTAL_PPB,
            warms: rng.bool(),
            phase: rng.u32(0..1_000_000),
            stored_off_ppb: rng.i32(-STORED_UNCERTAINTY_PPB..=STORED_UNCERTAINTY_PPB),
            receiver_ppb: rng.i32(-RECEIVER_PPB..=RECEIVER_PPB),
        };
        world.live(case, temperature, &moments)
    });
    let trial = Trial {
        seed,
        temperature,
        tracks: Vec::new(),
        own: Own::default(),
        floors: Vec::new(),
        ever: (0, 0),
    };
    side_by_side(case, &moments, lives, trial)
}

/// What chance gave to a board.
struct BoardWorld {
    utc_at_start_ns: i64,
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

/// What a board's clocks published less UTC, in ns, at each moment.
struct Life {
    /// With the uncertainty.
    ours: Vec<Option<(i64, u32)>>,
    others: Vec<Vec<Option<i64>>>,
    /// The floor of the receiver's latency.
    floors: Vec<u64>,
    /// The least of it ever, to the end of the first byte.
    least: i64,
    fouls: u32,
    first_foul: Option<String>,
}

impl BoardWorld {
    fn receiver(&self, case: &Case) -> ReceiverSettings {
        let wander = case.floor.wander(self.phase);
        ReceiverSettings {
            seed: self.seed,
            latency: (case.latency)().with_wander(wander),
            port: Port::CONFIGURED,
            crystal_ppb: self.receiver_ppb,
            pulse: match case.pulse {
                Some(Pulse::HalfCorrelated) => PulseSettings::m8_correlated(),
                _ => PulseSettings::m8(),
            },
            ..ReceiverSettings::new(self.utc_at_start_ns)
        }
    }

    fn crystal(&self, temperature: Temperature) -> Crystal {
        let settings = CrystalSettings {
            ramp: temperature.ramp(self.warms),
            ..CrystalSettings::new(self.crystal_ppb)
        };
        Crystal::new(settings, self.seed)
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

    fn live(&self, case: &Case, temperature: Temperature, moments: &[u64]) -> Life {
        let receiver = self.receiver(case);
        let mut crystal = self.crystal(temperature);
        let mut floors = Arrivals::new(&receiver);
        let mut events = events(case, &receiver).peekable();
        let line = Published::new();
        let mut board = Board::new(self.settings(case), &line);
        let mut rivals: Vec<Box<dyn Other + Send>> = if case.pulse.is_none() {
            others::ALL.iter().map(|(_, make)| make()).collect()
        } else {
            Vec::new()
        };
        let mut life = Life {
            ours: Vec::with_capacity(moments.len()),
            others: vec![Vec::with_capacity(moments.len()); rivals.len()],
            floors: Vec::new(),
            least: 0,
            fouls: 0,
            first_foul: None,
        };
        for &moment in moments {
            while let Some(event) = events.next_if(|event| event.handled <= moment) {
                let mut cycles = |ns| Cycles(crystal.cycles_at(WorldNanos(ns)));
                let (happened, now) = (cycles(event.happened), cycles(event.handled));
                match event.what {
                    What::Mark { epoch_utc_ns } => {
                        board.handle_arrival(happened, epoch_utc_ns, now);
                        for rival in &mut rivals {
                            rival.handle_mark(nominal_ns(happened), epoch_utc_ns);
                        }
                    }
                    What::Pulse => board.pulse(&PulseMark { edge: happened }, now),
                    What::Forecast { late_ps } => {
                        let arrival = happened;
                        board.forecast(&PulseForecast { arrival, late_ps }, now);
                    }
                }
            }
            let now = Cycles(crystal.cycles_at(WorldNanos(moment)));
            let truth = self.utc_at_start_ns + moment.cast_signed();
            let reading = board.read(now, truth);
            life.ours.push(
                (reading.state != ClockState::Unset)
                    .then(|| (reading.utc.0 - truth, reading.uncertainty_ns)),
            );
            for (rival, told) in rivals.iter().zip(&mut life.others) {
                told.push(rival.utc_ns(nominal_ns(now)).map(|utc| utc - truth));
            }
            life.floors.push(floors.floor_ns(WorldNanos(moment)));
        }
        life.least = receiver.latency.least_ns.cast_signed() + FIRST_BYTE_NS;
        (life.fouls, life.first_foul) = board.fouls();
        life
    }
}

/// Lays two lives side by side.
fn side_by_side(case: &Case, moments: &[u64], [one, other]: [Life; 2], mut trial: Trial) -> Trial {
    let window = case.window_s.start * SECOND..case.window_s.end * SECOND;
    let in_window: Vec<usize> = (0..moments.len())
        .filter(|&index| window.contains(&moments[index]))
        .take(if case.one_moment { 1 } else { usize::MAX })
        .collect();
    let at = |life: &Life, index: usize| life.ours[index].map(|(error, _)| error);
    let ours: Vec<_> = (0..moments.len())
        .map(|index| difference(at(&one, index), at(&other, index)))
        .collect();
    let rivals = one.others.iter().zip(&other.others).map(|(one, other)| {
        let pairs = one.iter().zip(other);
        pairs.map(|(one, other)| difference(*one, *other)).collect()
    });
    let all: Vec<Vec<_>> = std::iter::once(ours).chain(rivals).collect();
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
        let last = moments.partition_point(|&moment| moment < lost_s * SECOND) - 1;
        let apart = |index| Some(at(&one, index)? - at(&other, index)?);
        trial.own.grown = difference(apart(last), apart(then));
    }
    for life in [one, other] {
        trial.own.add(case, &in_window, life);
    }
    trial
}

impl Own {
    fn add(&mut self, case: &Case, window: &[usize], life: Life) {
        let floor = if case.pulse.is_some() { 0 } else { life.least };
        let latency_uncertainty = u64::from(Settings::DEFAULT.latency_uncertainty_ns);
        for &index in window {
            let Some((error, uncertainty)) = life.ours[index] else {
                continue;
            };
            let against_floor = (error + floor).unsigned_abs();
            self.errors.push(capped(against_floor));
            let uncertainty = u64::from(uncertainty);
            self.uncertainty_sum += uncertainty;
            self.covered += u64::from(against_floor <= uncertainty);
            self.covered_utc +=
                u64::from(error.unsigned_abs() <= uncertainty + latency_uncertainty);
        }
        for &index in window.iter().step_by(10) {
            let later = index + RATE_OVER;
            if window.contains(&later)
                && let (Some((before, _)), Some((after, _))) = (life.ours[index], life.ours[later])
            {
                // Moments stand anywhere in their 100 ms: good to 0.2 % of a minute.
                let minute = RATE_OVER as f64 * ASKED_EVERY_NS as f64;
                let rate = (after - before) as f64 / minute * 1e12;
                self.rates.push(rate.abs().round() as u32);
            }
        }
        self.fouls += life.fouls;
        self.first_foul = self.first_foul.take().or(life.first_foul);
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
fn converged_at(case: &Case, moments: &[u64], differences: &[Option<u32>]) -> u64 {
    let until = moments.partition_point(|&moment| moment < SETTLED_S * SECOND);
    let outside = differences[..until]
        .iter()
        .rposition(|difference| difference.is_none_or(|ns| ns > case.converged_ns));
    outside.map_or(0, |last| moments[last])
}
