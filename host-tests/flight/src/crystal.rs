//! The crystal of a flight: how many cycles the board has counted at a true time.
//!
//! *Design.* The frequency error is linear between knots and constant outside them,
//! so that its integral is a sum of trapezia. Nominal cycles are counted in integers
//! and only the deviation in `f64`, so that nothing is lost over days.
//!
//! *Limits.* The board starts [`Crystal::BOOT_BEFORE_S`] before the flight, so that
//! what happened a little before the flight has a positive stamp.

use world::WorldPicos;

/// Cycles of the core in a µs, nominally.
const CYCLES_PER_US: i128 = timebase::CORE_HZ as i128 / 1_000_000;
/// Cycles of deviation that 1 ppm makes in a second.
const CYCLES_PER_PPM_S: f64 = timebase::CORE_HZ as f64 * 1e-6;
const PS_PER_US: i128 = 1_000_000;

/// How fast the crystal is at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Since the flight's start, in s.
    pub at_s: f64,
    /// Fast by, in ppm.
    pub ppm: f64,
}

/// A crystal.
#[derive(Clone, Debug, PartialEq)]
pub struct Crystal {
    /// In the order of their time; at least one.
    knots: Vec<Knot>,
    /// What it is ahead at each knot, since the first one, in ppm·s (µs).
    ahead_us: Vec<f64>,
    /// What it is ahead at the flight's start, from the same origin.
    ahead_at_start_us: f64,
}

impl Crystal {
    /// How long before the flight's start the board was started, in s.
    pub const BOOT_BEFORE_S: i64 = 100;

    /// One that is always fast by `ppm`.
    #[must_use]
    pub fn constant(ppm: f64) -> Self {
        Self::new(vec![Knot { at_s: 0.0, ppm }])
    }

    /// Linear between `knots`, which are in the order of their time; right, if there
    /// are none. Two knots at one time are a step.
    #[must_use]
    pub fn new(mut knots: Vec<Knot>) -> Self {
        if knots.is_empty() {
            knots.push(Knot {
                at_s: 0.0,
                ppm: 0.0,
            });
        }
        let mut ahead_us = vec![0.0];
        let mut sum = 0.0;
        for pair in knots.windows(2) {
            sum += 0.5 * (pair[0].ppm + pair[1].ppm) * (pair[1].at_s - pair[0].at_s);
            ahead_us.push(sum);
        }
        let mut crystal = Self {
            knots,
            ahead_us,
            ahead_at_start_us: 0.0,
        };
        crystal.ahead_at_start_us = crystal.ahead_us_at(0.0);
        crystal
    }

    /// The knots.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// How many cycles the board has counted since its start.
    #[must_use]
    pub fn cycles_at(&self, at: WorldPicos) -> u64 {
        let boot_us = i128::from(Self::BOOT_BEFORE_S) * 1_000_000;
        let nominal = (boot_us * PS_PER_US + i128::from(at.0)) * CYCLES_PER_US / PS_PER_US;
        let ahead_us = self.ahead_us_at(at.as_secs()) - self.ahead_at_start_us;
        let ahead = (ahead_us * CYCLES_PER_PPM_S).round() as i128;
        u64::try_from(nominal + ahead).unwrap_or(0)
    }

    /// How fast it is at `at_s`, in ppm.
    #[must_use]
    pub fn ppm_at(&self, at_s: f64) -> f64 {
        let next = self.knots.partition_point(|knot| knot.at_s <= at_s);
        match (next.checked_sub(1), self.knots.get(next)) {
            (None, _) => self.knots[0].ppm,
            (Some(last), None) => self.knots[last].ppm,
            (Some(last), Some(next)) => {
                let last = &self.knots[last];
                let share = (at_s - last.at_s) / (next.at_s - last.at_s);
                last.ppm + share * (next.ppm - last.ppm)
            }
        }
    }

    /// How far it is ahead since the first knot, in µs.
    fn ahead_us_at(&self, at_s: f64) -> f64 {
        let next = self.knots.partition_point(|knot| knot.at_s <= at_s);
        let from = next.saturating_sub(1);
        let knot = &self.knots[from];
        self.ahead_us[from] + 0.5 * (knot.ppm + self.ppm_at(at_s)) * (at_s - knot.at_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000_000;

    #[test]
    fn a_constant_crystal_counts_at_its_rate() {
        let boot = 100 * 168_000_000;
        let right = Crystal::constant(0.0);
        assert_eq!(right.cycles_at(WorldPicos(0)), boot);
        assert_eq!(right.cycles_at(WorldPicos(SECOND)), boot + 168_000_000);
        assert_eq!(right.cycles_at(WorldPicos(-SECOND)), boot - 168_000_000);
        let fast = Crystal::constant(40.0);
        // 40 ppm in 1 000 s are 40 ms.
        assert_eq!(
            fast.cycles_at(WorldPicos(1_000 * SECOND)),
            boot + 1_000 * 168_000_000 + 6_720_000
        );
    }

    #[test]
    fn between_knots_the_frequency_is_linear_and_outside_it_is_constant() {
        let knots = [(10.0, 20.0), (70.0, 21.0), (70.0, 30.0), (100.0, 27.0)];
        let knots = knots.map(|(at_s, ppm)| Knot { at_s, ppm }).to_vec();
        let crystal = Crystal::new(knots);
        for (at_s, ppm) in [
            (0.0, 20.0),
            (40.0, 20.5),
            (70.0, 30.0),
            (90.0, 28.0),
            (1e6, 27.0),
        ] {
            assert!((crystal.ppm_at(at_s) - ppm).abs() < 1e-9, "{at_s}");
        }
        // Steps of 10 ms, the frequency in the middle of each.
        let mut ahead_us = 0.0;
        for step in 0..20_000 {
            ahead_us += 0.01 * crystal.ppm_at((f64::from(step) + 0.5) * 0.01);
        }
        let counted = crystal.cycles_at(WorldPicos(200 * SECOND)) as f64;
        let nominal = 300.0 * 168e6;
        assert!((counted - nominal - ahead_us * 168.0).abs() < 2.0);
    }
}
