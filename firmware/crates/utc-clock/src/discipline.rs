//! The discipline: what marks and pulses prove about the clock.
//!
//! *Purpose.* Between the estimators and the clock: which second, where in the second, how fast,
//! each by its own evidence, and how far off each may be.
//!
//! *Design.* See the crate's documentation for the table of detectors.
//!
//! *Which second* is [`Second`]'s. *Where in the second* is known from the [pulse](crate::train) that
//! is proved, else by the crystal as the last one left it, as long as that is better than the
//! messages, else by the [floor](crate::envelope) of the messages. Marks number a pulse and never
//! outvote it: when their floor moves under it, or under a crystal that knows better, what is
//! learnt anew is the latency. *How fast* is the pulse's frequency while one is followed, for the
//! messages' line as well.
//!
//! All of it counts in a time scale of its own that no leap second disturbs: UTC and `shift_ns`.
//!
//! *Limits.* Without a pulse a receiver that drifts within a crystal's means is followed.

mod course;
mod followed;
mod pulse;
mod waits;

use timebase::{CORE_HZ, Cycles, LeapSeconds, PulseForecast};

pub use course::{Correction, Course, Observation};
use followed::Followed;
use waits::{PROMPT_US, Waits};

use crate::crystal_watch::CrystalWatch;
use crate::drift_guard::DriftGuard;
use crate::envelope::{Envelope, EnvelopeEstimate, EnvelopeVerdict};
use crate::holdover::{self, CRYSTAL_PPB, Uncertainty, rate};
use crate::refusal::Refusal;
use crate::second::{Judged, SECOND_NS, Second};
use crate::settings::{LEARNT_UNCERTAINTY_NS, Settings};
use crate::train::Trains;
use crate::utc::{Ppb, UtcNanos};

/// One that waited longer than this does not even number a pulse. \[µs\]
const NUMBERS_US: u32 = 300_000;

/// Where every mark has, and nothing better is known, it may have waited for so long and still name
/// its second. \[µs\]
const SETS_US: u32 = 450_000;

/// The receiver's own accuracy must be so good for its pulse to be proved. \[ns\]
const PROOF_T_ACC_NS: u32 = 1_000;

/// A floor is no farther off than jitter is wide: 91 ms were measured (LEA-M8T at 9600 baud). \[ns\]
const MOST_JITTER_NS: f32 = 91e6;

/// A set clock that may be farther off than this does not know its second any more. \[ns\]
const NUMBERED_NS: f32 = 450e6;

/// Latencies that a receiver can have where none is known: a pulse is numbered so that the
/// messages are late by this. None measured was longer than 185 ms. \[ns\]
const LATENCIES_NS: core::ops::RangeInclusive<i64> = -100_000_000..=500_000_000;
/// A frequency that is learnt in minutes lags behind a crystal that drifts by 1 ppm a minute:
/// two minutes' worth. \[ppb\]
const LAG_PPB: f32 = 2_000.0;

/// Each mark's part in the latency that is learnt: 13 s at 5 Hz.
const LEARNING: i64 = 64;

/// An error is absorbed in so many ms, as far as the bound of the slew allows.
const ABSORB_MS: u32 = 1_000;

/// One mark is believed for no longer than marks may stay away. \[cycles\] 2 s
const LONGEST_SLEW: u64 = 2 * CORE_HZ as u64;

// The estimators, with all that they remember: no more than a small board can spare.
const _: () = assert!(size_of::<Discipline>() <= 6 * 1_024);

/// The estimators, and who is believed.
#[derive(Clone, Debug)]
pub struct Discipline {
    second: Second,
    envelope: Envelope,
    trains: Trains,
    drift_guard: DriftGuard,
    crystal_watch: CrystalWatch,
    followed: Option<Followed>,
    /// The discipline's scale less UTC. \[ns\]
    shift_ns: i64,
    is_set: bool,
    /// The clock has followed a line that was not fresh.
    has_settled: bool,
    latency_ns: i64,
    latency_uncertainty_ns: u32,
    /// The least latency that may be corrected, and how far it may be off, as they were set. \[ns\]
    base_latency_ns: i64,
    base_uncertainty_ns: u32,
    is_latency_learnt: bool,
    pulse_uncertainty_ns: u32,
    hidden_turn_ns: u32,
    /// The last mark was refused because the receiver drifts.
    is_adrift: bool,
    crystal_ppb: f32,
    crystal_uncertainty_ppb: f32,
    waits: Waits,
}

