//! The message's estimator: the lower envelope of arrival − epoch.
//!
//! *Purpose.* A message can be late but never early, so what a receiver's marks
//! have in common is their *least* lateness, the floor. This follows it, with the
//! crystal's frequency: the floor's line is what time it is.
//!
//! *Design.* All of it happens on the board's own counter, which nothing steers, so
//! that no correction ever disturbs what was learnt. A mark is a [`Point`]: when it
//! arrived, and how late it was by that counter.
//!
//! * Bins of 2 s keep the lowest point of theirs, as it was measured. The floor's level
//!   is the lowest of a window of them, each compared along the *current* frequency:
//!   a better frequency makes the past better, too.
//! * The window is as long as the receiver's edge is blunt. With marks at a density of
//!   λ a second and a ns just above the floor, the lowest of a window W is 1/λW above
//!   it, and a crystal whose frequency drifts by d bends the line by ~dW²/8. Both are of
//!   a size where W³λ is a constant. The density shows in how far the lowest bins lie
//!   above the very lowest; taken from order statistics, not from residuals about
//!   our own line, it cannot lock itself below the edge.
//! * The frequency moves by the slope between the lowest points of the older and of the
//!   newer half, each time as far as its own doubt and the slope's say (a scalar
//!   Kalman filter).
//! * A second ring of 64 bins of 7.5 s tells whether the *floor* wanders, as real
//!   receivers' do, by ms over minutes: its points then scatter about a straight line by
//!   more than their edge and any crystal explain. Frequency learnt in a minute would
//!   be the wander's. So while it lasts, the frequency is the average of what the
//!   long line said, the level the lowest of both rings, and the doubt grows by
//!   the scatter.
//!
//! The work of a closed bin is spread over the marks that follow: a mark costs one scan
//! of one ring at most.
//!
//! *Limits.* Wander slower than 20 minutes looks like a crystal's drift to it. A floor that moves by
//! itself moves the clock. Lateness is kept in 32 bits that wrap: differences
//! within a window have to stay below 2.1 s, which marks farther from the line than
//! [`TOO_LATE_NS`] could break, so they are turned away.

use crate::ring::Ring;

/// A mark farther above the line is not remembered: 100 ms, the widest spread of
/// latencies measured on one receiver being 91 ms (LEA-M8T at 9600 baud).
pub const TOO_LATE_NS: i32 = 100_000_000;

/// A mark farther below a line that is known has to be confirmed: 20 ms, twice what floors of
/// real receivers were seen to wander.
pub const TOO_EARLY_NS: i32 = -20_000_000;

/// So many marks that are too early, in a row and within [`TOO_EARLY_NS`] of each other, are
/// believed: the floor has moved. A second of a 5 Hz receiver.
const EARLY_AGREEING: u8 = 5;

/// A line that no mark has touched for so long is forgotten, except for its frequency:
/// the window's own length, in s.
const FORGET_AFTER_S: f32 = 120.0;

/// A bin of the first ring, in µs.
const BIN_US: u32 = 2_000_000;
/// The window in s: at least, at most (60 bins).
const WINDOW_S: (f32, f32) = (50.0, 120.0);
const BINS: usize = 60;
/// By how much the window moves at a bin's end, as a part of itself.
const WINDOW_STEP: f32 = 0.02;
/// W³λ, in s² a ns: the edge's noise 1/λW and the bend of a drift of 1 ppm a minute,
/// 16.7 W²/8 ns, weighed against each other. Tuned.
const WINDOW_CUBED_DENSITY: f32 = 0.15;

/// A bin of the second ring, in µs.
const LONG_BIN_US: u32 = 7_500_000;
const LONG_BINS: usize = 64;
/// The second ring is asked when it is so full: 6 minutes.
pub const LONG_ENOUGH: usize = 48;
/// The long line's opinions that the slow frequency averages at most: 50 minutes of a full ring.
const SLOW_WEIGHTS: f32 = 400.0;
/// How sure it has to be that a floor wanders: by so many standard deviations of a
/// variance that exponential noise has, measured on as many points.
const WANDER_SURE: f32 = 7.0;

