//! What the bins teach: the frequency, the window and the level, a piece of the work a mark.
//!
//! *Purpose.* The work that a closed bin leaves, and how far the line may be off after it.
//!
//! *Design.* [`Chore`] says what is to do next. See `envelope`.
//!
//! *Limits.* A piece looks at a few points, so that no mark costs more than that.

use super::survey::Survey;
use super::trend::{Trend, seconds};
use super::{BIN_US, Chore, Envelope, FRESH_S, NEAR_NS, RETURN_S, WINDOW_S};
use crate::float::sqrt;
use crate::holdover::{CRYSTAL_PPB, DRIFT_PPB_PER_S};

/// It stays as it is for so long, in s.
const ADAPT_AFTER_S: f32 = 30.0;
/// By how much the window moves at a bin's end, as a part of itself.
const WINDOW_STEP: f32 = 0.02;
/// W³λ, in s² a ns: the edge's noise 1/λW and the bend of a drift of 1 ppm a minute,
/// 16.7 W²/8 ns, weighed against each other. Tuned.
const WINDOW_CUBED_DENSITY: f32 = 0.15;
/// How the estimate's uncertainty about the frequency grows, in ppb² a second.
const FREQUENCY_WALK: f32 = 80.0 * 80.0;
/// Windows overlap from bin to bin; a slope is worth this part of a window's second.
const SLOPE_WORTH_S: f32 = 100.0;
const FIRST_SLOPE_WORTH_S: f32 = 8.0;
/// So many points are looked at for one mark when the level is sought.
const LEVEL_AT_ONCE: usize = 15;
/// The frequency's variance while the floor wanders, in ppb².
const WANDER_VARIANCE: f32 = 5_000.0 * 5_000.0;
/// The lowest of half a window is twice as far above the floor as that of a whole one; and there
/// are two.
const TWO_HALVES: f32 = 2.0 * core::f32::consts::SQRT_2;
/// A slope that moves the floor by more over the window is no wander, and so no crystal's either
/// once that is known, in ns.
const BEYOND_WANDER_NS: f32 = 20e6;
/// Afterwards by so much a bin at most: 4.8 ppm a minute where a crystal drifts by 1. \[ppb\]
const MOST_STEP_PPB: f32 = 160.0;
/// Or by so much of its standard deviation, where jitter leaves it that wide.
const MOST_STEP_SIGMAS: f32 = 0.25;

impl Envelope {
    /// Does one piece of the work that the last bins left.
    pub(super) fn work(&mut self, at_us: u32) {
        self.chore = match self.chore {
            Chore::Survey(mut survey) => {
                if survey.look(self.bins.full()) {
                    self.edge.measure(survey.lowest(), survey.span_s());
                    self.adapt_window(survey.span_s());
                    // From here on it rises differently.
                    self.line = self.line.moved_to(at_us);
                    self.learn_frequency(&survey);
                    Chore::Level(0, i32::MAX, self.line)
                } else {
                    Chore::Survey(survey)
                }
            }
            Chore::Level(done, lowest_ns, line) => {
                let lowest_ns = lowest_ns.min(self.lowest_of_some(done, &line));
                if done + LEVEL_AT_ONCE < self.points_for_level() {
                    Chore::Level(done + LEVEL_AT_ONCE, lowest_ns, line)
                } else {
                    self.set_level(lowest_ns, line, at_us);
                    if self.wander.is_due() {
                        Chore::Wander
                    } else {
                        Chore::Nothing
                    }
                }
            }
            Chore::Wander => {
                if self.wander.judge(at_us, &self.line, &self.edge) {
                    Chore::Nothing
                } else {
                    Chore::Wander
                }
            }
            Chore::Nothing => Chore::Nothing,
        };
    }

    pub(super) fn wanders(&self) -> bool {
        self.wander.scatter_ns() > 0.0
    }

    /// The part of the window that there are marks in, in s.
    pub(super) fn span_s(&self) -> f32 {
        self.age_s.min(self.window_s)
    }

