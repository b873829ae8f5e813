//! The message's estimator: the lower envelope of arrival − epoch.
//!
//! *Purpose.* A message can be late but never early, so what a receiver's marks
//! have in common is their *least* lateness, the floor. This follows it, with the
//! crystal's frequency: the floor's line is what time it is.
//!
//! *Design.* All of it happens on the board's own counter, which nothing steers, so
//! that no correction ever disturbs what was learnt. A mark is a `trend::Point`.
//!
//! * Bins (`bins`) of 2 s keep the lowest point of theirs, as it was measured. The floor's level
//!   is the lowest of a window of them, each compared along the *current* frequency:
//!   a better frequency makes the past better, too.
//! * The window is as long as the receiver's `edge` is blunt. Its noise is 1/λW, and a
//!   crystal that drifts by d bends the line by ~dW²/8: both are of a size where W³λ is a
//!   constant.
//! * The frequency moves by the slope between the lowest points of the older and of the
//!   newer half, each time as far as its own uncertainty and the slope's say (a scalar
//!   Kalman filter).
//! * While the floor itself wanders (`wander`), the frequency is that of many minutes, and the level
//!   the lowest of as many.
//!
//! The work of a closed bin is spread over the marks that follow (`survey`): none costs more than
//! one look at the bins.
//!
//! *Limits.* A floor that moves by itself for longer than it remembers moves the clock. Marks
//! farther from the line than [`TOO_LATE_NS`] are turned away, since lateness is kept in 32 bits.

mod apart;
mod bins;
mod density;
mod elapsed;
mod survey;
mod teaching;
mod trend;
mod wander;

use apart::{Apart, Standing};
use bins::Bins;
use density::ArrivalDensity;
use elapsed::elapsed_s;
use survey::Survey;
use trend::{Point, Trend};
use wander::Wander;

use crate::float::sqrt;
use crate::holdover::DRIFT_PPB_PER_S;

/// A mark farther above the line is not remembered: 100 ms, the widest spread of
/// latencies measured on one receiver being 91 ms (LEA-M8T at 9600 baud).
pub const TOO_LATE_NS: i32 = 100_000_000;

/// A mark farther below a line that is known has to be confirmed: 12 ms, more than floors of
/// real receivers were seen to wander in all.
pub const TOO_EARLY_NS: i32 = -12_000_000;

/// A mark that is not farther above the line has come near it: twice what floors wander.
const NEAR_NS: i32 = 20_000_000;

/// For so long after its start a line is fresh: its first marks may have been late or
/// early, and a few others are enough to say so. \[s\]
const FRESH_S: f32 = 20.0;
/// A mark that is farther below a fresh line is a wrong label unless a second one says the same;
/// so is the first mark when those that follow are so far above it. \[ns\]
const ALONE_NS: i32 = 15_000_000;
/// So many marks above it, and none beside it, are enough. A second of a 5 Hz receiver.
const ALL_ABOVE: u8 = 5;
/// So many in a row, when a few were beside it.
const MOST_ABOVE: u8 = 10;
/// Two early marks say the same within so long. \[s\]
const AGREEING_S: f32 = 10.0;

/// Marks that are too early for so long, without a pause of [`AGREEING_S`], say that the floor
/// has moved: longer than labels were seen to be wrong. \[s\]
const EARLIER_AFTER_S: f32 = 75.0;
/// Without a mark so near to the line for so long, it has: longer than a queue of 0.1 s was seen to
/// stand (`k5`, 160 s). \[s\]
const LATER_AFTER_S: f32 = 240.0;
/// Where a pulse, or the crystal as a pulse has left it, knows better, both are soon believed, for
/// nothing but the latency is learnt from it. Labels were seen to be wrong for a minute. \[s\]
const KNOWN_AFTER_S: f32 = 75.0;

/// Marks that stay away for so long teach nothing any more, in s.
const AWAY_S: f32 = 20.0;

/// After so much silence a line is forgotten, except for its frequency:
/// the longest window, in s.
const FORGET_AFTER_S: f32 = 120.0;

/// The line as it ran on through silence counts for so long, in s: then the marks that came since
/// are enough.
const RETURN_S: f32 = 50.0;
/// So far at most may a frequency have changed during silence, in ppb, whatever the time.
const RETURN_PPB: f32 = 2_000.0;

/// A bin, in µs.
const BIN_US: u32 = 2_000_000;
/// The window in s: at least, at most (60 bins).
const WINDOW_S: (f32, f32) = (50.0, 120.0);
const BINS: usize = 60;