/// A crystal's frequency as fast as it is believed to drift, in ppb a second: 1 ppm a
/// minute.
pub(crate) const DRIFT_PPB_PER_S: f32 = 1_000.0 / 60.0;
/// How the estimate's doubt about the frequency grows, in ppb² a second.
const FREQUENCY_WALK: f32 = 80.0 * 80.0;
/// Windows overlap from bin to bin; a slope is worth this part of a window's second.
const SLOPE_WORTH_S: f32 = 100.0;
const FIRST_SLOPE_WORTH_S: f32 = 8.0;

/// A slope that would move the floor by more over the window is no wander, in ns: within
/// the first [`YOUNG_S`] it says that the crystal is farther off than anybody thought.
const BEYOND_WANDER_NS: f32 = 20e6;
const YOUNG_S: f32 = 120.0;
/// Before that, a slope is mostly chance, in s.
const FIRST_SLOPES_S: f32 = 8.0;

/// Bins over which the edge's sharpness is averaged.
const SHARPNESS_OVER: f32 = 30.0;
/// What an edge has that counts as sharp: half a bell's lowest marks are not quite even.
const SHARP: f32 = 0.965;

/// Lowest points that the density is read from.
const LOWEST: usize = 9;

/// A mark on the board's own counter. Both fields wrap; only differences mean something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Point {
    /// When it arrived, in µs.
    at_us: u32,
    /// Its arrival by the board's counter less its epoch, in ns.
    lateness_ns: u32,
}

/// What a mark says of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// How far above the floor the mark is, in ns.
    pub excess_ns: i32,
    /// By how much the crystal is fast, in ppb of its nominal frequency.
    pub fast_ppb: f32,
    /// How far the line may be from the floor, in ns.
    pub doubt_ns: f32,
    /// How far the frequency may be off, in ppb.
    pub frequency_doubt_ppb: f32,
    /// The frequency as many minutes have it, in ppb, after the first [`LONG_ENOUGH`] long bins.
    pub slow_ppb: Option<f32>,
}

/// What became of a mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heard {
    /// It was taken in.
    Floor(Floor),
    /// It is later than any jitter: left alone.
    Late,
    /// It is earlier than any floor wanders, and not (yet) confirmed: left alone.
    Early,
    /// It confirms that the floor has moved: everything but the frequency begins anew.
    Moved(Floor),
}

/// The straight line that the floor follows.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    at_us: u32,
    level_ns: u32,
    /// Rise in ns a second: the crystal's error.
    fast_ppb: f32,
}

impl Line {
    /// How far above the line a point is, in ns.
    fn excess_ns(&self, point: Point) -> i32 {
        let rise = self.fast_ppb * seconds(point.at_us, self.at_us);
        point
            .lateness_ns
            .wrapping_sub(self.level_ns)
            .wrapping_sub(rise as i32 as u32)
            .cast_signed()
    }

    /// The same line, told from another moment.
    fn moved_to(&self, at_us: u32) -> Self {
        let rise = self.fast_ppb * seconds(at_us, self.at_us);
        Self {
            at_us,
            level_ns: self.level_ns.wrapping_add(rise as i32 as u32),
            ..*self
        }
    }
}

/// From `earlier` to `later`, in s; negative the other way round.
fn seconds(later_us: u32, earlier_us: u32) -> f32 {
    later_us.wrapping_sub(earlier_us).cast_signed() as f32 * 1e-6
}

/// From `earlier_us` to `later_us`, µs since boot, in s; an hour at most.
fn elapsed_s(later_us: u64, earlier_us: u64) -> f32 {
    later_us.saturating_sub(earlier_us).min(3_600_000_000) as u32 as f32 * 1e-6
}

/// What the bins still have to be asked.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Chore {
    Nothing,
    Frequency,
    Level,
    Wander,
}

/// The bin that is being filled.
#[derive(Clone, Copy, Debug)]
struct Filling {
    ends_us: u32,
    lowest: Option<Point>,
}

