//! Trains of pulses: which of them is *the* pulse.
//!
//! *Purpose.* An edge on a pin says nothing of itself. It may be a camera's, another module's, the
//! other edge of an inverted pulse, one of ten a second. This keeps the trains of those that look
//! like ours side by side, and says which one is proved.
//!
//! *Design.* A pulse is a rise and its fall, as wide as the receiver was configured to make it;
//! others are only counted. A pulse belongs to the train whose [`PulseTrack`] expects it. A train
//! is proved by [`PROOF`] pulses on end, each announced by a TIM-TP that knows UTC and names a
//! whole second, with no other train of that shape at the same time and an accurate receiver. It
//! stays so until the receiver itself says otherwise, or falls silent.
//!
//! Week, hour and base of TIM-TP are not needed for a phase, so that a receiver on GPS time or a
//! week off spoils nothing.
//!
//! *Limits.* A train of the right width and rhythm at a wrong phase that the receiver's words
//! fit cannot be distinguished from the pulse, if nothing was followed before it.

use timebase::{CORE_HZ, Cycles, Polarity, PulseEdge, PulseForecast};

use crate::holdover::CRYSTAL_PPB;
use crate::refusal::PulseRefusal;
use crate::second::SECOND_NS;
use crate::track::{Fit, PulseTrack};

/// So many trains are kept.
const TRAINS: usize = 6;

/// A pulse may be wider or narrower than configured by so much. \[cycles\] 2 ms
const WIDTH_OFF: u64 = 2 * (CORE_HZ as u64 / 1_000);

/// So many pulses on end prove a train.
pub(crate) const PROOF: u8 = 8;

/// A TIM-TP is about the next pulse, and so not older than this. \[cycles\] 1.3 s
const FORECAST_LASTS: u64 = CORE_HZ as u64 / 10 * 13;
/// A train that is proved stays so without TIM-TP for so long: a queue may hold it up. \[cycles\] 10 s
const SILENCE_LASTS: u64 = 10 * CORE_HZ as u64;
/// Another train was there so lately. \[s\]
const ALONE_S: f32 = 5.0;
/// A train without a pulse for so long is over. \[ns\] 10 s
const OVER_NS: i64 = 10 * SECOND_NS;

/// TIM-TP that waited longer than so is about another pulse. \[µs\]
const WAITED_US: u32 = 300_000;
/// No tick of a u-blox receiver is longer: M8 21 ns, F9T 8 ns. \[ps\]
const MOST_LATE_PS: i32 = 50_000;

/// A pulse that is farther from a second after the one before is none of any crystal. \[ns\]
const STRANGE_NS: i64 = 2_000_000;
/// Without one for so long the messages know better. \[ns\] 60 s
const STRANGE_LASTS_NS: u64 = 60 * SECOND_NS as u64;
/// So far apart are two such seconds that are one crystal's. \[ns\]
const SAME_STRANGE_NS: i64 = 2_000;

/// So many on end that are beside the track begin a new one.
const MISFITS: u8 = 3;

/// A pulse of the right width.
#[derive(Clone, Copy, Debug)]
struct Train {
    track: PulseTrack,
    /// Of the first pulse. \[ns\]
    since_ns: u64,
    pulses: u8,
    proof: u8,
    misfits: u8,
}

/// A rise whose fall has not come yet. By then the receiver may speak of the next pulse.
#[derive(Clone, Copy, Debug)]
struct Rise {
    at: Cycles,
    late_ns: i32,
    is_vouched: bool,
}

/// Pulses that the receiver vouches for, a second apart by a crystal that is beyond its promise.
#[derive(Clone, Copy, Debug, Default)]
struct Strange {
    edge_ns: u64,
    /// From the last one but one to the last one, less a second. \[ns\]
    apart_ns: i64,
    /// So many seconds on end were as long.
    seconds: u8,
}

/// What became of an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EdgeVerdict {
    /// It is a part of a pulse, or the first of a train.
    Noted,
    /// A pulse of a train that is proved, with the begin of that. \[ns\]
    Proved {
        /// Which train; its [`Trains::track`] has this pulse in it.
        train: u8,
        /// Its first pulse, by the board's counter. \[ns\]
        since_ns: u64,
        /// When it rose, by the same in cycles and in ns.
        rise: Cycles,
        rise_ns: u64,
    },
    /// It is none to follow.
    Refused(PulseRefusal),
}

/// What is known of the crystal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrystalKnown {
    /// By how much it is fast. \[ppb\]
    pub(crate) crystal_ppb: f32,
    /// How far that may be off. \[ppb\]
    pub(crate) uncertainty_ppb: f32,
}

