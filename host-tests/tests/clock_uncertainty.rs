//! The uncertainty that the clock states, against its true error.
//!
//! *Design.* Boards in the simulated world, each with another crystal, read all the time
//! and pooled for each case. The estimator's own part of the uncertainty is compared with
//! the error against floor time, the latency taken for known; the sum with the uncertainty
//! of an unknown latency is compared with the error against UTC. 95 % of the errors have to
//! be within it; where it is to be narrow, its mean is at most four times theirs.
//!
//! *Limits.* 20 boards a case.

use std::fmt;
use std::ops::Range;

use board_model::{SECOND, Sample, Scenario, at_s};
use host_tests::checks::{Checks, each};
use utc_clock::Settings;
use world::{Latency, PulseFault, PulseFaultKind, PulseSettings, Ramp, Wander, WorldNanos};

const SEEDS: Range<u64> = 600..620;

const STEADY: &[Ramp] = &[Ramp::None];
const UP: &[Ramp] = &[Ramp::UP];
const TURNING: &[Ramp] = &[Ramp::TURNING];
const ALL: &[Ramp] = &[Ramp::None, Ramp::UP, Ramp::TURNING];

/// Boards whose samples are pooled, and what is demanded of them.
struct Case {
    name: &'static str,
    latency: Latency,
    /// What happens beside messages with that latency.
    scenario: fn(Latency, u64) -> Scenario,
    ramps: &'static [Ramp],
    /// Which samples count, by their time since the start. \[s\]
    window_s: Range<i64>,
    /// Errors are against UTC, or else against floor time.
    is_utc: bool,
    /// The mean uncertainty has a limit, too.
    is_narrow: bool,
}

impl fmt::Debug for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {:?}, {:?} s", self.name, self.ramps, self.window_s)
    }
}

impl Case {
    fn new(name: &'static str, latency: Latency) -> Self {
        Self {
            name,
            latency,
            scenario: Scenario::new,
            ramps: STEADY,
            window_s: 180..780,
            is_utc: false,
            is_narrow: false,
        }
    }

    /// An M8 in good order.
    fn m8(name: &'static str) -> Self {
        Self::new(name, Latency::m8())
    }

    fn samples(&self, ramp: Ramp, seed: u64) -> Vec<Sample> {
        let mut scenario = (self.scenario)(self.latency, seed);
        scenario.crystal.ramp = ramp;
        let mut run = scenario.start();
        run.until(self.window_s.end * SECOND);
        let from_ns = self.window_s.start * SECOND;
        if self.is_utc {
            run.utc_since(from_ns).collect()
        } else {
            run.since(from_ns).collect()
        }
    }

    fn judge(&self, checks: &mut Checks) {
        let boards = SEEDS.flat_map(|seed| self.ramps.iter().map(move |ramp| (*ramp, seed)));
        let samples: Vec<Sample> = boards
            .flat_map(|(ramp, seed)| self.samples(ramp, seed))
            .collect();
        checks.covered(samples.iter().copied());
        let sum = |of: fn(&Sample) -> f64| samples.iter().map(of).sum::<f64>();
        let error = sum(|sample| sample.error_ns.abs() as f64);
        let uncertainty = sum(|sample| sample.uncertainty_ns as f64);
        if self.is_narrow {
            checks.at_most("mean uncertainty over mean error", uncertainty / error, 4.0);
        }
    }
}

fn judge(cases: impl IntoIterator<Item = Case>) {
    each(cases, |checks, case| case.judge(checks));
}

#[test]
fn of_messages() {
    judge(
        [
            ("M8", Latency::m8(), true),
            ("harsh M8", Latency::harsh_m8(), true),
            // Soft edges: the uncertainty has to cover the error, however wide it is.
            ("gamma", Latency::gamma(), false),
            ("Rayleigh", Latency::rayleigh(), false),
        ]
        .map(|(name, latency, is_narrow)| Case {
            ramps: ALL,
            is_narrow,
            ..Case::new(name, latency)
        }),
    );
}