/// The lower envelope of the marks.
#[derive(Clone, Debug)]
pub struct Envelope {
    line: Line,
    is_empty: bool,
    /// µs since boot, in full.
    started_us: u64,
    /// µs since boot, in full.
    last_us: u64,
    /// From the start to the mark that is being heard, in s.
    age_s: f32,
    bins: Ring<Point, BINS>,
    filling: Filling,
    long: Ring<Point, LONG_BINS>,
    long_filling: Filling,
    chore: Chore,
    wants_wander: bool,
    window_s: f32,
    /// The scale of what the lowest point of the window is above the floor, in ns.
    edge_ns: f32,
    /// How the lowest of n marks comes nearer to the floor: as n to the power of minus this, averaged. 1 for
    /// a sharp edge, ½ for one whose density begins at 0.
    sharpness: f32,
    variance: f32,
    slow_ppb: f32,
    slow_weight: f32,
    /// The long ring's scatter about its line while the floor wanders, in ns; else 0.
    wander_ns: f32,
    /// The second lowest of a bin above its lowest, averaged, in ns.
    gap_ns: f32,
    gaps: f32,
    second: Option<i32>,
    early: (u8, i32),
}

impl Envelope {
    /// An envelope that has heard nothing, of a crystal that is `fast_ppb` fast, give
    /// or take `doubt_ppb`.
    #[must_use]
    pub fn new(fast_ppb: f32, doubt_ppb: f32) -> Self {
        let nothing = Filling {
            ends_us: 0,
            lowest: None,
        };
        Self {
            line: Line {
                fast_ppb,
                ..Line::default()
            },
            is_empty: true,
            started_us: 0,
            last_us: 0,
            age_s: 0.0,
            bins: Ring::new(Point::default()),
            filling: nothing,
            long: Ring::new(Point::default()),
            long_filling: nothing,
            chore: Chore::Nothing,
            wants_wander: false,
            window_s: WINDOW_S.0,
            edge_ns: 30e6,
            sharpness: 1.0,
            variance: doubt_ppb * doubt_ppb,
            slow_ppb: fast_ppb,
            slow_weight: 0.0,
            wander_ns: 0.0,
            gap_ns: 5e6,
            gaps: 2.0,
            second: None,
            early: (0, 0),
        }
    }

    /// Hears a mark that arrived `at_us` µs after boot; its arrival by the board's counter
    /// less its epoch is `lateness_ns`, in ns that wrap.
    pub fn update(&mut self, at_us: u64, lateness_ns: u32) -> Heard {
        let point = Point {
            at_us: at_us as u32,
            lateness_ns,
        };
        if self.is_empty {
            self.begin(at_us, point);
            return Heard::Floor(self.floor(point));
        }
        let silence_s = elapsed_s(at_us, self.last_us);
        if silence_s > FORGET_AFTER_S {
            self.return_after_silence(at_us, silence_s);
        }
        self.age_s = elapsed_s(at_us, self.started_us);
        let excess_ns = self.line.excess_ns(point);
        if excess_ns > TOO_LATE_NS && !self.is_young() {
            return Heard::Late;
        }
        if excess_ns < TOO_EARLY_NS && !self.is_young() {
            let (agreeing, first_ns) = self.early;
            let agrees =
                agreeing > 0 && excess_ns.abs_diff(first_ns) <= TOO_EARLY_NS.unsigned_abs();
            self.early = if agrees {
                (agreeing.saturating_add(1), first_ns)
            } else {
                (1, excess_ns)
            };
            if self.early.0 < EARLY_AGREEING {
                return Heard::Early;
            }
            self.begin(at_us, point);
            return Heard::Moved(self.floor(point));
        }
        self.early = (0, 0);
        self.last_us = at_us;
        self.take_in(point, excess_ns);
        Heard::Floor(self.floor(point))
    }

    /// Forgets everything but the frequency: the receiver's time has jumped.
    pub const fn forget(&mut self) {
        self.is_empty = true;
    }

    /// What the line says of a point.
    fn floor(&self, point: Point) -> Floor {
        Floor {
            excess_ns: self.line.excess_ns(point),
            fast_ppb: self.line.fast_ppb,
            doubt_ns: self.doubt_ns(),
            frequency_doubt_ppb: libm::sqrtf(self.variance),
            slow_ppb: (self.slow_weight > 0.0).then_some(self.slow_ppb),
        }
    }