/// The trains on the wire.
#[derive(Clone, Debug)]
pub(crate) struct Trains {
    trains: [Option<Train>; TRAINS],
    /// The width that the receiver was asked for and has acknowledged. \[cycles\]
    width: Option<u64>,
    rise: Option<Rise>,
    forecast: Option<PulseForecast>,
    /// When a TIM-TP last spoke for the pulse.
    vouched_at: Option<Cycles>,
    strange: Strange,
}

impl Trains {
    /// No trains.
    pub(crate) const fn new() -> Self {
        Self {
            trains: [None; TRAINS],
            width: None,
            rise: None,
            forecast: None,
            vouched_at: None,
            strange: Strange {
                edge_ns: 0,
                apart_ns: 0,
                seconds: 0,
            },
        }
    }

    /// Whether the pulses say that the crystal is beyond its promise.
    pub(crate) const fn is_crystal_beyond(&self) -> bool {
        self.strange.seconds >= PROOF
    }

    /// By the messages it is not, which counts where no pulse has said so for long.
    pub(crate) const fn believe_crystal(&mut self, local_ns: u64) {
        if local_ns.wrapping_sub(self.strange.edge_ns) > STRANGE_LASTS_NS {
            self.strange.seconds = 0;
        }
    }

    /// Looks at a pulse that is on no crystal's track.
    fn note_strange(&mut self, edge_ns: u64, is_vouched: bool) {
        let since_ns = edge_ns.wrapping_sub(self.strange.edge_ns).cast_signed();
        let apart_ns = since_ns.saturating_sub(SECOND_NS);
        let is_beyond = (CRYSTAL_PPB as i64..STRANGE_NS).contains(&apart_ns.saturating_abs());
        let is_same = apart_ns
            .saturating_sub(self.strange.apart_ns)
            .saturating_abs();
        let seconds = if is_vouched && is_beyond && is_same < SAME_STRANGE_NS {
            self.strange.seconds.saturating_add(1)
        } else {
            0
        };
        self.strange = Strange {
            edge_ns,
            apart_ns,
            seconds,
        };
    }

    /// The receiver has acknowledged a pulse of that width, or its pulse is nobody's. \[µs\]
    pub(crate) fn handle_width(&mut self, width_us: Option<u32>) {
        let width = width_us.map(|us| Cycles::from_micros(us.into()).0);
        if width != self.width {
            self.width = width;
            self.trains = [None; TRAINS];
        }
    }

    /// Nothing is proved any more.
    pub(crate) fn distrust(&mut self) {
        for train in self.trains.iter_mut().flatten() {
            train.proof = 0;
        }
    }

    /// Takes what the receiver says about its next pulse; whether its qErr is nonsense.
    pub(crate) fn handle_forecast(&mut self, forecast: &PulseForecast) -> bool {
        let speaks_for_it = forecast.is_utc_available && forecast.tow_ms.is_multiple_of(1_000);
        if speaks_for_it {
            self.vouched_at = Some(forecast.arrival);
        } else {
            self.vouched_at = None;
            self.distrust();
        }
        self.forecast = Some(*forecast);
        forecast
            .late_ps
            .is_some_and(|ps| ps.unsigned_abs() > MOST_LATE_PS.unsigned_abs())
    }

    /// Takes an edge; `crystal` is what is known of it, for a train that begins.
    pub(crate) fn handle_edge(
        &mut self,
        edge: &PulseEdge,
        crystal: impl Fn() -> CrystalKnown,
    ) -> EdgeVerdict {
        if edge.polarity == Polarity::Rise {
            let is_bounce = self
                .rise
                .is_some_and(|rise| edge.at.0.wrapping_sub(rise.at.0) < WIDTH_OFF);
            if is_bounce {
                return EdgeVerdict::Noted;
            }
            self.rise = Some(Rise {
                at: edge.at,
                late_ns: self.late_ns(edge.at),
                is_vouched: self.vouched_at.is_some_and(|at| {
                    (0..=FORECAST_LASTS.cast_signed()).contains(&edge.at.since(at))
                }),
            });
            return EdgeVerdict::Noted;
        }
        let Some(width) = self.width else {
            return EdgeVerdict::Refused(PulseRefusal::Width);
        };
        let Some(rise) = self.rise else {
            return EdgeVerdict::Refused(PulseRefusal::Width);
        };
        let high = edge.at.0.wrapping_sub(rise.at.0);
        if high < WIDTH_OFF && width > 2 * WIDTH_OFF {
            // A bounce: the rise before it counts.
            return EdgeVerdict::Noted;
        }
        self.rise = None;
        if high.abs_diff(width) > WIDTH_OFF {
            return EdgeVerdict::Refused(PulseRefusal::Width);
        }
        self.handle_pulse(rise, crystal)
    }