impl Discipline {
    /// A discipline that has observed nothing.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let crystal_ppb = holdover::crystal_ppb(settings.frequency);
        let uncertainty_ppb = settings.frequency_uncertainty.0 as f32;
        Self {
            second: Second::new(settings.leap_seconds),
            // The settings' uncertainty is a bound, the filter's a standard deviation.
            envelope: Envelope::new(crystal_ppb, uncertainty_ppb / 2.0),
            trains: Trains::new(),
            drift_guard: DriftGuard::new(),
            crystal_watch: CrystalWatch::new(),
            followed: None,
            shift_ns: 0,
            is_set: false,
            has_settled: false,
            latency_ns: settings.latency_ns.into(),
            latency_uncertainty_ns: settings.latency_uncertainty_ns,
            base_latency_ns: settings.latency_ns.into(),
            base_uncertainty_ns: settings.latency_uncertainty_ns,
            is_latency_learnt: false,
            pulse_uncertainty_ns: settings.pulse_uncertainty_ns,
            hidden_turn_ns: settings.hidden_turn_ns,
            is_adrift: false,
            crystal_ppb,
            crystal_uncertainty_ppb: uncertainty_ppb,
            waits: Waits::new(),
        }
    }

    /// The receiver's latency as it is corrected, in ns.
    #[must_use]
    pub const fn latency_ns(&self) -> i64 {
        self.latency_ns
    }

    /// What is known of the second's number.
    pub(crate) const fn second(&self) -> &Second {
        &self.second
    }

    /// The same, mutable.
    pub(crate) const fn second_mut(&mut self) -> &mut Second {
        &mut self.second
    }

    /// The announced leap second is over: what has to be added to the clock, in ns.
    pub(crate) fn take_leap_event(&mut self) -> Option<i64> {
        let by_ns = self.second.take_event()?.saturating_mul(SECOND_NS);
        self.shift_ns = self.shift_ns.saturating_sub(by_ns);
        Some(by_ns)
    }

    /// The frequency to run on with while nothing is observed: the average of the whole lock where the
    /// crystal has been steady. `None` when there is no better one than the last.
    #[must_use]
    pub fn steady_frequency(&self) -> Option<Ppb> {
        if self.followed.is_some() {
            return None;
        }
        self.drift_guard
            .steady_ppb(self.crystal_ppb, self.crystal_uncertainty_ppb)
            .map(rate)
    }

    /// Takes an answer to NAV-TIMELS.
    pub(crate) fn handle_leap_seconds(&mut self, received: &LeapSeconds, utc: Option<UtcNanos>) {
        self.second.handle_leap_seconds(received, utc);
    }

    /// The receiver has acknowledged a pulse of that width, or has not. \[µs\]
    pub(crate) fn handle_pulse_width(&mut self, width_us: Option<u32>) {
        self.trains.handle_width(width_us);
    }

    /// Takes what the receiver says about its next pulse; whether its qErr is nonsense.
    pub(crate) fn handle_forecast(&mut self, forecast: &PulseForecast) -> bool {
        self.trains.handle_forecast(forecast)
    }

    /// Takes the epoch of a mark. The first one sets the clock: it is [`Correction::First`].
    ///
    /// # Errors
    /// Why it is to be ignored.
    #[inline(never)] // The bench counts its calls.
    pub fn handle_mark(
        &mut self,
        observed: &Observation,
        epoch: UtcNanos,
        t_acc_ns: u32,
        busy_us: u32,
    ) -> Result<Correction, Refusal> {
        if t_acc_ns > PROOF_T_ACC_NS {
            self.trains.distrust();
        }
        let teaches = self
            .waits
            .may_teach(observed, busy_us, self.message_uncertainty_ns());
        if busy_us > NUMBERS_US && !(teaches && busy_us <= SETS_US) {
            return Err(Refusal::Waited);
        }
        let local_ns = observed.at.as_nanos();
        let moved = self.judge_second(observed, epoch, local_ns, busy_us)?;
        if !teaches {
            return moved.map_or(Err(Refusal::Waited), |by_ns| {
                Ok(Correction::Renumber(by_ns))
            });
        }
        if busy_us <= PROMPT_US && self.waits.floor_us > 0 {
            self.waits.floor_us = 0;
            self.envelope.forget();
        } else if busy_us > PROMPT_US {
            if self.waits.floor_us == 0 {
                self.envelope.forget();
            }
            self.waits.floor_us = self.waits.floor_us.max(busy_us);
        }
        let pulse = self.pulse_at(local_ns);
        if let Some((_, uncertainty_ns)) = pulse
            && uncertainty_ns < LEARNT_UNCERTAINTY_NS as f32
        {
            self.envelope
                .believe(observed.at.as_micros(), self.crystal_ppb);
        }
        let correction = self.follow_mark(observed, epoch, local_ns, pulse, t_acc_ns);
        match (moved, correction) {
            (Some(_), Ok(Correction::Follow(course))) => Ok(Correction::Step(course)),
            (Some(by_ns), Ok(Correction::Nothing) | Err(_)) => Ok(Correction::Renumber(by_ns)),
            (_, other) => other,
        }
    }

    /// Which second a mark names; by how much the clock's changes for it, in ns.
    fn judge_second(
        &mut self,
        observed: &Observation,
        epoch: UtcNanos,
        local_ns: u64,
        busy_us: u32,
    ) -> Result<Option<i64>, Refusal> {
        let Some(uncertainty_ns) = observed.uncertainty_ns else {
            return Ok(None);
        };
        if uncertainty_ns > NUMBERED_NS {
            self.second.open();
            self.envelope.forget();
        }
        let residual_ns = epoch
            .0
            .saturating_add(self.latency_ns)
            .saturating_sub(observed.published.0);
        let is_pulse_followed = self.is_on_pulse(local_ns);
        let is_prompt = busy_us <= PROMPT_US;
        match self
            .second
            .judge(residual_ns, observed.at, is_prompt, is_pulse_followed)
        {
            Judged::Same => Ok(None),
            Judged::Refused => Err(Refusal::Outlier),
            Judged::Moved(by_s) => {
                let by_ns = by_s.saturating_mul(SECOND_NS);
                self.shift_ns = self.shift_ns.saturating_sub(by_ns);
                Ok(Some(by_ns))
            }
        }
    }

    fn follow_mark(
        &mut self,
        observed: &Observation,
        epoch: UtcNanos,
        local_ns: u64,
        pulse: Option<(i64, f32)>,
        t_acc_ns: u32,
    ) -> Result<Correction, Refusal> {
        let epoch_ns = epoch.0.saturating_add(self.shift_ns);
        let lateness_ns = local_ns.cast_signed().wrapping_sub(epoch_ns) as u32;
        let is_better_known = pulse.is_some_and(|(_, ns)| ns < LEARNT_UNCERTAINTY_NS as f32);
        if is_better_known {
            self.crystal_watch = CrystalWatch::new();
        } else if self
            .crystal_watch
            .push(observed.at.as_micros() as u32, lateness_ns)
        {
            self.trains.believe_crystal(local_ns);
        }
        if self.is_crystal_beyond() {
            self.forget_crystal();
            return Err(Refusal::Crystal);
        }
        let observed_floor =
            self.envelope
                .update(observed.at.as_micros(), lateness_ns, is_better_known);
        let (floor, has_moved) = match observed_floor {
            EnvelopeVerdict::Estimate(floor) => (floor, false),
            EnvelopeVerdict::Moved(floor) => (floor, true),
            EnvelopeVerdict::Late => return Err(Refusal::Late),
            EnvelopeVerdict::Early => return Err(Refusal::Early),
        };
        let floor_ns = epoch_ns.saturating_add(i64::from(floor.excess_ns));
        if has_moved {
            self.drift_guard = DriftGuard::new();
            self.is_adrift = false;
        } else if !self.is_followed_by_crystal(
            local_ns,
            floor_ns,
            &floor,
            observed,
            is_better_known,
        ) {
            return Err(Refusal::Drift);
        }
        match pulse {
            Some((pulse_ns, _)) if is_better_known => {
                self.learn_latency(pulse_ns.saturating_sub(floor_ns), has_moved);
            }
            _ if has_moved => {
                let shown_ns = observed.published.0.saturating_add(self.shift_ns);
                self.move_latency(shown_ns.saturating_sub(floor_ns), &floor);
            }
            _ => {}
        }
        let uncertainty_ns = floor.uncertainty_ns.min(MOST_JITTER_NS)
            + t_acc_ns as f32
            + self.waits.floor_us as f32 * 1e3;
        if let Some((_, pulse_uncertainty_ns)) = pulse
            && pulse_uncertainty_ns <= uncertainty_ns + self.latency_uncertainty_ns as f32
        {
            return Ok(Correction::Nothing);
        }
        if floor.is_fresh
            && self.has_settled
            && observed
                .uncertainty_ns
                .is_some_and(|ns| ns < uncertainty_ns + self.latency_uncertainty_ns as f32)
        {
            // The crystal knows better than a line of a few marks.
            return Ok(Correction::Nothing);
        }
        self.has_settled |= !floor.is_fresh;
        self.followed = None;
        self.crystal_ppb = floor.crystal_ppb;
        self.crystal_uncertainty_ppb =
            (2.0 * floor.frequency_uncertainty_ppb + LAG_PPB).min(CRYSTAL_PPB);
        let error_ns = floor_ns
            .saturating_add(self.latency_ns)
            .saturating_sub(self.shift_ns)
            .saturating_sub(observed.published.0);
        let course = self.course(observed.at, error_ns, uncertainty_ns);
        Ok(if core::mem::replace(&mut self.is_set, true) {
            Correction::Follow(course)
        } else {
            Correction::First(course)
        })
    }

    /// Whether the crystal is farther off than all uncertainties allow for: the clock has to be unset.
    pub(crate) const fn is_crystal_beyond(&self) -> bool {
        self.crystal_watch.is_beyond() || self.trains.is_crystal_beyond()
    }

    /// Nothing that was learnt by such a crystal is true; of the second, the leap count is.
    fn forget_crystal(&mut self) {
        self.second.open();
        self.envelope.forget_crystal();
        self.drift_guard = DriftGuard::new();
        self.is_adrift = false;
        self.followed = None;
        self.is_set = false;
        self.has_settled = false;
        self.is_latency_learnt = false;
        self.latency_ns = self.base_latency_ns;
        self.latency_uncertainty_ns = self.base_uncertainty_ns;
        self.crystal_ppb = 0.0;
        self.crystal_uncertainty_ppb = CRYSTAL_PPB;
    }

    /// Whether the floor goes as a crystal does.
    fn is_followed_by_crystal(
        &mut self,
        local_ns: u64,
        floor_ns: i64,
        floor: &EnvelopeEstimate,
        observed: &Observation,
        is_better_known: bool,
    ) -> bool {
        let was_adrift = self.is_adrift;
        self.is_adrift = !self.drift_guard.reaches(local_ns, floor_ns, floor) && !is_better_known;
        if self.is_adrift {
            if !was_adrift {
                // What it remembers of the way here would pass for a crystal's drift.
                self.envelope.forget();
            }
            self.envelope
                .believe(observed.at.as_micros(), self.crystal_ppb);
        }
        !self.is_adrift
    }

    fn learn_latency(&mut self, latency_ns: i64, is_moved: bool) {
        if !LATENCIES_NS.contains(&latency_ns) {
            return;
        }
        if is_moved || !self.is_latency_learnt {
            self.latency_ns = latency_ns;
        } else {
            self.latency_ns += latency_ns.saturating_sub(self.latency_ns) / LEARNING;
        }
        self.is_latency_learnt = true;
        self.latency_uncertainty_ns = LEARNT_UNCERTAINTY_NS;
    }

    /// The floor has moved, and nothing but the crystal knows better: it is the latency that has
    /// changed, to this by the clock.
    fn move_latency(&mut self, latency_ns: i64, floor: &EnvelopeEstimate) {
        self.latency_ns = if self.is_latency_learnt {
            self.latency_uncertainty_ns = self
                .latency_uncertainty_ns
                .saturating_add((floor.frequency_uncertainty_ppb * 240.0) as u32);
            latency_ns
        } else {
            // Lateness is one-sided: what comes earlier than ever is nearer to the truth.
            latency_ns.max(self.base_latency_ns)
        };
    }

    /// How far the messages' word may be off at least. \[ns\]
    fn message_uncertainty_ns(&self) -> f32 {
        self.latency_uncertainty_ns as f32
    }

    /// UTC by the pulse's line in the discipline's scale, with how far it may be off; both in ns.
    fn pulse_at(&self, local_ns: u64) -> Option<(i64, f32)> {
        Some(self.followed.as_ref()?.utc_at(local_ns))
    }

    fn is_on_pulse(&self, local_ns: u64) -> bool {
        self.followed
            .as_ref()
            .is_some_and(|followed| followed.is_lasting(local_ns))
    }

    /// A course as the messages have it.
    fn course(&self, at: Cycles, error_ns: i64, uncertainty_ns: f32) -> Course {
        Course {
            error_ns,
            frequency: rate(self.crystal_ppb),
            uncertainty: Uncertainty {
                at,
                phase_ns: uncertainty_ns,
                frequency_ppb: self.crystal_uncertainty_ppb,
            },
            latency_uncertainty_ns: self.latency_uncertainty_ns,
            turned_ppb: 0.0,
            absorb_ms: ABSORB_MS,
            longest_slew: LONGEST_SLEW,
        }
    }
}
