//! A pulse track: how the crystal stands to a train of pulses.
//!
//! *Purpose.* A time pulse is an edge, good to tens of ns. This follows a train of them on the
//! board's own counter, which nothing steers, and says where the next one has to be.
//!
//! *Design.* A pulse is that counter's time less the second it marks, its *lateness*, and a crystal
//! makes a line of those. Two Kalman filters (`crate::kalman`) follow the line side by side: one
//! believes in drift, as a changing temperature makes it, one does not and is quieter. The quiet
//! one is asked unless the mean of its innovations says that it lags.
//!
//! What was not where it was expected widens the uncertainty at once, and is forgotten by
//! 15 % a pulse. When no noise explains the mean of the last innovations, the drift has changed, as
//! when a ramp turns round: it is learnt anew.
//!
//! *Limits.* Which second a pulse marks is known to whoever asks: the track has the phase alone.

use crate::float::{float, sqrt, whole};
use crate::holdover::{CRYSTAL_PPB, DRIFT_PPB_PER_S};
use crate::kalman::{Kalman, Noise};
use crate::second::SECOND_NS;

/// How far from its place a pulse is expected: standard deviations,
const GATE_SIGMAS: f32 = 6.0;
/// and ns: a few of the M8's 60 ns (99 %, u-blox M8 data sheets, time pulse accuracy).
const GATE_NS: f32 = 250.0;

/// So far beside its track a pulse may be and still belong to its train, and farther by so much a
/// second without one. \[ns\], \[ppb\]
const DOOR_NS: f32 = 3_000.0;
const DOOR_PPB: f32 = 120.0;

/// 30 ns RMS for an M8's pulse (u-blox M8 data sheets), and the capture's own step of 11.9 ns.
const MEASUREMENT: f32 = 30.0 * 30.0 + 11.9 * 11.9 / 12.0;

/// A crystal at constant temperature.
static QUIET: Noise = Noise {
    phase_walk: 25.0,
    frequency_walk: 0.5,
    drift_variance: 0.0,
    drift_time_s: 100.0,
    measurement: MEASUREMENT,
};

/// A crystal whose temperature moves: 1 ppm a minute is 16.7 ppb a second.
static RAMPING: Noise = Noise {
    drift_variance: 12.0 * 12.0,
    ..QUIET
};

/// The quiet filter's innovations are averaged over this number of pulses.
const BIAS_OVER: f32 = 8.0;
/// It lags when their mean is above this number of standard deviations of one; white ones have 0.26.
const BIASED: f32 = 0.9;
/// It does not lag any more when their mean is below.
const UNBIASED: f32 = 0.5;

/// For this number of pulses the quiet filter is not asked after it has lagged: while a ramp turns
/// round, the mean passes through 0, and a crystal that has drifted will again.
const LAGS_FOR: u8 = 120;

/// Where the crystal is steady, the two filters are not farther apart a second later. \[ns\]
const APART_NS: f32 = 32.0;
/// Beyond that the quiet one may be off by so many times the distance.
const APART_WORTH: f32 = 1.5;

/// The uncertainty, in standard deviations.
const UNCERTAIN_SIGMAS: f32 = 2.55;

/// That of the frequency, until the next pulse.
const NEXT_SIGMAS: f32 = 1.3;

/// An innovation is a surprise beyond this number of its standard deviations.
const SURPRISE_SIGMAS: f32 = 4.0;
/// A surprise is forgotten by this part of it a pulse.
const SURPRISE_FORGOTTEN: f32 = 0.15;

/// The ramping filter's innovations are averaged over this number of pulses.
const LAG_OVER: f32 = 3.0;
/// It lags when their mean is beyond this number of standard deviations of one; white ones have 0.45.
const LAGGING: f32 = 1.0;
/// What is beyond so many may be lag already, and the phase be off by so many times as much, up to
/// [`MOST_LAG_NS`].
const UNLAGGING: f32 = 0.7;
const LAG_WORTH: f32 = 1.0;
const MOST_LAG_NS: f32 = 20.0;
/// Beyond so many the quiet filter lags, too, and is not asked for so many pulses at least.
const QUIET_LAGGING: f32 = 1.4;
const TURNS_FOR: u8 = 5;
/// When it lags, nothing better is known of the drift than this; 1 ppm a minute is 16.7. \[ppb/s\]
const TURN_PPB_PER_S: f32 = 15.0;

