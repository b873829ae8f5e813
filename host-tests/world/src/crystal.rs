//! A board's oscillator, as its counter of core cycles shows it.
//!
//! *Purpose.* Turns true time into the cycles of a board whose crystal is off,
//! noisy and warmed: what every stamp of a simulated board is made of.
//!
//! *Design.* The frequency error is constant over each step of a 100 ms grid and
//! is the sum of an offset, white noise, a random walk and the temperature's part.
//! The last follows a ramp through a first-order lag, as a board's mass does.
//! Whole cycles are counted in integers and only the deviation in `f64`, so that
//! nothing is lost over days. The grid is computed as it is asked for, and its
//! last 16 s are kept for those who look back.
//!
//! *Limits.* The noise is an assumption, and one that is worse than most quartz:
//! a plain crystal is about 1 ppb at 1 s. Noise within a step has no shape.

use std::collections::VecDeque;

use fastrand::Rng;

use crate::WorldNanos;
use crate::chance::{Stream, even, normal, stream};

/// The frequency that the counter has by its data sheet. \[Hz\]
pub const NOMINAL_HZ: u64 = 168_000_000;
/// The grid on which the frequency changes. \[ns\]
const STEP_NS: u64 = 100_000_000;
const STEP_S: f64 = 0.1;
/// How many steps can be looked back.
const KEPT_STEPS: usize = 160;
/// Thousandths of a cycle that pass in a ns.
const MILLICYCLES_PER_NS: u64 = NOMINAL_HZ / 1_000_000;
/// Cycles of deviation that 1 ppb makes in a second.
const CYCLES_PER_PPB_S: f64 = NOMINAL_HZ as f64 * 1e-9;

/// How the temperature moves a crystal's frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ramp {
    /// It does not.
    None,
    /// Always the same way.
    Constant {
        /// In ppb a minute; 1 ppm/min is 1000.
        ppb_per_min: f64,
    },
    /// Back and forth at fixed intervals.
    Switching {
        /// The first direction and how fast, in ppb a minute.
        ppb_per_min: f64,
        /// From turn to turn. \[ns\]
        every_ns: u64,
    },
    /// Back and forth; from turn to turn it takes between half and one and a half
    /// times the interval, and which way it begins is chance, too.
    Random {
        /// How fast, in ppb a minute.
        ppb_per_min: f64,
        /// From turn to turn on average. \[ns\]
        every_ns: u64,
    },
}

impl Ramp {
    /// 1 ppm a minute, always up.
    pub const UP: Self = Self::Constant {
        ppb_per_min: 1_000.0,
    };

    /// 1 ppm a minute, turning every 2 minutes on average.
    pub const TURNING: Self = Self::Random {
        ppb_per_min: 1_000.0,
        every_ns: 120_000_000_000,
    };

    /// The same in the other direction.
    #[must_use]
    pub const fn reversed(mut self) -> Self {
        match &mut self {
            Self::None => {}
            Self::Constant { ppb_per_min }
            | Self::Switching { ppb_per_min, .. }
            | Self::Random { ppb_per_min, .. } => *ppb_per_min = -*ppb_per_min,
        }
        self
    }
}

/// What a [`Crystal`] is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrystalSettings {
    /// The frequency error that it starts with; positive is fast. \[ppb\]
    pub offset_ppb: f64,
    /// White frequency noise: its Allan deviation at 1 s. At τ it is
    /// smaller by √τ. \[ppb\]
    pub white_ppb: f64,
    /// Random walk of the frequency: the standard deviation of what it does in a
    /// second. \[ppb/√s\]
    pub walk_ppb: f64,
    /// What the temperature does to it.
    pub ramp: Ramp,
    /// The time constant with which the crystal follows the temperature. \[ns\]
    pub thermal_lag_ns: u64,
}

impl CrystalSettings {
    /// An oscillator of `offset_ppb` at constant temperature with the noise that
    /// is assumed here: 5 ppb at 1 s and 0.7 ppb/√s, both worse than usual quartz.
    #[must_use]
    pub const fn new(offset_ppb: f64) -> Self {
        Self {
            offset_ppb,
            white_ppb: 5.0,
            walk_ppb: 0.7,
            ramp: Ramp::None,
            thermal_lag_ns: 60_000_000_000,
        }
    }