#[test]
fn of_an_f9s_messages() {
    judge([Case {
        ramps: ALL,
        is_narrow: true,
        ..Case::new("F9", Latency::f9())
    }]);
}

#[test]
fn of_the_first_minute() {
    let receivers = [
        ("M8", Latency::m8()),
        ("harsh M8", Latency::harsh_m8()),
        ("F9", Latency::f9()),
    ];
    judge(receivers.into_iter().flat_map(|(name, latency)| {
        [0..10, 0..60].map(|window_s| Case {
            window_s,
            ..Case::new(name, latency)
        })
    }));
}

#[test]
fn of_a_floor_that_wanders() {
    let sine = Wander::sine_8_ms(300 * SECOND.unsigned_abs(), 0);
    judge(
        [
            ("a walk", Latency::m8().with_wander(Wander::WALK_8_MS)),
            ("a sine of 5 min", Latency::m8().with_wander(sine)),
        ]
        .map(|(name, latency)| Case {
            window_s: 600..1_200,
            ..Case::new(name, latency)
        }),
    );
}

#[test]
fn of_an_unknown_latency() {
    let scenario = |latency, seed| Scenario {
        settings: Settings::DEFAULT,
        ..Scenario::new(latency, seed)
    };
    judge(
        [("M8", Latency::m8()), ("F9", Latency::f9())].map(|(name, latency)| Case {
            scenario,
            window_s: 0..300,
            is_utc: true,
            ..Case::new(name, latency)
        }),
    );
}

#[test]
fn of_a_pulse() {
    let plain = Case {
        scenario: |latency, seed| Scenario::new(latency, seed).with_pulse(),
        ramps: ALL,
        is_utc: true,
        is_narrow: true,
        ..Case::m8("a pulse")
    };
    let correlated = Case {
        scenario: |latency, seed| {
            let mut scenario = Scenario::new(latency, seed);
            scenario.receiver.pulse = PulseSettings::m8_correlated();
            scenario.with_pulse()
        },
        ramps: ALL,
        is_utc: true,
        is_narrow: true,
        ..Case::m8("a pulse, half of it slow")
    };
    judge([plain, correlated]);
}

/// Loses its messages after ten minutes.
fn without_messages(mut scenario: Scenario) -> Scenario {
    scenario.messages_lost.push(600 * SECOND..i64::MAX);
    scenario
}

/// Loses its pulse after ten minutes.
fn without_pulse(latency: Latency, seed: u64) -> Scenario {
    let mut scenario = Scenario::new(latency, seed);
    scenario.receiver.pulse.faults.push(PulseFault {
        from: at_s(600),
        until: WorldNanos(u64::MAX),
        kind: PulseFaultKind::Cut,
    });
    scenario.with_pulse()
}

/// For a minute and for ten, at a constant temperature and on ramps.
fn for_a_while(case: impl Fn() -> Case) -> Vec<Case> {
    let ramps = [STEADY, UP, TURNING].into_iter();
    ramps
        .flat_map(|ramps| [(ramps, 600..660), (ramps, 600..1_200)])
        .map(|(ramps, window_s)| Case {
            ramps,
            window_s,
            ..case()
        })
        .collect()
}

#[test]
fn of_a_holdover_after_messages() {
    judge(for_a_while(|| Case {
        scenario: |latency, seed| without_messages(Scenario::new(latency, seed)),
        ..Case::m8("no messages any more")
    }));
}

#[test]
fn of_a_holdover_after_a_pulse() {
    judge(for_a_while(|| Case {
        scenario: |latency, seed| without_messages(without_pulse(latency, seed)),
        is_utc: true,
        ..Case::m8("neither pulse nor messages any more")
    }));
}

#[test]
fn of_a_lost_pulse() {
    judge(for_a_while(|| Case {
        scenario: without_pulse,
        is_utc: true,
        ..Case::m8("no pulse any more")
    }));
}
