//! The discipline: what marks and pulses say about the clock's error.
//!
//! *Purpose.* Between the two estimators and the clock: which of them is to be believed,
//! and whether a mark may be heard at all.
//!
//! *Design.* The [envelope](crate::envelope) of the messages and the [pulse](crate::pulse) are
//! followed side by side, both on the board's own counter. Whichever has the smaller uncertainty steers.
//! Under a pulse the messages are not idle: they confirm it, and the latency between the two is
//! learnt. When the pulse is lost the clock runs on with what it taught, until its uncertainty has grown
//! beyond the messages'; so nothing jumps, neither then nor when it comes back.
//!
//! A mark that is farther from the clock than [`OUTLIER_NS`] is a stall, a backlog or a jump:
//! it is refused, until [`AGREEING`] of them in a row say the same to within
//! [`AGREEMENT_NS`]; then the clock is wrong and has to step. Of those the least late, the
//! largest, tells by how much.
//!
//! A receiver whose time drifts away is told from a crystal by what crystals can do: an
//! `DriftGuard` follows the floor and its frequency slowly, and what leaves its reach is refused.
//!
//! *Limits.* Without a pulse a receiver that drifts within a crystal's means is followed.

use timebase::Cycles;

use crate::drift_guard::DriftGuard;
use crate::envelope::{Envelope, EnvelopeEstimate, EnvelopeVerdict};
use crate::holdover::{self, CRYSTAL_PPB, Uncertainty};
use crate::pulse::{NumberedEdge, Pulse, PulseVerdict, nearest_second};
use crate::refusal::{PulseRefusal, Refusal};
use crate::settings::{LEARNT_UNCERTAINTY_NS, Settings};
use crate::utc::{Ppb, UtcNanos};

/// A residual beyond this is an outlier: more than any latency measured on a
/// receiver that was not stalled (185 ms), less than the second that jumps.
pub const OUTLIER_NS: i64 = 500_000_000;

/// So many outliers in a row have to agree before the clock steps: a second of
/// a 5 Hz receiver. A backlog that is flushed does not agree with itself.
pub const AGREEING: u8 = 5;

/// How far agreeing outliers may lie apart: the widest spread of latencies
/// measured on one receiver was 91 ms (LEA-M8T at 9600 baud).
pub const AGREEMENT_NS: i64 = 100_000_000;

/// A pulse that would have a learnt latency off by more is off the second: twice its uncertainty, in ns.
const LEARNT_OFF_NS: i64 = 2 * LEARNT_UNCERTAINTY_NS as i64;

/// Latencies that a receiver can have: none is negative, but the messages' floor may not have been
/// found yet; and none measured was longer than 185 ms.
const LATENCIES_NS: (i64, i64) = (-20_000_000, 300_000_000);

/// Floors wander by 10 ms; a pulse that moves farther against the messages than this is not the
/// receiver's.
const CONTRADICTION_NS: i64 = 25_000_000;

/// So many marks in a row have to contradict a pulse.
const CONTRADICTIONS: u8 = 10;

/// A frequency that is learnt in minutes lags behind a crystal that drifts by 1 ppm a minute, in
/// ppb: two minutes' worth.
const LAG_PPB: f32 = 2_000.0;

/// How far the frequency may have moved while a receiver drifted, in ppb.
const AFTER_DRIFT_PPB: f32 = 5_000.0;

/// Each mark's part in the latency that is learnt: 13 s at 5 Hz.
const LEARNING: i64 = 64;

/// Errors are absorbed in so long, in ms, as far as the bound of the slew allows: those of the
/// messages and those of the pulse.
const ABSORB_MS: (u32, u32) = (1_000, 250);

// Both estimators, with all that they remember: no more than a small board can spare.
const _: () = assert!(size_of::<Discipline>() <= 4_096);

/// One mark or pulse beside the clock that it corrects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Observation {
    /// When it arrived.
    pub at: Cycles,
    /// UTC at its arrival as the clock had it.
    pub published: UtcNanos,
}

/// How the clock has to go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// UTC less the clock at the observation, in ns: positive when the clock is behind.
    pub error_ns: i64,
    /// How much faster than the crystal the clock has to run.
    pub frequency: Ppb,
    /// How far off it may be then, the receiver's latency apart.
    pub uncertainty: Uncertainty,
    /// How far the receiver's latency may be from the one that is corrected, in ns.
    pub latency_uncertainty_ns: u32,
    /// In how many ms the error is to be absorbed, if that is not too fast.
    pub absorb_ms: u32,
}