/// A drift of 1 ppm a minute that has just turned round, before an innovation shows it. \[ppb\]
const TURNED_PPB: f32 = 120.0;

/// A train of pulses and the crystal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PulseTrack {
    quiet: Kalman,
    ramping: Kalman,
    /// The quiet filter has lagged so many pulses ago that it is not asked for so many more.
    lags_for: u8,
    bias: f32,
    surprise_ns: f32,
    /// The mean of the ramping filter's last innovations. \[ns\]
    lag_ns: f32,
    /// How far the phase may be off for that. \[ns\]
    lagging_ns: f32,
    /// The last pulse that fitted, less what the receiver says it was late, by the
    /// board's counter; the filters' phases are relative to it. \[ns\]
    edge_ns: u64,
}

/// Where a pulse is beside its track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fit {
    /// Where it was expected.
    Expected,
    /// A little beside it.
    Beside,
    /// It is none of the train.
    Off,
    /// Its second has had its pulse.
    Doubled,
}

impl PulseTrack {
    /// A track that begins with the pulse at `edge_ns`, of a crystal that is `crystal_ppb` fast,
    /// give or take `uncertainty_ppb`.
    pub(crate) const fn new(edge_ns: u64, crystal_ppb: f32, uncertainty_ppb: f32) -> Self {
        Self {
            quiet: Kalman::new(&QUIET, crystal_ppb, uncertainty_ppb),
            ramping: Kalman::new(&RAMPING, crystal_ppb, uncertainty_ppb),
            lags_for: 0,
            bias: 0.0,
            surprise_ns: 0.0,
            lag_ns: 0.0,
            lagging_ns: 0.0,
            edge_ns,
        }
    }

    /// The last pulse that fitted, by the board's counter. \[ns\]
    pub(crate) const fn edge_ns(&self) -> u64 {
        self.edge_ns
    }

    /// From the last pulse to a time of the board's counter. \[s\]
    pub(crate) fn since_s(&self, local_ns: u64) -> f32 {
        float(local_ns.wrapping_sub(self.edge_ns).cast_signed()) * 1e-9
    }

    const fn filter(&self) -> &Kalman {
        if self.lags_for > 0 {
            &self.ramping
        } else {
            &self.quiet
        }
    }

    /// By how much the crystal is fast. \[ppb\]
    pub(crate) const fn crystal_ppb(&self) -> f32 {
        self.filter().frequency_ppb
    }

    /// How far that may be off until the next pulse: a part of it is the phase's uncertainty,
    /// which was at its worst when the frequency was. And how far beside that when pulses stay
    /// away: the filters may lag behind a crystal. \[ppb\]
    pub(crate) fn frequency_uncertainties_ppb(&self) -> (f32, f32) {
        let filter = self.filter();
        let deviation_ppb = filter.frequency_deviation_ppb();
        let apart_ppb = filter.frequency_ppb - self.ramping.frequency_ppb;
        let turned_ppb =
            apart_ppb.abs() + TURNED_PPB + (UNCERTAIN_SIGMAS - NEXT_SIGMAS) * deviation_ppb;
        (NEXT_SIGMAS * deviation_ppb, turned_ppb)
    }

    /// True time from the last pulse's second to a time of the board's counter. \[ns\]
    pub(crate) fn elapsed_ns(&self, local_ns: u64) -> i64 {
        let since_ns = local_ns.wrapping_sub(self.edge_ns).cast_signed();
        let filter = self.filter();
        let ahead_ns = filter.phase_ns + filter.frequency_ppb * (float(since_ns) * 1e-9);
        since_ns.saturating_sub(whole(ahead_ns))
    }

    /// How far [`Self::elapsed_ns`] may be off. \[ns\]
    pub(crate) fn uncertainty_ns(&self, local_ns: u64) -> f32 {
        let since_s = self.since_s(local_ns);
        let (next_ppb, turned_ppb) = self.frequency_uncertainties_ppb();
        self.phase_uncertainty_ns()
            + (next_ppb + turned_ppb) * since_s.abs()
            + 0.5 * DRIFT_PPB_PER_S * since_s * since_s
    }