    fn learn_frequency(&mut self, survey: &Survey) {
        if let Some(slow_ppb) = self.wander.slow_ppb()
            && self.wanders()
        {
            self.line.crystal_ppb = within(slow_ppb, CRYSTAL_PPB);
            self.variance = WANDER_VARIANCE;
            return;
        }
        let Some((slope_ppb, apart_s)) = survey.slope() else {
            return;
        };
        let span_s = survey.span_s();
        let slope_uncertainty = TWO_HALVES * self.edge.scale_ns() / apart_s;
        // The same points are asked again and again until the first window is full.
        let worth_s = if self.is_young() {
            FIRST_SLOPE_WORTH_S
        } else {
            SLOPE_WORTH_S
        };
        let worth = (span_s / worth_s).max(1.0);
        self.variance += FREQUENCY_WALK * (BIN_US as f32 * 1e-6);
        // Judged by the density inside of bins, which a slope does not blur.
        let chance_ns = 8.0 * TWO_HALVES * self.edge.gap_in(span_s);
        if slope_ppb.abs() * apart_s > BEYOND_WANDER_NS.max(chance_ns) {
            // A floor that jumps is no frequency.
            return;
        }
        self.unexplained_ppb = if self.is_young() {
            slope_ppb.abs()
        } else {
            0.0
        };
        let gain = self.variance / (self.variance + slope_uncertainty * slope_uncertainty * worth);
        // At first the edge is hardly known: no bin moves the frequency farther than belief allows.
        let most_ppb = if self.is_young() {
            2.0 * sqrt(self.variance)
        } else {
            MOST_STEP_PPB.max(MOST_STEP_SIGMAS * sqrt(self.variance))
        };
        let moved_ppb = self.line.crystal_ppb + within(gain * slope_ppb, most_ppb);
        self.line.crystal_ppb = within(moved_ppb, CRYSTAL_PPB);
        self.variance *= 1.0 - gain;
    }

    /// Moves the window towards where the edge's noise and a drift's bend are in balance.
    fn adapt_window(&mut self, span_s: f32) {
        if self.age_s < ADAPT_AFTER_S {
            return;
        }
        let density = 1.0 / (self.edge.scale_ns() * span_s).max(1.0);
        let cube = self.window_s * self.window_s * self.window_s;
        let step = if cube * density < WINDOW_CUBED_DENSITY {
            WINDOW_STEP
        } else {
            -WINDOW_STEP
        };
        self.window_s = (self.window_s * (1.0 + step)).clamp(WINDOW_S.0, WINDOW_S.1);
    }

    /// How many points the level is the lowest of: those of the window, and of everything while the
    /// floor wanders.
    fn points_for_level(&self) -> usize {
        let long = if self.wanders() {
            self.wander.points().len()
        } else {
            0
        };
        self.bins.full().len() + long
    }

    /// How far the lowest of some of them is above `line`, in ns.
    fn lowest_of_some(&self, from: usize, line: &Trend) -> i32 {
        let recent = self.bins.full().iter().map(|point| (point, self.window_s));
        let long = self.wander.points().iter().map(|point| (point, f32::MAX));
        let mut lowest_ns = i32::MAX;
        for (point, within_s) in recent.chain(long).skip(from).take(LEVEL_AT_ONCE) {
            if seconds(line.at_us, point.at_us) <= within_s {
                lowest_ns = lowest_ns.min(line.excess_ns(*point));
            }
        }
        lowest_ns
    }

    /// Puts the line's level so far above `line`, or lower if a mark has come lower meanwhile.
    fn set_level(&mut self, lowest_ns: i32, line: Trend, at_us: u32) {
        let since = self.bins.filling().map(|point| line.excess_ns(point));
        let lowest_ns = since.map_or(lowest_ns, |ns| ns.min(lowest_ns));
        // Whether a floor has moved farther is for the marks to come to say.
        let is_fresh = self.is_unsettled && self.age_s < FRESH_S;
        if lowest_ns < NEAR_NS || (is_fresh && lowest_ns < i32::MAX) {
            self.line = line.raised(lowest_ns).moved_to(at_us);
        }
    }

    /// How far the line may be from the floor, in ns.
    pub(super) fn uncertainty_ns(&self) -> f32 {
        let span_s = self.span_s();
        let bend_ns = DRIFT_PPB_PER_S * span_s * span_s / 16.0;
        let tilt_ns = (0.2 * sqrt(self.variance)).max(0.5 * self.unexplained_ppb) * span_s;
        let drifted_ns = if self.age_s < RETURN_S {
            self.drifted_ns
        } else {
            0.0
        };
        self.edge.uncertainty_ns() + bend_ns + tilt_ns + drifted_ns + 2.0 * self.wander.scatter_ns()
    }
}

/// The value, or the limit on its side of 0. Not `clamp`, which panics where a limit is not a
/// number, and brings the formatting of floats.
fn within(value: f32, most: f32) -> f32 {
    value.max(-most).min(most)
}