    /// Starts a line at `point`; the frequency is all that stays.
    fn begin(&mut self, at_us: u64, point: Point) {
        self.is_empty = false;
        self.started_us = at_us;
        self.last_us = at_us;
        self.age_s = 0.0;
        self.line = Line {
            at_us: point.at_us,
            level_ns: point.lateness_ns,
            ..self.line
        };
        self.bins.clear();
        self.long.clear();
        self.filling = Filling {
            ends_us: point.at_us.wrapping_add(BIN_US),
            lowest: Some(point),
        };
        self.long_filling = Filling {
            ends_us: point.at_us.wrapping_add(LONG_BIN_US),
            lowest: Some(point),
        };
        self.chore = Chore::Nothing;
        self.edge_ns = 30e6;
        self.wander_ns = 0.0;
        self.second = None;
        self.early = (0, 0);
    }

    /// The window is empty: begins anew at the line as it ran on, so that the first mark back, which
    /// may be any late, does not draw the clock after it.
    fn return_after_silence(&mut self, at_us: u64, silence_s: f32) {
        let drifted_ns =
            0.5 * DRIFT_PPB_PER_S * silence_s * silence_s + libm::sqrtf(self.variance) * silence_s;
        self.variance += DRIFT_PPB_PER_S * silence_s * DRIFT_PPB_PER_S * silence_s;
        // Its low word has wrapped if the silence was longer than 35 minutes; the level then
        // means nothing, and is as good as any.
        let line = self.line.moved_to(at_us as u32);
        let above = Point {
            at_us: at_us as u32,
            lateness_ns: line.level_ns.wrapping_add(drifted_ns as i32 as u32),
        };
        self.begin(at_us, above);
    }

    fn is_young(&self) -> bool {
        self.age_s < YOUNG_S
    }

    fn take_in(&mut self, point: Point, excess_ns: i32) {
        if is_over(&self.long_filling, point.at_us) {
            if let Some(lowest) = self.long_filling.lowest.take() {
                self.long.push(lowest);
                self.wants_wander = true;
            }
            self.long_filling.ends_us = point.at_us.wrapping_add(LONG_BIN_US);
        }
        if self.chore == Chore::Nothing && is_over(&self.filling, point.at_us) {
            self.close_bin();
            self.filling.ends_us = point.at_us.wrapping_add(BIN_US);
        } else {
            self.work(point.at_us);
        }
        match self
            .filling
            .lowest
            .map(|lowest| self.line.excess_ns(lowest))
        {
            Some(lowest_ns) if lowest_ns <= excess_ns => self.note_second(excess_ns),
            Some(lowest_ns) => {
                self.note_second(lowest_ns);
                self.filling.lowest = Some(point);
            }
            None => self.filling.lowest = Some(point),
        }
        let is_lowest = self
            .long_filling
            .lowest
            .is_none_or(|lowest| excess_ns < self.line.excess_ns(lowest));
        if is_lowest {
            self.long_filling.lowest = Some(point);
        }
        if excess_ns < 0 {
            self.line = Line {
                at_us: point.at_us,
                level_ns: point.lateness_ns,
                ..self.line
            };
        }
    }

    fn note_second(&mut self, excess_ns: i32) {
        self.second = Some(
            self.second
                .map_or(excess_ns, |second| second.min(excess_ns)),
        );
    }

    fn close_bin(&mut self) {
        let Some(lowest) = self.filling.lowest.take() else {
            return;
        };
        if let Some(second_ns) = self.second.take() {
            let gap_ns = second_ns.saturating_sub(self.line.excess_ns(lowest)).max(0) as f32;
            self.gaps = (self.gaps + 1.0).min(40.0);
            self.gap_ns += (gap_ns - self.gap_ns) / self.gaps;
        }
        self.bins.push(lowest);
        self.chore = Chore::Frequency;
    }

    /// Does one piece of the work that the last bins left.
    fn work(&mut self, at_us: u32) {
        self.chore = match self.chore {
            Chore::Frequency => {
                if self.wander_ns > 0.0 {
                    self.line = self.line.moved_to(at_us);
                    self.line.fast_ppb = self.slow_ppb;
                    self.variance = 25e6;
                    self.measure_edge(at_us);
                } else {
                    self.learn_frequency(at_us);
                }
                Chore::Level
            }
            Chore::Level => {
                self.find_level(at_us);
                if self.wants_wander {
                    Chore::Wander
                } else {
                    Chore::Nothing
                }
            }
            Chore::Wander => {
                self.wants_wander = false;
                self.look_for_wander(at_us);
                Chore::Nothing
            }
            Chore::Nothing => Chore::Nothing,
        };
    }