    /// The same without any noise.
    #[must_use]
    pub const fn quiet(offset_ppb: f64) -> Self {
        Self {
            white_ppb: 0.0,
            walk_ppb: 0.0,
            ..Self::new(offset_ppb)
        }
    }
}

/// A step of the grid.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Cycles beyond the nominal ones at the step's begin.
    ahead_cycles: f64,
    /// The frequency error throughout the step. \[ppb\]
    ppb: f64,
}

/// The oscillator: ask for [`Crystal::cycles_at`].
#[derive(Clone, Debug)]
pub struct Crystal {
    settings: CrystalSettings,
    rng: Rng,
    steps: VecDeque<Step>,
    /// The number of the grid's step that stands first in `steps`.
    first_step: u64,
    /// The random walk so far. \[ppb\]
    walk_ppb: f64,
    /// Where the temperature wants the frequency to be, and where it is. \[ppb\]
    warmth_ppb: f64,
    warmed_ppb: f64,
    /// The ramp's present direction and when it turns.
    direction: f64,
    turns_at_ns: u64,
}

impl Crystal {
    /// An oscillator whose counter is 0 at the world's start.
    #[must_use]
    pub fn new(settings: CrystalSettings, seed: u64) -> Self {
        let mut crystal = Self {
            settings,
            rng: stream(seed, Stream::Crystal),
            steps: VecDeque::with_capacity(KEPT_STEPS + 1),
            first_step: 0,
            walk_ppb: 0.0,
            warmth_ppb: 0.0,
            warmed_ppb: 0.0,
            direction: 1.0,
            turns_at_ns: u64::MAX,
        };
        match settings.ramp {
            Ramp::None | Ramp::Constant { .. } => {}
            Ramp::Switching { every_ns, .. } => crystal.turns_at_ns = every_ns.max(1),
            Ramp::Random { every_ns, .. } => {
                if crystal.rng.bool() {
                    crystal.direction = -1.0;
                }
                crystal.turns_at_ns = crystal.draw_interval(every_ns);
            }
        }
        let step = Step {
            ahead_cycles: 0.0,
            ppb: crystal.ppb_of_step(),
        };
        crystal.steps.push_back(step);
        crystal
    }

    /// What a counter at [`NOMINAL_HZ`] shows at `at`. It is continuous, and it
    /// never goes back from one moment to a later one.
    ///
    /// # Panics
    ///
    /// If `at` lies more than 15.9 s before the latest moment asked for.
    #[must_use]
    pub fn cycles_at(&mut self, at: WorldNanos) -> u64 {
        let step = self.step_at(at);
        let in_step_s = (at.0 % STEP_NS) as f64 * 1e-9;
        let ahead = step.ahead_cycles + step.ppb * CYCLES_PER_PPB_S * in_step_s;
        // A crystal's error is a matter of ppm: the sum cannot be negative.
        (at.0 * MILLICYCLES_PER_NS).saturating_add_signed((ahead * 1e3) as i64) / 1_000
    }

    /// The frequency error at `at`; positive is fast.
    ///
    /// # Panics
    ///
    /// As [`Crystal::cycles_at`]. \[ppb\]
    #[must_use]
    pub fn frequency_ppb_at(&mut self, at: WorldNanos) -> f64 {
        self.step_at(at).ppb
    }

    /// The step in which `at` lies.
    fn step_at(&mut self, at: WorldNanos) -> Step {
        let number = at.0 / STEP_NS;
        while self.first_step + self.steps.len() as u64 <= number {
            self.add_step();
        }
        let kept = number
            .checked_sub(self.first_step)
            .and_then(|index| self.steps.get(index as usize));
        *kept.expect("a moment that has not been forgotten")
    }

    fn add_step(&mut self) {
        let begins_ns = (self.first_step + self.steps.len() as u64) * STEP_NS;
        let last = self.steps[self.steps.len() - 1];
        self.walk_ppb += self.settings.walk_ppb * STEP_S.sqrt() * normal(&mut self.rng);
        self.warm(begins_ns);
        let ppb = self.ppb_of_step();
        self.steps.push_back(Step {
            ahead_cycles: last.ahead_cycles + last.ppb * CYCLES_PER_PPB_S * STEP_S,
            ppb,
        });
        if self.steps.len() > KEPT_STEPS {
            self.steps.pop_front();
            self.first_step += 1;
        }
    }