/// How well a frequency is known that was learnt wrong. \[ppb\]
const LOST_PPB: f32 = 50_000.0;

/// For so long the frequency is young: it may move as far as its doubt allows.
const YOUNG_S: f32 = 120.0;

/// What a mark says of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopeEstimate {
    /// How far above the floor the mark is, in ns.
    pub excess_ns: i32,
    /// By how much the crystal is fast, in ppb of its nominal frequency.
    pub crystal_ppb: f32,
    /// How far the line may be from the floor, in ns.
    pub uncertainty_ns: f32,
    /// How far the frequency may be off, in ppb.
    pub frequency_uncertainty_ppb: f32,
    /// The frequency as many minutes have it, in ppb, once there are as many.
    pub slow_ppb: Option<f32>,
    /// The line has begun less than a window ago: what ran on without it may be better.
    pub is_fresh: bool,
}

/// What became of a mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EnvelopeVerdict {
    /// It was taken in.
    Estimate(EnvelopeEstimate),
    /// It is later than any jitter: left alone.
    Late,
    /// It is earlier than any floor wanders, and not (yet) confirmed: left alone.
    Early,
    /// It confirms that the floor has moved: everything but the frequency begins anew.
    Moved(EnvelopeEstimate),
}

/// What the bins still have to be asked.
#[derive(Clone, Copy, Debug)]
enum Chore {
    Nothing,
    Survey(Survey),
    /// Points that are done, how far the lowest of them is above the line, in ns, and that line.
    Level(usize, i32, Trend),
    Wander,
}

/// The lower envelope of the marks.
#[derive(Clone, Debug)]
pub struct Envelope {
    line: Trend,
    is_empty: bool,
    /// µs since boot, in full.
    started_us: u64,
    /// µs since boot, in full.
    last_us: u64,
    /// Since when no mark has come near a line that is known.
    away: Option<Apart>,
    /// From the start to the mark that is being handled, in s.
    age_s: f32,
    bins: Bins<BINS>,
    edge: ArrivalDensity,
    wander: Wander,
    chore: Chore,
    window_s: f32,
    /// How far the line may have drifted while no mark came, in ns.
    drifted_ns: f32,
    /// Of the frequency, in ppb².
    variance: f32,
    /// The last slope, while the filter may not have believed it enough yet, in ppb.
    unexplained_ppb: f32,
    early: Option<Apart>,
    /// By how much early marks have lowered the line of late, so that they do not lead it down
    /// step by step, in ns.
    lowered_ns: i32,
    /// Marks near a fresh line, and of those far above it the number.
    near: u8,
    above: u8,
    /// Its first marks are all that it rests on.
    is_unsettled: bool,
    /// For how long the frequency has been learnt, over all lines, in s.
    learnt_s: f32,
    /// When the last mark came a pulse, or the crystal as one has left it, knew better.
    is_better_known: bool,
}

impl Envelope {
    /// An envelope that has had no mark, of a crystal that is `crystal_ppb` fast, give
    /// or take `uncertainty_ppb`.
    #[must_use]
    pub fn new(crystal_ppb: f32, uncertainty_ppb: f32) -> Self {
        Self {
            line: Trend {
                crystal_ppb,
                ..Trend::default()
            },
            is_empty: true,
            started_us: 0,
            last_us: 0,
            away: None,
            age_s: 0.0,
            bins: Bins::new(BIN_US),
            edge: ArrivalDensity::new(),
            wander: Wander::new(crystal_ppb),
            chore: Chore::Nothing,
            window_s: WINDOW_S.0,
            drifted_ns: 0.0,
            variance: uncertainty_ppb * uncertainty_ppb,
            unexplained_ppb: 0.0,
            early: None,
            lowered_ns: 0,
            near: 0,
            above: 0,
            is_unsettled: true,
            learnt_s: 0.0,
            is_better_known: false,
        }
    }

