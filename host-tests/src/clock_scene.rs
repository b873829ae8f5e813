//! A board in the simulated world: its crystal, its receiver, its pulse.
//!
//! *Purpose.* A scenario as data, played from moment to moment.
//!
//! *Design.* [`Arrivals`] and [`Pulses`] of one receiver, merged in the order in which
//! the board's tasks have them; TIM-TP comes half a second before its pulse where the
//! receiver's port says so. What is lost on the way is lost here.
//!
//! *Limits.* The board's tasks are never late.

use std::iter::Peekable;
use std::ops::Range;

use utc_clock::{ClockState, Outcome, Published, PulseOutcome, Settings, UtcNanos};
use world::{Arrivals, CrystalSettings, Latency, Port, Pulses, ReceiverSettings, WorldNanos};

use crate::clock_board::{Board, FRAME_NS, MS, SECOND, START, Sample};

/// A byte at 115200 baud, in ns: a mark is stamped at the first one's end.
const FIRST_BYTE_NS: i64 = 86_806;
/// A TIM-TP comes so long before its pulse, in ns.
const FORECAST_AHEAD_NS: i64 = 500 * MS;
/// Readings stand in no relation to marks and pulses, in ns.
const READ_EVERY_NS: i64 = 37_000_100;

/// What a board lives through.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What its clock was told beforehand.
    pub settings: Settings,
    /// Its crystal.
    pub crystal: CrystalSettings,
    /// Its receiver.
    pub receiver: ReceiverSettings,
    /// Whose time pulse is plugged in, if any; most often the receiver's.
    pub pulse: Option<ReceiverSettings>,
    /// When messages are lost on the way, in ns of the world's time; `i64::MAX` ends one
    /// that is for ever.
    pub deaf: Vec<Range<i64>>,
}

impl Scene {
    /// A receiver with that latency and no pulse; a crystal within ±50 ppm, as chance
    /// has it. The latency is not doubted, so that uncertainties are about floor time.
    #[must_use]
    pub fn new(latency: Latency, seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed);
        Self {
            settings: Settings {
                latency_uncertainty_ns: 0,
                ..Settings::DEFAULT
            },
            crystal: CrystalSettings::new(rng.f64() * 100_000.0 - 50_000.0),
            receiver: ReceiverSettings {
                seed: rng.u64(..),
                latency,
                port: Port::CONFIGURED,
                ..ReceiverSettings::new(START.0)
            },
            pulse: None,
            deaf: Vec::new(),
        }
    }

    /// The same with the pulse of the receiver as it is now plugged in, and a latency that nobody
    /// knows: a pulse tells.
    #[must_use]
    pub fn with_pulse(self) -> Self {
        Self {
            pulse: Some(self.receiver.clone()),
            settings: Settings {
                latency_uncertainty_ns: Settings::DEFAULT.latency_uncertainty_ns,
                ..self.settings
            },
            ..self
        }
    }

    /// By how much floor time is behind UTC, in ns: the least latency, to the end of
    /// the first byte.
    #[must_use]
    pub fn floor_ns(&self) -> i64 {
        self.receiver.latency.least_ns.cast_signed() + FIRST_BYTE_NS
    }

    /// Curtain up.
    #[must_use]
    pub fn play<'a>(&self, line: &'a Published) -> Play<'a> {
        let seed = self.receiver.seed;
        let mut board = Board::with_crystal(self.settings, self.crystal, seed, line);
        board.read_every_ns = READ_EVERY_NS;
        Play {
            board,
            events: events(self).peekable(),
            floor_ns: self.floor_ns(),
            marks: Vec::new(),
            pulses: Vec::new(),
        }
    }
}

/// Something that happens to a board; all in ns of the world's time.
#[derive(Clone, Copy, Debug)]
struct Event {
    happened: i64,
    handled: i64,
    what: What,
}

#[derive(Clone, Copy, Debug)]
enum What {
    Mark { epoch_utc_ns: i64 },
    Pulse,
    Forecast { late_ps: i32 },
}

fn events(scene: &Scene) -> Box<dyn Iterator<Item = Event>> {
    let deaf = scene.deaf.clone();
    let for_ever = deaf.iter().find(|deaf| deaf.end == i64::MAX);
    let end = for_ever.map_or(i64::MAX, |deaf| deaf.start);
    let mut marks = Arrivals::new(&scene.receiver)
        .map(|arrival| Event {
            happened: arrival.first_byte_end.0.cast_signed(),
            handled: arrival.first_byte.0.cast_signed() + FRAME_NS,
            what: What::Mark {
                epoch_utc_ns: arrival.epoch_utc_ns,
            },
        })
        .take_while(move |event| event.happened < end)
        .filter(move |event| !deaf.iter().any(|deaf| deaf.contains(&event.happened)))
        .peekable();
    let Some(pulse) = &scene.pulse else {
        return Box::new(marks);
    };
    let has_forecasts = pulse.port.tim_tp_every > 0;
    let mut pulses = Pulses::new(pulse)
        .flat_map(move |pulse| {
            let edge = pulse.edge.0.cast_signed();
            let told = edge - FORECAST_AHEAD_NS;
            let forecast = (has_forecasts && told >= 0 && pulse.utc_s.is_some()).then_some(Event {
                happened: told,
                handled: told,
                what: What::Forecast {
                    late_ps: pulse.late_ps,
                },
            });
            let pulse = Event {
                happened: edge,
                handled: edge,
                what: What::Pulse,
            };
            forecast.into_iter().chain([pulse])
        })
        .peekable();
    Box::new(std::iter::from_fn(move || {
        let pulse = pulses.peek().map(|event| event.handled);
        let is_first = |mark: &Event| pulse.is_none_or(|pulse| mark.handled <= pulse);
        marks.next_if(is_first).or_else(|| pulses.next())
    }))
}