    /// The frequency error of a step that begins now.
    fn ppb_of_step(&mut self) -> f64 {
        // The mean of white noise over a step varies with 1/√step.
        let white = self.settings.white_ppb / STEP_S.sqrt() * normal(&mut self.rng);
        self.settings.offset_ppb + self.walk_ppb + self.warmed_ppb + white
    }

    /// Lets the temperature pass one step, up to `until_ns`.
    fn warm(&mut self, until_ns: u64) {
        let ppb_per_min = match self.settings.ramp {
            Ramp::None => return,
            Ramp::Constant { ppb_per_min }
            | Ramp::Switching { ppb_per_min, .. }
            | Ramp::Random { ppb_per_min, .. } => ppb_per_min,
        };
        self.warmth_ppb += self.direction * ppb_per_min * STEP_S / 60.0;
        let lag_steps = self.settings.thermal_lag_ns as f64 / STEP_NS as f64;
        let follows = if lag_steps > 0.0 {
            1.0 - (-1.0 / lag_steps).exp()
        } else {
            1.0
        };
        self.warmed_ppb += (self.warmth_ppb - self.warmed_ppb) * follows;
        while self.turns_at_ns <= until_ns {
            self.direction = -self.direction;
            self.turns_at_ns += match self.settings.ramp {
                Ramp::Switching { every_ns, .. } => every_ns.max(1),
                Ramp::Random { every_ns, .. } => self.draw_interval(every_ns),
                Ramp::None | Ramp::Constant { .. } => u64::MAX - self.turns_at_ns,
            };
        }
    }