    /// Hears a mark that arrived `at_us` µs after boot; its arrival by the board's counter
    /// less its epoch is `lateness_ns`, in ns that wrap.
    pub fn update(
        &mut self,
        at_us: u64,
        lateness_ns: u32,
        is_better_known: bool,
    ) -> EnvelopeVerdict {
        let point = Point {
            at_us: at_us as u32,
            lateness_ns,
        };
        if self.is_empty {
            self.begin(at_us, point);
            return EnvelopeVerdict::Estimate(self.floor(point));
        }
        let last_us = core::mem::replace(&mut self.last_us, at_us);
        let was_known = core::mem::replace(&mut self.is_better_known, is_better_known);
        if elapsed_s(at_us, last_us) > FORGET_AFTER_S {
            if self.is_young() && !was_known {
                // It ran on by a crystal of which next to nothing is known.
                self.begin(at_us, point);
                return EnvelopeVerdict::Estimate(self.floor(point));
            }
            self.return_after_silence(last_us, at_us);
        }
        self.age_s = elapsed_s(at_us, self.started_us);
        let excess_ns = self.line.excess_ns(point);
        if self.is_unsettled && self.age_s < FRESH_S {
            return self.update_fresh(at_us, point, excess_ns);
        }
        let (earlier_after_s, later_after_s) = if is_better_known {
            (KNOWN_AFTER_S, KNOWN_AFTER_S)
        } else {
            (EARLIER_AFTER_S, LATER_AFTER_S)
        };
        let off_ppb = 2.0 * sqrt(self.variance);
        if excess_ns < NEAR_NS {
            self.away = None;
        } else {
            let away = self.away.get_or_insert(Apart::new(at_us, excess_ns));
            let standing = away.push(at_us, excess_ns, later_after_s, off_ppb);
            let teaches = !away.is_moving() && away.lasts_s(at_us) <= AWAY_S;
            if let Some(moved) = self.follow_moved(at_us, point, excess_ns, standing) {
                return moved;
            }
            if excess_ns > TOO_LATE_NS || !teaches {
                return EnvelopeVerdict::Late;
            }
        }
        if excess_ns < TOO_EARLY_NS + self.lowered_ns {
            let early = self.early_since(at_us, excess_ns);
            let standing = early.push(at_us, excess_ns, earlier_after_s, off_ppb);
            return self
                .follow_moved(at_us, point, excess_ns, standing)
                .unwrap_or(EnvelopeVerdict::Early);
        }
        self.take_in(point, excess_ns);
        EnvelopeVerdict::Estimate(self.floor(point))
    }

    /// A mark beside a line whose own marks are few.
    fn update_fresh(&mut self, at_us: u64, point: Point, excess_ns: i32) -> EnvelopeVerdict {
        self.away = None;
        if excess_ns < -ALONE_NS {
            let agrees = self.early.is_some_and(|early| {
                early.pause_s(at_us) < AGREEING_S
                    && excess_ns <= early.lowest_ns().saturating_add(ALONE_NS)
            });
            if !agrees {
                self.early = Some(Apart::new(at_us, excess_ns));
                return EnvelopeVerdict::Early;
            }
            self.begin(at_us, point);
            self.near = 1;
        } else if excess_ns > ALONE_NS {
            self.above = self.above.saturating_add(1);
            let enough = if self.near == 0 {
                ALL_ABOVE
            } else {
                MOST_ABOVE
            };
            if self.near < ALL_ABOVE && self.above >= enough {
                self.begin(at_us, point);
            } else if excess_ns > TOO_LATE_NS {
                return EnvelopeVerdict::Late;
            } else {
                self.take_in(point, excess_ns);
            }
        } else {
            self.near = self.near.saturating_add(1);
            self.above = 0;
            self.take_in(point, excess_ns);
        }
        EnvelopeVerdict::Estimate(self.floor(point))
    }

    /// The early marks so far, or none of them before this one.
    fn early_since(&mut self, at_us: u64, excess_ns: i32) -> &mut Apart {
        let early = self.early.get_or_insert(Apart::new(at_us, excess_ns));
        if early.pause_s(at_us) >= AGREEING_S {
            *early = Apart::new(at_us, excess_ns);
        }
        early
    }

    /// Begins anew if the floor has moved. Where it stands, the line is as good as the marks that said
    /// so, however late the one is that was the last of them.
    fn follow_moved(
        &mut self,
        at_us: u64,
        point: Point,
        excess_ns: i32,
        standing: Standing,
    ) -> Option<EnvelopeVerdict> {
        match standing {
            Standing::Unmoved => return None,
            Standing::At(by_ns) => {
                let above_ns = excess_ns.saturating_sub(by_ns);
                let floor = Point {
                    lateness_ns: point.lateness_ns.wrapping_sub(above_ns as u32),
                    ..point
                };
                self.begin(at_us, floor);
                self.is_unsettled = false;
            }
            Standing::Drifted => {
                self.variance = LOST_PPB * LOST_PPB;
                self.learnt_s = 0.0;
                self.begin(at_us, point);
            }
        }
        Some(EnvelopeVerdict::Moved(self.floor(point)))
    }