    fn handle_pulse(&mut self, rise: Rise, crystal: impl Fn() -> CrystalKnown) -> EdgeVerdict {
        let Rise {
            at: rise,
            late_ns,
            is_vouched,
        } = rise;
        let is_silent = self
            .vouched_at
            .is_none_or(|at| rise.since(at) > SILENCE_LASTS.cast_signed());
        if is_silent {
            self.distrust();
        }
        let rise_ns = rise.as_nanos();
        let edge_ns = rise_ns.saturating_add_signed(i64::from(-late_ns));
        let Some((index, fit)) = self.find(edge_ns) else {
            self.note_strange(edge_ns, is_vouched);
            self.begin(edge_ns, crystal());
            return EdgeVerdict::Noted;
        };
        let Some(train) = self.trains.get_mut(index).and_then(Option::as_mut) else {
            return EdgeVerdict::Noted;
        };
        match fit {
            Fit::Expected => {}
            Fit::Beside => {
                train.misfits += 1;
                if train.misfits >= MISFITS {
                    *train = Train::new(edge_ns, crystal());
                }
                return EdgeVerdict::Refused(PulseRefusal::OffLine);
            }
            Fit::Off => return EdgeVerdict::Refused(PulseRefusal::OffLine),
            Fit::Doubled => return EdgeVerdict::Refused(PulseRefusal::Doubled),
        }
        train.misfits = 0;
        train.pulses = train.pulses.saturating_add(1);
        let since_ns = train.since_ns;
        let is_proved = train.proof >= PROOF || self.prove(index, edge_ns, is_vouched);
        if !is_proved || !is_vouched {
            return EdgeVerdict::Refused(PulseRefusal::Unproved);
        }
        self.strange.seconds = 0;
        EdgeVerdict::Proved {
            train: index as u8,
            since_ns,
            rise,
            rise_ns,
        }
    }

    /// A pulse more proves a train, if the receiver vouches for it and no other train is there; else
    /// its proof begins anew. Whether it is proved now.
    fn prove(&mut self, index: usize, edge_ns: u64, is_vouched: bool) -> bool {
        let is_alone = !self.trains.iter().enumerate().any(|(other, train)| {
            other != index
                && train
                    .as_ref()
                    .is_some_and(|train| train.track.since_s(edge_ns) < ALONE_S)
        });
        let Some(train) = self.trains.get_mut(index).and_then(Option::as_mut) else {
            return false;
        };
        train.proof = if is_vouched && is_alone {
            train.proof + 1
        } else {
            0
        };
        train.proof >= PROOF
    }

    /// The track of a train.
    pub(crate) fn track(&self, train: u8) -> Option<&PulseTrack> {
        let train = self.trains.get(usize::from(train))?.as_ref()?;
        Some(&train.track)
    }

    /// The train that a pulse belongs to, and where it is beside its track, which has taken it in.
    fn find(&mut self, edge_ns: u64) -> Option<(usize, Fit)> {
        for (index, place) in self.trains.iter_mut().enumerate() {
            let Some(train) = place else { continue };
            let since_ns = edge_ns.wrapping_sub(train.track.edge_ns()).cast_signed();
            if since_ns > OVER_NS {
                *place = None;
                continue;
            }
            let fit = train.track.update(edge_ns);
            if fit != Fit::Off {
                return Some((index, fit));
            }
        }
        None
    }

    fn begin(&mut self, edge_ns: u64, crystal: CrystalKnown) {
        // In a free place, or the one of the train that has been silent the longest.
        let place = self.trains.iter_mut().max_by_key(|place| {
            place.as_ref().map_or(u64::MAX, |train| {
                edge_ns.wrapping_sub(train.track.edge_ns())
            })
        });
        if let Some(place) = place {
            *place = Some(Train::new(edge_ns, crystal));
        }
    }

    /// By how much the receiver says that this pulse is late. \[ns\]
    fn late_ns(&mut self, rise: Cycles) -> i32 {
        let Some(forecast) = self.forecast.take() else {
            return 0;
        };
        let after = rise.since(forecast.arrival);
        let is_about_it = (0..=CORE_HZ.into()).contains(&after) && forecast.busy_us <= WAITED_US;
        match forecast.late_ps {
            Some(late_ps)
                if is_about_it && late_ps.unsigned_abs() <= MOST_LATE_PS.unsigned_abs() =>
            {
                // Rounded to the nearest: by a reciprocal of 2⁻³² steps.
                ((i64::from(late_ps) * ((1 << 32) / 1_000) + (1 << 31)) >> 32) as i32
            }
            _ => 0,
        }
    }
}

impl Train {
    const fn new(edge_ns: u64, crystal: CrystalKnown) -> Self {
        Self {
            track: PulseTrack::new(edge_ns, crystal.crystal_ppb, crystal.uncertainty_ppb),
            since_ns: edge_ns,
            pulses: 1,
            proof: 0,
            misfits: 0,
        }
    }
}