/// What is to be done about an observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Correction {
    /// Go on so.
    Follow(Course),
    /// The same, and the error may be stepped over if it is forward: the first of its kind.
    First(Course),
    /// Step by the error; the clock is wrong beyond uncertainty.
    Step(Course),
    /// Go on as before: the mark confirms a better source, or the pulse waits for others.
    Nothing,
}

/// The estimators, and who is believed.
#[derive(Clone, Debug)]
pub struct Discipline {
    envelope: Envelope,
    pulse: Pulse,
    anchor: DriftGuard,
    latency_ns: i64,
    latency_uncertainty_ns: u32,
    /// The last mark was refused because the receiver drifts.
    is_adrift: bool,
    /// The latency when the pulse began to be followed.
    latency_at_lock_ns: Option<i64>,
    contradictions: u8,
    has_followed_pulse: bool,
    crystal_ppb: f32,
    fast_uncertainty_ppb: f32,
    /// The last mark's floor: the board's ns since boot, and UTC then by the messages.
    told: Option<(u64, i64)>,
    run: Run,
}

/// Outliers in a row that agree.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    length: u8,
    smallest_ns: i64,
    largest_ns: i64,
}

impl Discipline {
    /// A discipline that has heard nothing.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let crystal_ppb = holdover::crystal_ppb(settings.frequency);
        let uncertainty_ppb = settings.frequency_uncertainty.0 as f32;
        Self {
            // The settings' uncertainty is a bound, the filter's a standard deviation.
            envelope: Envelope::new(crystal_ppb, uncertainty_ppb / 2.0),
            pulse: Pulse::new(),
            anchor: DriftGuard::new(),
            latency_ns: settings.latency_ns.into(),
            latency_uncertainty_ns: settings.latency_uncertainty_ns,
            is_adrift: false,
            latency_at_lock_ns: None,
            contradictions: 0,
            has_followed_pulse: false,
            crystal_ppb,
            fast_uncertainty_ppb: uncertainty_ppb,
            told: None,
            run: Run::default(),
        }
    }

    /// The receiver's latency as it is corrected, in ns.
    #[must_use]
    pub const fn latency_ns(&self) -> i64 {
        self.latency_ns
    }

    /// The frequency to run on with while nothing is heard: the average of the whole lock where the
    /// crystal has been steady. `None` when there is no better one than the last.
    #[must_use]
    pub fn steady_frequency(&self) -> Option<Ppb> {
        if self.pulse.is_followed() {
            return None;
        }
        self.anchor
            .steady_ppb(self.crystal_ppb, self.fast_uncertainty_ppb)
            .map(holdover::rate)
    }

    /// Hears the epoch of a mark. The first one sets the clock: it is [`Correction::First`].
    ///
    /// # Errors
    /// Why it is to be ignored.
    #[inline(never)] // The bench counts its calls.
    pub fn handle_mark(
        &mut self,
        heard: &Observation,
        epoch: UtcNanos,
        t_acc_ns: u32,
    ) -> Result<Correction, Refusal> {
        let is_first = self.told.is_none();
        let utc_ns = epoch.0.saturating_add(self.latency_ns);
        let residual_ns = utc_ns.saturating_sub(heard.published.0);
        if !is_first && residual_ns.unsigned_abs() > OUTLIER_NS.unsigned_abs() {
            return self.handle_outlier(heard, epoch, residual_ns, t_acc_ns);
        }
        self.run = Run::default();
        let floor = self.handle_envelope(heard, epoch)?;
        let local_ns = heard.at.as_nanos();
        let floor_utc_ns = epoch.0.saturating_add(i64::from(floor.excess_ns));
        if floor.crystal_ppb > CRYSTAL_PPB || floor.crystal_ppb < -CRYSTAL_PPB {
            return Err(Refusal::Crystal);
        }
        let was_adrift = self.is_adrift;
        self.is_adrift = !self.anchor.reaches(local_ns, floor_utc_ns, &floor);
        if self.is_adrift {
            if !was_adrift {
                // What it remembers of the way here would pass for a crystal's drift.
                self.envelope.forget();
            }
            self.envelope
                .believe(heard.at.as_micros(), self.crystal_ppb);
            return Err(Refusal::Drift);
        }
        self.told = Some((local_ns, floor_utc_ns));
        let uncertainty_ns = floor.uncertainty_ns + t_acc_ns as f32;
        if self.pulse_is_better(local_ns, floor_utc_ns, uncertainty_ns)? {
            return Ok(Correction::Nothing);
        }
        self.crystal_ppb = floor.crystal_ppb;
        self.fast_uncertainty_ppb = 2.0 * floor.frequency_uncertainty_ppb + LAG_PPB;
        let error_ns = floor_utc_ns
            .saturating_add(self.latency_ns)
            .saturating_sub(heard.published.0);
        let course = self.course(heard.at, error_ns, uncertainty_ns, ABSORB_MS.0);
        Ok(if is_first {
            Correction::First(course)
        } else {
            Correction::Follow(course)
        })
    }

    fn handle_envelope(
        &mut self,
        heard: &Observation,
        epoch: UtcNanos,
    ) -> Result<EnvelopeEstimate, Refusal> {
        let local_ns = heard.at.as_nanos();
        let lateness_ns = local_ns.cast_signed().wrapping_sub(epoch.0) as u32;
        match self.envelope.update(heard.at.as_micros(), lateness_ns) {
            EnvelopeVerdict::Estimate(floor) => Ok(floor),
            EnvelopeVerdict::Moved(floor) => {
                self.anchor = DriftGuard::new();
                if !core::mem::take(&mut self.is_adrift) {
                    return Ok(floor);
                }
                // What it learnt from the receiver's drift is not the crystal's frequency.
                let uncertainty_ppb = self.fast_uncertainty_ppb.max(AFTER_DRIFT_PPB);
                self.envelope = Envelope::new(self.crystal_ppb, uncertainty_ppb);
                self.handle_envelope(heard, epoch)
            }
            EnvelopeVerdict::Late => Err(Refusal::Late),
            EnvelopeVerdict::Early => Err(Refusal::Early),
        }
    }

    /// Holds the floor against the pulse: learns the latency between them, or that they
    /// contradict each other. Whether the pulse has the smaller uncertainty.
    fn pulse_is_better(
        &mut self,
        local_ns: u64,
        floor_utc_ns: i64,
        uncertainty_ns: f32,
    ) -> Result<bool, Refusal> {
        let Some((pulse_utc_ns, pulse_uncertainty_ns)) = self.pulse.utc_at(local_ns) else {
            return Ok(false);
        };
        let latency_ns = pulse_utc_ns.saturating_sub(floor_utc_ns);
        if self.is_strange(latency_ns, pulse_uncertainty_ns) {
            if !self.pulse.is_alive(local_ns) {
                // The pulse is gone, but what it taught is good to its uncertainty: the messages drift.
                return Err(Refusal::Drift);
            }
            self.contradictions = self.contradictions.saturating_add(1);
            if self.contradictions >= CONTRADICTIONS {
                self.contradictions = 0;
                self.pulse.forget();
                // What the wrong pulse taught, as far as it was wrong.
                if let Some(then_ns) = self.latency_at_lock_ns {
                    self.latency_ns = then_ns;
                }
                return Ok(false);
            }
        } else {
            self.contradictions = 0;
            self.learn(latency_ns);
        }
        Ok(pulse_uncertainty_ns <= uncertainty_ns + self.latency_uncertainty_ns as f32)
    }

    /// Hears an edge of the pulse, which comes `late_ns` after the second that it stands for, by
    /// the receiver's own word.
    ///
    /// # Errors
    /// Why it is to be ignored.
    pub fn handle_pulse(
        &mut self,
        heard: &Observation,
        late_ns: i32,
    ) -> Result<Correction, PulseRefusal> {
        let at_ns = heard.at.as_nanos().saturating_add_signed((-late_ns).into());
        let Some((told_at_ns, floor_utc_ns)) = self.told else {
            return Err(PulseRefusal::Unnumbered);
        };
        let since_ns = at_ns.wrapping_sub(told_at_ns).cast_signed();
        // An hour at 50 ppm is less than a second off: by then only the clock may number it.
        let rise_ns = (self.crystal_ppb * (since_ns as f32 * 1e-9)) as i64;
        let told_ns = floor_utc_ns
            .saturating_add(since_ns)
            .saturating_sub(rise_ns)
            .saturating_add(self.latency_ns);
        // A latency that somebody has set may be another receiver's; one that was learnt is ours.
        let plausible_ns = if self.latency_at_lock_ns.is_some() {
            (-LEARNT_OFF_NS, LEARNT_OFF_NS)
        } else {
            (
                LATENCIES_NS.0 - self.latency_ns,
                LATENCIES_NS.1 - self.latency_ns,
            )
        };
        let edge = NumberedEdge {
            at_ns,
            told_ns,
            plausible_ns,
        };
        match self
            .pulse
            .update(&edge, self.crystal_ppb, self.fast_uncertainty_ppb)
        {
            PulseVerdict::Candidate => Ok(Correction::Nothing),
            PulseVerdict::Refused(refusal) => Err(refusal),
            PulseVerdict::Followed(line) => {
                self.crystal_ppb = line.crystal_ppb;
                self.fast_uncertainty_ppb = line.frequency_uncertainty_ppb;
                let error_ns = line
                    .utc_ns
                    .saturating_add(late_ns.into())
                    .saturating_sub(heard.published.0);
                let course = Course {
                    latency_uncertainty_ns: 0,
                    ..self.course(heard.at, error_ns, line.uncertainty_ns, ABSORB_MS.1)
                };
                Ok(if core::mem::replace(&mut self.has_followed_pulse, true) {
                    Correction::Follow(course)
                } else {
                    Correction::First(course)
                })
            }
        }
    }

    fn course(&self, at: Cycles, error_ns: i64, uncertainty_ns: f32, absorb_ms: u32) -> Course {
        Course {
            error_ns,
            frequency: holdover::rate(self.crystal_ppb),
            uncertainty: Uncertainty {
                at,
                phase_ns: uncertainty_ns,
                frequency_ppb: self.fast_uncertainty_ppb,
            },
            latency_uncertainty_ns: self.latency_uncertainty_ns,
            absorb_ms,
        }
    }

    fn handle_outlier(
        &mut self,
        heard: &Observation,
        epoch: UtcNanos,
        residual_ns: i64,
        t_acc_ns: u32,
    ) -> Result<Correction, Refusal> {
        self.run.add(residual_ns);
        if self.run.length < AGREEING {
            return Err(Refusal::Outlier);
        }
        let Run {
            smallest_ns,
            largest_ns,
            ..
        } = core::mem::take(&mut self.run);
        // Within AGREEMENT_NS of each other, so it fits.
        let spread_ns = largest_ns.wrapping_sub(smallest_ns) as f32;
        self.envelope.forget();
        self.anchor = DriftGuard::new();
        let by_ns = if self.pulse.is_followed() {
            // The pulse has the phase; what has changed is the second's number.
            let by_ns = nearest_second(largest_ns);
            self.pulse.renumber(by_ns);
            by_ns
        } else {
            self.pulse.forget();
            largest_ns
        };
        self.told = None;
        let _ = self.handle_envelope(heard, epoch);
        self.told = Some((heard.at.as_nanos(), epoch.0));
        let uncertainty_ns = spread_ns + t_acc_ns as f32;
        let course = self.course(heard.at, by_ns, uncertainty_ns, ABSORB_MS.0);
        Ok(Correction::Step(course))
    }

    /// Whether a latency is none that this receiver, or any, can have.
    fn is_strange(&self, latency_ns: i64, uncertainty_ns: f32) -> bool {
        match self.latency_at_lock_ns {
            Some(then_ns) => {
                let most_ns = CONTRADICTION_NS.saturating_add(uncertainty_ns as i64);
                latency_ns.abs_diff(then_ns) > most_ns.unsigned_abs()
            }
            None => !(LATENCIES_NS.0..=LATENCIES_NS.1).contains(&latency_ns),
        }
    }

    fn learn(&mut self, latency_ns: i64) {
        if self.latency_at_lock_ns.is_none() {
            self.latency_at_lock_ns = Some(latency_ns);
            self.latency_ns = latency_ns;
            self.latency_uncertainty_ns = LEARNT_UNCERTAINTY_NS;
        } else {
            self.latency_ns += latency_ns.saturating_sub(self.latency_ns) / LEARNING;
        }
    }
}

impl Run {
    fn add(&mut self, residual_ns: i64) {
        let joined = Self {
            length: self.length.saturating_add(1),
            smallest_ns: self.smallest_ns.min(residual_ns),
            largest_ns: self.largest_ns.max(residual_ns),
        };
        let agrees =
            self.length > 0 && joined.largest_ns.saturating_sub(joined.smallest_ns) <= AGREEMENT_NS;
        *self = if agrees {
            joined
        } else {
            Self {
                length: 1,
                smallest_ns: residual_ns,
                largest_ns: residual_ns,
            }
        };
    }
}