    /// Takes back a frequency that was learnt from a receiver that is not believed.
    pub fn believe(&mut self, at_us: u64, crystal_ppb: f32) {
        self.line = self.line.moved_to(at_us as u32);
        self.line.crystal_ppb = crystal_ppb;
    }

    /// Forgets everything: the crystal is none that anything can be learnt of.
    pub const fn forget_crystal(&mut self) {
        self.is_empty = true;
        self.line.crystal_ppb = 0.0;
        self.variance = LOST_PPB * LOST_PPB;
        self.learnt_s = 0.0;
        self.wander.forget();
    }

    /// Forgets everything but the frequency: the receiver's time has jumped.
    pub const fn forget(&mut self) {
        self.is_empty = true;
    }

    /// What the line says of a point.
    fn floor(&self, point: Point) -> EnvelopeEstimate {
        EnvelopeEstimate {
            excess_ns: self.line.excess_ns(point),
            crystal_ppb: self.line.crystal_ppb,
            uncertainty_ns: self.uncertainty_ns(),
            frequency_uncertainty_ppb: sqrt(self.variance).max(self.unexplained_ppb / 2.0),
            slow_ppb: self.wander.slow_ppb(),
            is_fresh: self.age_s < WINDOW_S.0,
        }
    }

    /// Starts a line at `point`; the frequency is all that stays.
    fn begin(&mut self, at_us: u64, point: Point) {
        self.is_empty = false;
        self.started_us = at_us;
        self.last_us = at_us;
        self.away = None;
        self.age_s = 0.0;
        self.line = self.line.through(point);
        self.bins.begin(point.at_us);
        self.bins.fill(point, 0, &self.line);
        self.edge.begin();
        self.wander.begin(point.at_us);
        self.chore = Chore::Nothing;
        self.drifted_ns = 0.0;
        self.early = None;
        self.lowered_ns = 0;
        self.near = 0;
        self.above = 0;
        self.is_unsettled = true;
    }

    /// The window is empty: begins anew at the line as it ran on, so that the first marks back,
    /// which may be any late, do not draw the clock after them. It is a point of the past, and
    /// leaves the window before theirs do.
    fn return_after_silence(&mut self, last_us: u64, at_us: u64) {
        let silence_s = at_us.saturating_sub(last_us) as f32 * 1e-6;
        let ramp_ppb = (DRIFT_PPB_PER_S * silence_s).min(RETURN_PPB);
        // By the length of the silence, not by stamps that may have wrapped.
        let rise_ns = self.line.crystal_ppb * silence_s;
        let line = Trend {
            at_us: at_us as u32,
            ..self.line.moved_to(last_us as u32).raised(rise_ns as i32)
        };
        let drifted_ns = (0.5 * ramp_ppb + sqrt(self.variance)) * silence_s;
        self.begin(
            at_us,
            Point {
                at_us: line.at_us,
                lateness_ns: line.level_ns,
            },
        );
        let before_us = (self.window_s - RETURN_S).max(0.0) * 1e6;
        let past = line.moved_to(line.at_us.wrapping_sub(before_us as u32));
        self.bins.begin(line.at_us);
        self.bins.keep(Point {
            at_us: past.at_us,
            lateness_ns: past.level_ns,
        });
        self.variance += ramp_ppb * ramp_ppb;
        self.drifted_ns = drifted_ns;
        self.is_unsettled = false;
    }

    fn is_young(&self) -> bool {
        self.learnt_s < YOUNG_S
    }

    fn take_in(&mut self, point: Point, excess_ns: i32) {
        self.wander.fill(point, excess_ns, &self.line);
        if matches!(self.chore, Chore::Nothing) && self.bins.is_over(point.at_us) {
            let lasted_s = self.bins.lasted_s(point.at_us);
            self.lowered_ns -= self.lowered_ns / 4;
            self.learnt_s = (self.learnt_s + lasted_s).min(YOUNG_S);
            if let Some(lowest) = self.bins.close(point.at_us) {
                self.edge.close_bin(self.line.excess_ns(lowest), lasted_s);
                let line = self.line.moved_to(point.at_us);
                self.chore = Chore::Survey(Survey::new(line, self.span_s()));
            }
        } else {
            self.work(point.at_us);
        }
        if let Some(second_ns) = self.bins.fill(point, excess_ns, &self.line) {
            self.edge.note(second_ns);
        }
        if excess_ns < 0 {
            self.lowered_ns = self.lowered_ns.saturating_sub(excess_ns);
            self.line = self.line.through(point);
        }
    }
}

#[cfg(test)]
mod tests;