    /// How far the phase may be off at the last pulse. \[ns\]
    pub(crate) fn phase_uncertainty_ns(&self) -> f32 {
        let quiet_ns = if self.lags_for > 0 {
            0.0
        } else {
            let apart_ns = self.quiet.phase_ns - self.ramping.phase_ns + self.quiet.frequency_ppb
                - self.ramping.frequency_ppb;
            APART_WORTH * (apart_ns.abs() - APART_NS).max(0.0)
        };
        UNCERTAIN_SIGMAS * self.filter().phase_deviation_ns()
            + self.surprise_ns
            + self.lagging_ns
            + quiet_ns
    }

    /// Takes a pulse at `edge_ns` by the board's counter.
    pub(crate) fn update(&mut self, edge_ns: u64) -> Fit {
        let since_ns = edge_ns.wrapping_sub(self.edge_ns).cast_signed();
        // Numbered by the crystal, which is right to a ms over the few seconds.
        let seconds_ns = nearest_second(since_ns);
        if since_ns < 0 || seconds_ns == 0 {
            let is_off = since_ns.unsigned_abs() > 1_000_000;
            return if is_off { Fit::Off } else { Fit::Doubled };
        }
        let moved_ns = since_ns.wrapping_sub(seconds_ns);
        if moved_ns.unsigned_abs() > 20_000_000 {
            return Fit::Off;
        }
        let dt_s = float(since_ns) * 1e-9;
        let moved_ns = float(moved_ns);
        let mut ramping = self.ramping;
        ramping.predict(dt_s);
        let innovation_ns = moved_ns - ramping.phase_ns;
        let deviation_ns = sqrt(ramping.innovation_variance());
        let gate_ns = GATE_NS + GATE_SIGMAS * deviation_ns;
        if innovation_ns.abs() > gate_ns {
            let door_ns = DOOR_NS + (DOOR_PPB + 2.0 * DRIFT_PPB_PER_S * dt_s) * dt_s;
            if innovation_ns.abs() > gate_ns.max(door_ns) {
                return Fit::Off;
            }
            self.surprise_ns = self.surprise_ns.max(innovation_ns.abs());
            return Fit::Beside;
        }
        self.edge_ns = edge_ns;
        ramping.update(innovation_ns);
        let quiet = &mut self.quiet;
        quiet.predict(dt_s);
        let quiet_ns = moved_ns - quiet.phase_ns;
        let surprise = quiet_ns / sqrt(quiet.innovation_variance());
        quiet.update(quiet_ns);
        quiet.rebase(moved_ns);
        self.bias += (surprise.clamp(-5.0, 5.0) - self.bias) / BIAS_OVER;
        if self.bias.abs() > BIASED {
            self.lags_for = LAGS_FOR;
        } else if self.bias.abs() < UNBIASED {
            self.lags_for = self.lags_for.saturating_sub(1);
        }
        self.lag_ns += (innovation_ns - self.lag_ns) / LAG_OVER;
        let most_ns = if self.lags_for > 0 {
            MOST_LAG_NS
        } else {
            2.0 * MOST_LAG_NS
        };
        self.lagging_ns = (LAG_WORTH * (self.lag_ns.abs() - UNLAGGING * deviation_ns))
            .max(0.0)
            .min(most_ns);
        if self.lag_ns.abs() > LAGGING * deviation_ns {
            self.lagging_ns = 0.0;
            ramping.open_drift(TURN_PPB_PER_S);
        }
        if self.lag_ns.abs() > QUIET_LAGGING * deviation_ns {
            self.lags_for = self.lags_for.max(TURNS_FOR);
        }
        let surprise_ns = innovation_ns.abs() - SURPRISE_SIGMAS * deviation_ns;
        self.surprise_ns = (self.surprise_ns * (1.0 - SURPRISE_FORGOTTEN)).max(surprise_ns);
        ramping.rebase(moved_ns);
        self.ramping = ramping;
        // What wanders off like no crystal does is not on any line, however well it fits.
        if ramping.frequency_ppb.abs() > CRYSTAL_PPB {
            return Fit::Off;
        }
        Fit::Expected
    }
}

/// The whole second nearest to `ns`, in ns.
pub(crate) const fn nearest_second(ns: i64) -> i64 {
    let up = ns.saturating_add(SECOND_NS / 2);
    // Without a 64-bit division where they are few.
    if up >= 0 && up < SECOND_NS {
        0
    } else if up >= SECOND_NS && up < 2 * SECOND_NS {
        SECOND_NS
    } else {
        up.saturating_sub(up.rem_euclid(SECOND_NS))
    }
}