    /// The part of the window that there are marks in, in s.
    fn span_s(&self) -> f32 {
        self.age_s.min(self.window_s)
    }

    fn learn_frequency(&mut self, at_us: u32) {
        let slope = self.measure_edge(at_us);
        let Some((slope_ppb, apart_s)) = slope else {
            return;
        };
        let span_s = self.span_s();
        // Two lowest of half a window each: twice the scale of a whole one.
        let slope_doubt = 2.0 * core::f32::consts::SQRT_2 * self.edge_ns / apart_s;
        // The same points are asked again and again until the first window is full.
        let worth_s = if self.is_young() {
            FIRST_SLOPE_WORTH_S
        } else {
            SLOPE_WORTH_S
        };
        let worth = (span_s / worth_s).max(1.0);
        self.variance += FREQUENCY_WALK * 2.0;
        // Judged by the density inside of bins, which a slope does not blur.
        let chance_ns = 5.0 * 2.0 * core::f32::consts::SQRT_2 * self.gap_ns * 1.4 / span_s;
        let may_be_far_off = self.is_young() && self.age_s > FIRST_SLOPES_S;
        if may_be_far_off && slope_ppb.abs() * apart_s > BEYOND_WANDER_NS + chance_ns {
            self.line.fast_ppb += slope_ppb;
            self.variance = slope_ppb * slope_ppb / 4.0;
            return;
        }
        let gain = self.variance / (self.variance + slope_doubt * slope_doubt * worth);
        self.line.fast_ppb += gain * slope_ppb;
        self.variance *= 1.0 - gain;
    }

    /// How blunt the edge is, from the bins in the window; and the slope between the lowest
    /// points of its halves, in ppb, with the time between them, in s.
    fn measure_edge(&mut self, at_us: u32) -> Option<(f32, f32)> {
        let line = self.line.moved_to(at_us);
        self.line = line;
        let span_s = self.span_s();
        let mut lowest = Lowest::new();
        let mut older: Option<(i32, f32)> = None;
        let mut newer: Option<(i32, f32)> = None;
        for bin in self.bins.values() {
            let age_s = seconds(at_us, bin.at_us);
            if age_s > span_s {
                continue;
            }
            let excess_ns = line.excess_ns(*bin);
            lowest.add(excess_ns);
            let half = if age_s > span_s / 2.0 {
                &mut older
            } else {
                &mut newer
            };
            if half.is_none_or(|(least, _)| excess_ns < least) {
                *half = Some((excess_ns, age_s));
            }
        }
        self.edge_ns = lowest.spacing_ns().max(self.gap_ns * 1.4 / span_s.max(2.0));
        if span_s > 8.0 {
            let sharpness = libm::log2f((self.gap_ns * 1.4 / self.edge_ns).max(1.0))
                / libm::log2f(span_s / 2.0);
            self.sharpness += (sharpness - self.sharpness) / SHARPNESS_OVER;
        }
        let cubed_density = self.window_s * self.window_s * self.window_s
            / (self.edge_ns * span_s.max(10.0)).max(1.0);
        if self.age_s > 30.0 {
            let step = if cubed_density < WINDOW_CUBED_DENSITY {
                WINDOW_STEP
            } else {
                -WINDOW_STEP
            };
            self.window_s = (self.window_s * (1.0 + step)).clamp(WINDOW_S.0, WINDOW_S.1);
        }
        let ((older_ns, older_age_s), (newer_ns, newer_age_s)) = (older?, newer?);
        let apart_s = (older_age_s - newer_age_s).max(span_s / 4.0).max(1.0);
        Some((newer_ns.wrapping_sub(older_ns) as f32 / apart_s, apart_s))
    }

    /// Puts the line's level on the lowest of the window, or of everything while the
    /// floor wanders.
    fn find_level(&mut self, at_us: u32) {
        let line = self.line.moved_to(at_us);
        let window_s = self.window_s;
        let least = |points: &[Point], within_s: f32| {
            points
                .iter()
                .filter(|point| seconds(at_us, point.at_us) <= within_s)
                .map(|point| line.excess_ns(*point))
                .min()
        };
        let mut lowest = least(self.bins.values(), window_s);
        if self.wander_ns > 0.0 {
            let long = least(self.long.values(), f32::MAX);
            lowest = lowest.into_iter().chain(long).min();
        }
        let filling = self.filling.lowest.map(|point| line.excess_ns(point));
        if let Some(excess_ns) = lowest.into_iter().chain(filling).min() {
            self.line = Line {
                level_ns: line.level_ns.wrapping_add(excess_ns as u32),
                ..line
            };
        }
    }

