//! The slow wander of a receiver's least latency.
//!
//! *Purpose.* On real receivers the floor moves by 4 to 10 ms over minutes, with
//! the satellites in use: the error that no filter of messages can see.
//!
//! *Design.* A sine is a formula; a random walk is a path over a grid of 1 s,
//! drawn when it is asked for, kept whole and straight between its points.
//!
//! *Limits.* The path's memory grows by 8 bytes a second.

use core::f64::consts::TAU;

use fastrand::Rng;

use crate::WorldNanos;
use crate::chance::{Stream, even, normal, stream};

const GRID_NS: u64 = 1_000_000_000;

/// How the floor of the latency moves: always upwards from the least.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wander {
    /// It stands still.
    None,
    /// Up and down.
    Sine {
        /// From the least to the most. \[ns\]
        peak_to_peak_ns: u64,
        /// From one least to the next. \[ns\]
        period_ns: u64,
        /// Where in its period it begins, in 10⁻⁶ of it; 0 is in the middle, on
        /// the way up.
        phase_millionths: u32,
    },
    /// It stands higher for a while, as when one more message is switched on or other satellites come.
    Step {
        /// By how much. \[ns\]
        above_ns: u64,
        /// The first moment at which it does.
        from: WorldNanos,
        /// The first moment at which it does not any more.
        until: WorldNanos,
    },
    /// A random walk between two walls that throw it back. It begins anywhere
    /// between them.
    Walk {
        /// From wall to wall. \[ns\]
        peak_to_peak_ns: u64,
        /// The standard deviation of what it does in a second. \[ns/√s\]
        ns_per_sqrt_s: u64,
    },
}

impl Wander {
    /// Between the two walls of a walk 8 ms apart it takes about 5 min to cross:
    /// (8 ms / 0.46 ms)² s.
    pub const WALK_8_MS: Self = Self::Walk {
        peak_to_peak_ns: 8_000_000,
        ns_per_sqrt_s: 460_000,
    };

    /// A sine of 8 ms from least to most, with its period in ns and its phase in
    /// 10⁻⁶ of that.
    #[must_use]
    pub const fn sine_8_ms(period_ns: u64, phase_millionths: u32) -> Self {
        Self::Sine {
            peak_to_peak_ns: 8_000_000,
            period_ns,
            phase_millionths,
        }
    }
}

/// The wander as it happens.
#[derive(Clone, Debug)]
pub(crate) struct Wanderer {
    wander: Wander,
    rng: Rng,
    /// The walk at each point of the grid. \[ns\]
    path: Vec<f64>,
}

impl Wanderer {
    pub(crate) fn new(wander: Wander, seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Wander);
        let path = match wander {
            Wander::None | Wander::Sine { .. } | Wander::Step { .. } => Vec::new(),
            Wander::Walk {
                peak_to_peak_ns, ..
            } => vec![even(&mut rng) * peak_to_peak_ns as f64],
        };
        Self { wander, rng, path }
    }

    /// How far above the least it stands at `at`. \[ns\]
    pub(crate) fn above_least_ns(&mut self, at: WorldNanos) -> f64 {
        match self.wander {
            Wander::None => 0.0,
            Wander::Step {
                above_ns,
                from,
                until,
            } => {
                if (from..until).contains(&at) {
                    above_ns as f64
                } else {
                    0.0
                }
            }
            Wander::Sine {
                peak_to_peak_ns,
                period_ns,
                phase_millionths,
            } => {
                let period_ns = period_ns.max(1);
                let turn = (at.0 % period_ns) as f64 / period_ns as f64;
                let phase = f64::from(phase_millionths) * 1e-6;
                0.5 * peak_to_peak_ns as f64 * (1.0 + (TAU * (turn + phase)).sin())
            }
            Wander::Walk {
                peak_to_peak_ns,
                ns_per_sqrt_s,
            } => {
                let index = (at.0 / GRID_NS) as usize;
                while self.path.len() < index + 2 {
                    let last = self.path[self.path.len() - 1];
                    let next = last + ns_per_sqrt_s as f64 * normal(&mut self.rng);
                    self.path.push(reflected(next, peak_to_peak_ns as f64));
                }
                let part = (at.0 % GRID_NS) as f64 / GRID_NS as f64;
                self.path[index] * (1.0 - part) + self.path[index + 1] * part
            }
        }
    }
}

/// `x` thrown back by walls at 0 and `width` until it lies between them.
fn reflected(x: f64, width: f64) -> f64 {
    if width <= 0.0 {
        return 0.0;
    }
    let folded = x.rem_euclid(2.0 * width);
    folded.min(2.0 * width - folded)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    fn path(wander: Wander, seed: u64, seconds: u64) -> Vec<f64> {
        let mut wanderer = Wanderer::new(wander, seed);
        (0..seconds)
            .map(|s| wanderer.above_least_ns(WorldNanos(s * SECOND)))
            .collect()
    }

    #[test]
    fn a_sine_goes_from_the_least_to_the_most_and_back() {
        for period_s in [60, 600, 3_600] {
            let sine = path(
                Wander::sine_8_ms(period_s * SECOND, 250_000),
                1,
                period_s + 1,
            );
            let (whole, half) = (period_s as usize, period_s as usize / 2);
            assert!((sine[0] - 8e6).abs() < 1.0 && (sine[whole] - 8e6).abs() < 1.0);
            assert!(sine[half].abs() < 1.0);
            assert!(sine.iter().all(|ns| (0.0..=8e6).contains(ns)));
        }
    }

    #[test]
    fn a_walk_stays_between_its_walls_and_uses_all_the_room() {
        let walk = path(Wander::WALK_8_MS, 2, 100_000);
        assert!(walk.iter().all(|ns| (0.0..=8e6).contains(ns)));
        // In the long run it is everywhere alike: mean 4 ms, deviation 8/√12 ms.
        // 100 000 s are some 800 independent places.
        let mean = walk.iter().sum::<f64>() / 1e5;
        let square = walk.iter().map(|ns| (ns - mean).powi(2)).sum::<f64>() / 1e5;
        assert!((mean - 4e6).abs() < 0.4e6, "{mean}");
        assert!((square.sqrt() - 2.31e6).abs() < 0.2e6, "{square}");
        // A step is what was asked for, less the little that the walls take.
        let steps = walk.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>() / 1e5;
        assert!((steps.sqrt() / 460e3 - 1.0).abs() < 0.06, "{steps}");
    }

    #[test]
    fn a_walk_can_be_looked_back_at_and_depends_on_its_seed() {
        let mut wanderer = Wanderer::new(Wander::WALK_8_MS, 3);
        let early = wanderer.above_least_ns(WorldNanos(SECOND / 2));
        let _ = wanderer.above_least_ns(WorldNanos(3_600 * SECOND));
        assert_eq!(wanderer.above_least_ns(WorldNanos(SECOND / 2)), early);
        assert_ne!(path(Wander::WALK_8_MS, 3, 9), path(Wander::WALK_8_MS, 4, 9));
    }
}