    fn draw_interval(&mut self, every_ns: u64) -> u64 {
        ((0.5 + even(&mut self.rng)) * every_ns as f64) as u64 + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    /// How far the crystal is ahead at each of `seconds` full seconds, in ns: the
    /// sum of its frequency, which the counter has to show to the cycle.
    fn ahead_ns(crystal: &mut Crystal, seconds: u64) -> Vec<f64> {
        let mut ahead_ns = 0.0;
        let mut path = vec![0.0];
        for step in 0..10 * seconds {
            let at = WorldNanos(step * SECOND / 10);
            ahead_ns += crystal.frequency_ppb_at(at) * 0.1;
            if step % 10 == 9 {
                path.push(ahead_ns);
                let second = step / 10 + 1;
                let cycles = crystal.cycles_at(WorldNanos(second * SECOND));
                let counted = cycles as f64 - (second * NOMINAL_HZ) as f64;
                assert!((counted - ahead_ns * 0.168).abs() < 1.001);
            }
        }
        path
    }

    /// The overlapping Allan deviation at `tau` seconds of phases in ns. \[ppb\]
    fn allan_ppb(phase_ns: &[f64], tau: usize) -> f64 {
        let squares = phase_ns
            .windows(2 * tau + 1)
            .map(|w| (w[2 * tau] - 2.0 * w[tau] + w[0]).powi(2));
        let count = squares.len() as f64;
        (squares.sum::<f64>() / count / 2.0).sqrt() / tau as f64
    }

    #[test]
    fn an_offset_is_kept_to_the_cycle() {
        for ppb in [-50_000.0, 0.0, 50_000.0] {
            let mut crystal = Crystal::new(CrystalSettings::quiet(ppb), 1);
            let day = WorldNanos(86_400 * SECOND);
            let expected = 86_400.0 * 168e6 * (1.0 + ppb * 1e-9);
            assert!((crystal.cycles_at(day) as f64 - expected).abs() <= 1.0);
            assert!((crystal.frequency_ppb_at(day) - ppb).abs() < f64::EPSILON);
        }
    }

    #[test]
    fn white_noise_and_walk_have_the_deviation_that_was_asked_for() {
        let only = |white_ppb, walk_ppb| CrystalSettings {
            white_ppb,
            walk_ppb,
            ..CrystalSettings::new(20_000.0)
        };
        let white = ahead_ns(&mut Crystal::new(only(5.0, 0.0), 3), 20_000);
        // 20 000 s: the estimate itself is good to about 1 % at 1 s, 5 % at 100 s.
        assert!((allan_ppb(&white, 1) / 5.0 - 1.0).abs() < 0.04);
        assert!((allan_ppb(&white, 100) / 0.5 - 1.0).abs() < 0.2);
        // A walk alone: q · √(τ / 3).
        let walk = ahead_ns(&mut Crystal::new(only(0.0, 0.7), 4), 20_000);
        for tau in [10, 100] {
            let expected = 0.7 * (tau as f64 / 3.0).sqrt();
            assert!((allan_ppb(&walk, tau) / expected - 1.0).abs() < 0.15);
        }
        // Both: their squares add up, at 1 s to 5.02 ppb.
        let both = ahead_ns(&mut Crystal::new(CrystalSettings::new(0.0), 5), 20_000);
        assert!((allan_ppb(&both, 1) / 5.02 - 1.0).abs() < 0.04);
    }

    #[test]
    fn ramps_pass_through_the_thermal_lag() {
        let ramp = |ramp| {
            let settings = CrystalSettings {
                ramp,
                ..CrystalSettings::quiet(10_000.0)
            };
            Crystal::new(settings, 6)
        };
        let at = |crystal: &mut Crystal, s| crystal.frequency_ppb_at(WorldNanos(s * SECOND));
        let ppb_per_min = 1_000.0;

        let mut constant = ramp(Ramp::Constant { ppb_per_min });
        // A first-order lag τ behind a ramp r: r · (t − τ · (1 − e^(−t/τ))).
        for s in [30, 60, 300, 780] {
            let t = s as f64 / 60.0;
            let expected = 10_000.0 + 1_000.0 * (t - (1.0 - (-t).exp()));
            let is = at(&mut constant, s);
            assert!(
                (is - expected).abs() < 0.02 * expected.abs().min(1_000.0),
                "{s}: {is}"
            );
        }

        let every_ns = 120 * SECOND;
        let mut switching = ramp(Ramp::Switching {
            ppb_per_min,
            every_ns,
        });
        let path: Vec<f64> = (0..1_200)
            .map(|s| at(&mut switching, s) - 10_000.0)
            .collect();
        // A triangle of 0 to 2 ppm. Behind a lag τ of half its flank T it swings by
        // r · τ · (T/2τ − ln(1 + tanh(T/2τ))) = 0.434 ppm to either side of 1 ppm.
        let most = path[600..].iter().copied().fold(f64::MIN, f64::max);
        let least = path[600..].iter().copied().fold(f64::MAX, f64::min);
        assert!((most - 1_434.0).abs() < 10.0 && (least - 566.0).abs() < 10.0);
        // On its first flank it comes to 1 − e⁻² of the ramp itself.
        let steps = path.windows(2).map(|w| (w[1] - w[0]).abs());
        let fastest_per_min = steps.fold(0.0, f64::max) * 60.0;
        assert!((fastest_per_min - 864.7).abs() < 17.0, "{fastest_per_min}");

        let mut random = ramp(Ramp::Random {
            ppb_per_min,
            every_ns,
        });
        let path: Vec<f64> = (0..100_000).map(|s| at(&mut random, s)).collect();
        let signs: Vec<f64> = path.windows(2).map(|w| (w[1] - w[0]).signum()).collect();
        // Up as long as down; 833 turns of 120 s.
        let balance = signs.iter().sum::<f64>() / signs.len() as f64;
        assert!(balance.abs() < 0.05, "{balance}");
        let turns = signs.windows(2).filter(|w| w[0] != w[1]).count();
        assert!((700..=900).contains(&turns), "{turns}");
    }

    #[test]
    fn it_is_continuous_and_can_be_looked_back_at() {
        let mut crystal = Crystal::new(CrystalSettings::new(-50_000.0), 7);
        let begin = 5 * SECOND - 2_000;
        let forward: Vec<u64> = (0..4_000)
            .map(|ns| crystal.cycles_at(WorldNanos(begin + ns)))
            .collect();
        assert!(forward.windows(2).all(|w| w[1] - w[0] <= 1));
        let _ = crystal.cycles_at(WorldNanos(20 * SECOND));
        for (ns, cycles) in forward.iter().enumerate() {
            assert_eq!(crystal.cycles_at(WorldNanos(begin + ns as u64)), *cycles);
        }
    }

    #[test]
    fn the_same_seed_is_the_same_crystal() {
        let settings = CrystalSettings::new(25_000.0);
        let path = |seed| ahead_ns(&mut Crystal::new(settings, seed), 100);
        assert_eq!(path(1), path(1));
        assert_ne!(path(1), path(2));
    }
}