    /// Fits a straight line to the long ring: the slow frequency, and whether what lies about it is more
    /// than an edge and a crystal make.
    fn look_for_wander(&mut self, at_us: u32) {
        let points = self.long.values();
        if points.len() < LONG_ENOUGH {
            return;
        }
        let line = self.line.moved_to(at_us);
        let n = points.len() as f32;
        let (mut x, mut y, mut xx, mut xy, mut yy, mut span_s) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0_f32);
        for point in points {
            let age_s = seconds(at_us, point.at_us);
            let ns = line.excess_ns(*point) as f32;
            x -= age_s;
            y += ns;
            xx += age_s * age_s;
            xy -= age_s * ns;
            yy += ns * ns;
            span_s = span_s.max(age_s);
        }
        let (sxx, sxy, syy) = (xx - x * x / n, xy - x * y / n, yy - y * y / n);
        if sxx < 1.0 {
            return;
        }
        let slope_ppb = sxy / sxx;
        let scatter = ((syy - slope_ppb * sxy) / (n - 2.0)).max(0.0);
        let part = span_s / 480.0;
        let weight = part * part * part;
        self.slow_weight = (self.slow_weight + weight).min(SLOW_WEIGHTS);
        self.slow_ppb += weight / self.slow_weight * (line.fast_ppb + slope_ppb - self.slow_ppb);
        // A parabola's standard deviation about its line: d/2 · T²/(6√5).
        let bend_ns = DRIFT_PPB_PER_S * span_s * span_s / 26.8;
        let edge_ns = self.gap_ns * 2.0 / 7.5;
        let explained = edge_ns * edge_ns + bend_ns * bend_ns;
        let doubtful = 1.0 + WANDER_SURE * libm::sqrtf(8.0 / n);
        let held = if self.wander_ns > 0.0 { 0.64 } else { 1.0 };
        self.wander_ns = if scatter > explained * doubtful * held {
            libm::sqrtf(scatter)
        } else {
            0.0
        };
    }

    /// How far the line may be from the floor, in ns.
    fn doubt_ns(&self) -> f32 {
        let span_s = self.span_s();
        let bend_ns = DRIFT_PPB_PER_S * span_s * span_s / 14.0;
        let softness = (SHARP - self.sharpness).clamp(0.0, 0.5);
        let tilt_ns = 0.4 * libm::sqrtf(self.variance) * span_s;
        (4.0 + 36.0 * softness) * self.edge_ns + bend_ns + tilt_ns + 2.0 * self.wander_ns
    }
}

/// Whether the bin's time is over.
fn is_over(filling: &Filling, at_us: u32) -> bool {
    at_us.wrapping_sub(filling.ends_us).cast_signed() >= 0
}

/// The lowest few of a row of numbers.
struct Lowest {
    sorted: [i32; LOWEST],
    count: usize,
}

impl Lowest {
    const fn new() -> Self {
        Self {
            sorted: [i32::MAX; LOWEST],
            count: 0,
        }
    }

    fn add(&mut self, value: i32) {
        self.count = (self.count + 1).min(LOWEST);
        let mut value = value;
        if self
            .sorted
            .last()
            .is_some_and(|greatest| value >= *greatest)
        {
            return;
        }
        for place in &mut self.sorted {
            if value < *place {
                core::mem::swap(&mut value, place);
            }
        }
    }

    /// The mean distance from one to the next, in ns; 30 ms where there are no two.
    fn spacing_ns(&self) -> f32 {
        let greatest = self
            .count
            .checked_sub(1)
            .and_then(|last| self.sorted.get(last));
        match (self.sorted.first(), greatest) {
            (Some(least), Some(greatest)) if self.count > 1 => {
                greatest.wrapping_sub(*least) as f32 / (self.count - 1) as f32
            }
            _ => 30e6,
        }
    }
}
