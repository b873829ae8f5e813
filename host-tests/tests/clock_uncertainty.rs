//! What the clock says of its own error, against the truth.
//!
//! *Design.* Boards in the simulated world, each with another crystal, read at every
//! moment; pooled for each case. The estimator's own part is held against floor time,
//! with no uncertainty about the latency; the sum with the uncertainty of a latency that nobody
//! knows against UTC. It holds where 95 % of the errors are within it, and it is of
//! use where its mean is not more than four times theirs.
//!
//! *Limits.* 20 boards a case.

use host_tests::clock_board::{SECOND, Sample};
use host_tests::clock_scene::{Faults, Scene, at_s, covered};
use utc_clock::{Published, Settings};
use world::{Latency, PulseFault, PulseFaultKind, PulseSettings, Ramp, Wander, WorldNanos};

const SEEDS: std::ops::Range<u64> = 600..620;

const STEADY: &[Ramp] = &[Ramp::None];
const UP: &[Ramp] = &[Ramp::Constant {
    ppb_per_min: 1_000.0,
}];
const TURNING: &[Ramp] = &[TURNS];
const ALL: &[Ramp] = &[Ramp::None, UP[0], TURNS];
const TURNS: Ramp = Ramp::Random {
    ppb_per_min: 1_000.0,
    every_ns: 120_000_000_000,
};

/// A row of readings in which the truth is sought.
struct Case {
    name: &'static str,
    latency: Latency,
    /// What else there is to it than messages with that latency.
    scene: fn(Latency, u64) -> Scene,
    ramps: &'static [Ramp],
    /// In s.
    looked_at: std::ops::Range<i64>,
    /// Against UTC, or else against floor time.
    is_utc: bool,
    /// Whether its mean is to be of use, too.
    is_narrow: bool,
}

impl Case {
    fn new(name: &'static str, latency: Latency) -> Self {
        Self {
            name,
            latency,
            scene: Scene::new,
            ramps: STEADY,
            looked_at: 180..780,
            is_utc: false,
            is_narrow: false,
        }
    }

    /// An M8 in good order.
    fn m8(name: &'static str) -> Self {
        Self::new(name, Latency::m8())
    }

    fn samples(&self, ramp: Ramp, seed: u64) -> Vec<Sample> {
        let mut scene = (self.scene)(self.latency, seed);
        scene.crystal.ramp = ramp;
        let line = Published::new();
        let mut play = scene.play(&line);
        play.until(self.looked_at.end * SECOND);
        let from_ns = self.looked_at.start * SECOND;
        if self.is_utc {
            play.utc_since(from_ns).collect()
        } else {
            play.since(from_ns).collect()
        }
    }

    fn judge(&self, faults: &mut Faults) {
        let boards = SEEDS.flat_map(|seed| self.ramps.iter().map(move |ramp| (*ramp, seed)));
        let samples: Vec<Sample> = boards
            .flat_map(|(ramp, seed)| self.samples(ramp, seed))
            .collect();
        let mean =
            |of: fn(&Sample) -> f64| samples.iter().map(of).sum::<f64>() / samples.len() as f64;
        let error = mean(|sample| sample.error_ns.abs() as f64);
        let uncertainty = mean(|sample| f64::from(sample.uncertainty_ns));
        let held = covered(samples.iter().copied());
        let is_of_use = !self.is_narrow || uncertainty <= 4.0 * error;
        faults.unless(
            held >= 0.95 && is_of_use,
            format!(
                "{}, {:?}, {:?}: {held:.3} are held, {uncertainty:.0} ns for {error:.0} ns",
                self.name, self.ramps, self.looked_at
            ),
        );
    }
}

fn judge(cases: impl IntoIterator<Item = Case>) {
    let mut faults = Faults::default();
    for case in cases {
        case.judge(&mut faults);
    }
    faults.none();
}

#[test]
fn of_messages() {
    judge(
        [
            ("M8", Latency::m8(), true),
            ("harsh M8", Latency::harsh_m8(), true),
            // Soft edges: what is said of them has to hold, however wide.
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
        [0..10, 0..60].map(|looked_at| Case {
            looked_at,
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
            looked_at: 600..1_200,
            ..Case::new(name, latency)
        }),
    );
}

#[test]
fn of_an_unknown_latency() {
    let scene = |latency, seed| Scene {
        settings: Settings::DEFAULT,
        ..Scene::new(latency, seed)
    };
    judge(
        [("M8", Latency::m8()), ("F9", Latency::f9())].map(|(name, latency)| Case {
            scene,
            looked_at: 0..300,
            is_utc: true,
            ..Case::new(name, latency)
        }),
    );
}

#[test]
fn of_a_pulse() {
    let plain = Case {
        scene: |latency, seed| Scene::new(latency, seed).with_pulse(),
        ramps: ALL,
        is_utc: true,
        is_narrow: true,
        ..Case::m8("a pulse")
    };
    let correlated = Case {
        scene: |latency, seed| {
            let mut scene = Scene::new(latency, seed);
            scene.receiver.pulse = PulseSettings::m8_correlated();
            scene.with_pulse()
        },
        ramps: ALL,
        is_utc: true,
        is_narrow: true,
        ..Case::m8("a pulse, half of it slow")
    };
    judge([plain, correlated]);
}

/// Loses its messages after ten minutes.
fn without_messages(mut scene: Scene) -> Scene {
    scene.deaf.push(600 * SECOND..i64::MAX);
    scene
}

/// Loses its pulse after ten minutes.
fn without_pulse(latency: Latency, seed: u64) -> Scene {
    let mut scene = Scene::new(latency, seed);
    scene.receiver.pulse.faults.push(PulseFault {
        from: at_s(600),
        until: WorldNanos(u64::MAX),
        kind: PulseFaultKind::Cut,
    });
    scene.with_pulse()
}

/// For a minute and for ten, at a constant temperature and on ramps.
fn for_a_while(case: impl Fn() -> Case) -> Vec<Case> {
    let ramps = [STEADY, UP, TURNING].into_iter();
    ramps
        .flat_map(|ramps| [(ramps, 600..660), (ramps, 600..1_200)])
        .map(|(ramps, looked_at)| Case {
            ramps,
            looked_at,
            ..case()
        })
        .collect()
}

#[test]
fn of_a_holdover_after_messages() {
    judge(for_a_while(|| Case {
        scene: |latency, seed| without_messages(Scene::new(latency, seed)),
        ..Case::m8("no messages any more")
    }));
}

#[test]
fn of_a_holdover_after_a_pulse() {
    judge(for_a_while(|| Case {
        scene: |latency, seed| without_messages(without_pulse(latency, seed)),
        is_utc: true,
        ..Case::m8("neither pulse nor messages any more")
    }));
}

#[test]
fn of_a_lost_pulse() {
    judge(for_a_while(|| Case {
        scene: without_pulse,
        is_utc: true,
        ..Case::m8("no pulse any more")
    }));
}