/// A scene that is being played.
pub struct Play<'a> {
    /// The board.
    pub board: Board<'a>,
    /// What each mark did, and when, in ns.
    pub marks: Vec<(i64, Outcome)>,
    /// What each pulse did, and when, in ns.
    pub pulses: Vec<(i64, PulseOutcome)>,
    floor_ns: i64,
    events: Peekable<Box<dyn Iterator<Item = Event>>>,
}

impl Play<'_> {
    /// Plays on until `world_ns`.
    pub fn until(&mut self, world_ns: i64) {
        while let Some(event) = self.events.next_if(|event| event.handled <= world_ns) {
            self.happen(&event);
        }
        self.board.pass_until(world_ns);
    }

    fn happen(&mut self, event: &Event) {
        match event.what {
            What::Mark { epoch_utc_ns } => {
                let outcome = self
                    .board
                    .handle_arrival(UtcNanos(epoch_utc_ns), event.happened);
                self.marks.push((event.happened, outcome));
            }
            What::Pulse => {
                let outcome = self.board.handle_edge(event.happened);
                self.pulses.push((event.happened, outcome));
            }
            What::Forecast { late_ps } => self.board.handle_forecast(late_ps, event.happened),
        }
    }

    /// Plays on until the next mark has been heard, which comes so much later than it
    /// would, in ns.
    pub fn next_late_by(&mut self, late_ns: i64) {
        if let Some(event) = self.events.next() {
            self.happen(&Event {
                happened: event.happened + late_ns,
                handled: event.handled + late_ns,
                ..event
            });
        }
    }

    /// Plays on for so many s.
    pub fn pass_s(&mut self, seconds: i64) {
        self.until(self.board.now_ns + seconds * SECOND);
    }

    /// The clock's error against floor time now, in ns.
    pub fn floor_error_ns(&mut self) -> i64 {
        self.board.error_ns() + self.floor_ns
    }

    /// The readings from `from_ns` on, with their errors against floor time.
    pub fn since(&self, from_ns: i64) -> impl Iterator<Item = Sample> {
        let first = self.board.samples.partition_point(|s| s.at_ns < from_ns);
        self.board.samples[first..].iter().map(|sample| Sample {
            error_ns: sample.error_ns + self.floor_ns,
            ..*sample
        })
    }

    /// The same with their errors against UTC.
    pub fn utc_since(&self, from_ns: i64) -> impl Iterator<Item = Sample> {
        self.since(from_ns).map(|sample| Sample {
            error_ns: sample.error_ns - self.floor_ns,
            ..sample
        })
    }

    /// How many marks since `from_ns` had an outcome like that.
    pub fn count_marks(&self, from_ns: i64, is: impl Fn(&Outcome) -> bool) -> usize {
        let since = self.marks.iter().filter(|(at, _)| *at >= from_ns);
        since.filter(|(_, outcome)| is(outcome)).count()
    }

    /// How many pulses since `from_ns` had an outcome like that.
    pub fn count_pulses(&self, from_ns: i64, is: impl Fn(&PulseOutcome) -> bool) -> usize {
        let since = self.pulses.iter().filter(|(at, _)| *at >= from_ns);
        since.filter(|(_, outcome)| is(outcome)).count()
    }

    /// The largest error of the frequency in the time that passes until `until_s`, asked
    /// once a second, in ppb.
    pub fn frequency_until_ppb(&mut self, until_s: i64) -> f64 {
        let mut worst = 0.0_f64;
        while self.board.now_ns < until_s * SECOND {
            self.pass_s(1);
            worst = worst.max(self.board.frequency_error_ppb().abs());
        }
        worst
    }

    /// Whether the clock is set.
    pub fn is_set(&mut self) -> bool {
        self.board.read().state == ClockState::Set
    }
}

/// The largest error of a row of readings, in ns; of no reading at all, any.
pub fn worst_ns(samples: impl IntoIterator<Item = Sample>) -> i64 {
    let errors = samples.into_iter().map(|sample| sample.error_ns.abs());
    errors.max().unwrap_or(i64::MAX)
}

/// The share of readings that the uncertainty held, from 0 to 1.
pub fn covered(samples: impl IntoIterator<Item = Sample>) -> f64 {
    let (mut held, mut all) = (0.0, 0.0);
    for sample in samples {
        all += 1.0;
        if sample.error_ns.unsigned_abs() <= u64::from(sample.uncertainty_ns) {
            held += 1.0;
        }
    }
    held / all
}

/// A moment of the world, `seconds` after its start.
#[must_use]
pub const fn at_s(seconds: u64) -> WorldNanos {
    WorldNanos(seconds * SECOND.unsigned_abs())
}

/// What is wrong in any of a row of scenes: all of it is told, not only the first.
#[derive(Debug, Default)]
pub struct Faults(Vec<String>);

impl Faults {
    /// Demands that `holds`, of the scene that is told.
    pub fn unless(&mut self, holds: bool, told: impl std::fmt::Display) {
        if !holds {
            self.0.push(told.to_string());
        }
    }

    /// The end.
    ///
    /// # Panics
    ///
    /// If there was any.
    pub fn none(self) {
        assert!(self.0.is_empty(), "{:#?}", self.0);
    }
}
