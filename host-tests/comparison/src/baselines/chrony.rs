//! chrony's reference clock: a median filter, then a weighted regression.
//!
//! *Source.* chrony, `refclock.c`, `samplefilt.c`, `sourcestats.c`, `regress.c`,
//! `reference.c` and `sys_generic.c`, each option at its default. Every 16 s the
//! 60 % round the median of the last 64 samples become one; through at most 64 of
//! those goes a line, weighted by their dispersion, that sheds its oldest samples
//! until its residuals change sign often enough. Its slope corrects the
//! frequency by a weight that its certainty gives it, its end the phase, the more
//! slowly the noisier it is.
//!
//! *Left out.* The choice between sources, the asymmetry of network delays, and
//! the driver's wait for the next message. The tables for Student's t and for runs
//! are approximations to within a few per cent. The first good line sets the clock,
//! as `makestep` does.

use std::collections::VecDeque;

use super::baseline::Baseline;

/// From poll to poll, `poll 4`. \[s\]
const POLL: f64 = 16.0;
/// `filter 64`.
const FILTER: usize = 64;
/// The fewest messages that make a sample.
const FILTER_MIN: usize = 4;
/// The share of the filter's samples, round the median, that is kept.
const COMBINE: f64 = 0.6;
/// Samples on the line at most; as many again take part in the test of its runs.
const LINE_MAX: usize = 64;
/// The fewest samples that make a line.
const LINE_MIN: usize = 3;
/// A line of that many samples or fewer sheds none (`minsamples`).
const SHED_MIN: usize = 6;
/// Sample variances are compared at 90 % (χ² of 36 degrees of freedom, over 36).
const VARIANCE_RATIO: f64 = 1.31;
/// Precision of the clock. \[s\]
const PRECISION: f64 = 1e-9;
/// `maxupdateskew`: 1 000 ppm. A line whose slope is less sure changes no frequency.
const SKEW_MAX: f64 = 1e-3;
/// `corrtimeratio`.
const CORRECTION_RATIO: f64 = 3.0;
/// `maxslewrate`: 83 333 ppm.
const SLEW_MAX: f64 = 1.0 / 12.0;
/// The shortest slew. \[s\]
const SLEW_MIN_S: f64 = 1.0;

/// A filtered sample: when (s of nominal time), UTC less nominal time (s), and
/// how far that may be off (s).
#[derive(Clone, Copy, Debug)]
struct Sample {
    t: f64,
    y: f64,
    dispersion: f64,
}

/// A straight line through samples.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// At `t` = 0.
    intercept: f64,
    slope: f64,
    /// Variance of the samples about it, and standard deviations of the above.
    variance: f64,
    intercept_sd: f64,
    slope_sd: f64,
}

impl Line {
    /// Through (t, y, weight), the larger the weight the less it counts.
    fn through(points: &[(f64, f64, f64)]) -> Self {
        let (mut w, mut u) = (0.0, 0.0);
        for (t, _, weight) in points {
            w += 1.0 / weight;
            u += t / weight;
        }
        let centre = u / w;
        let (mut p, mut q, mut v) = (0.0, 0.0, 0.0);
        for (t, y, weight) in points {
            p += y / weight;
            q += y * (t - centre) / weight;
            v += (t - centre).powi(2) / weight;
        }
        let slope = q / v;
        let intercept = p / w - slope * centre;
        let squares: f64 = points
            .iter()
            .map(|(t, y, weight)| (y - intercept - slope * t).powi(2) / weight)
            .sum();
        let free = points.len() as f64 - 2.0;
        let reduced = squares / free;
        let slope_sd = (reduced / v).sqrt();
        Self {
            intercept,
            slope,
            variance: reduced * points.len() as f64 / w,
            intercept_sd: (reduced / w + (centre * slope_sd).powi(2)).sqrt(),
            slope_sd,
        }
    }
}

/// The clock that is steered: an offset that runs at a frequency, and a slew.
#[derive(Clone, Copy, Debug)]
struct Clock {
    at: f64,
    offset: f64,
    frequency: f64,
    slew: f64,
    slew_for: f64,
}

impl Clock {
    fn offset_at(&self, t: f64) -> f64 {
        let elapsed = t - self.at;
        self.offset + self.frequency * elapsed + self.slew * elapsed.min(self.slew_for)
    }
}

/// The reference clock and what it steers.
#[derive(Clone, Debug, Default)]
pub struct Chrony {
    /// Nominal time and UTC of the first message: what all else is counted from.
    origin: Option<(i64, i64)>,
    next_poll: f64,
    /// (t, y) of the messages since the last poll.
    filter: VecDeque<(f64, f64)>,
    /// The filter's running mean of its variance, and over how many.
    variance: f64,
    variance_of: f64,
    /// The newest last; the line goes through the last `on_line` of them.
    samples: VecDeque<Sample>,
    on_line: usize,
    clock: Option<Clock>,
    /// What is known of the frequency; 1, "rather bad", at first.
    skew: Option<f64>,
}

impl Baseline for Chrony {
    fn handle_mark(&mut self, local_ns: i64, epoch_utc_ns: i64) {
        let (local, utc) = *self.origin.get_or_insert((local_ns, epoch_utc_ns));
        let t = (local_ns - local) as f64 * 1e-9;
        let y = ((epoch_utc_ns - utc) - (local_ns - local)) as f64 * 1e-9;
        if self.next_poll == 0.0 {
            self.next_poll = POLL;
        }
        if t >= self.next_poll {
            self.next_poll = t + POLL;
            self.poll(t);
        }
        if self.filter.len() == FILTER {
            self.filter.pop_front();
        }
        self.filter.push_back((t, y));
    }

    fn utc_ns(&self, local_ns: i64) -> Option<i64> {
        let (local, utc) = self.origin?;
        let since = local_ns - local;
        let offset = self.clock?.offset_at(since as f64 * 1e-9);
        Some(utc + since + (offset * 1e9).round() as i64)
    }
}

impl Chrony {
    fn poll(&mut self, now: f64) {
        let Some(sample) = self.combine() else {
            return;
        };
        self.samples.push_back(sample);
        if self.samples.len() > 2 * LINE_MAX {
            self.samples.pop_front();
        }
        self.on_line = (self.on_line + 1).min(LINE_MAX);
        if let Some(line) = self.regress() {
            self.steer(&line, sample.t, now);
        }
    }

    /// One sample of those since the last poll.
    fn combine(&mut self) -> Option<Sample> {
        let mut chosen: Vec<_> = self.filter.drain(..).collect();
        if chosen.len() < FILTER_MIN {
            return None;
        }
        // About the clock's own course, or its drift would choose.
        let frequency = self.clock.map_or(0.0, |clock| clock.frequency);
        let about = |&(t, y): &(f64, f64)| y - frequency * t;
        chosen.sort_by(|one, next| about(one).total_cmp(&about(next)));
        let n = chosen.len();
        let cut = ((n as f64 * (1.0 - COMBINE) / 2.0) as usize).clamp(1, (n - 1) / 2);
        let kept = &chosen[cut..n - cut];

        let count = kept.len() as f64;
        let t = kept.iter().map(|(t, _)| t).sum::<f64>() / count;
        let y = kept.iter().map(|(_, y)| y).sum::<f64>() / count;
        let (variance, mut dispersion, free) = if kept.len() >= 4 {
            let points: Vec<_> = kept.iter().map(|&(at, y)| (at - t, y, 1.0)).collect();
            let line = Line::through(&points);
            (line.variance, line.intercept_sd, count - 2.0)
        } else {
            let squares: f64 = kept.iter().map(|(_, at)| (at - y).powi(2)).sum();
            let variance = squares / (count - 1.0);
            (variance, variance.sqrt(), count - 1.0)
        };
        let variance = variance.max(1e-20);
        let before = if self.variance_of == 0.0 {
            variance
        } else {
            self.variance
        };
        if self.variance_of > 50.0 {
            self.variance += free / (free + 50.0) * (variance - self.variance);
        } else {
            let all = free + self.variance_of;
            self.variance = (self.variance * self.variance_of + variance * free) / all;
            self.variance_of = all;
        }
        if variance / VARIANCE_RATIO < before {
            dispersion *= (self.variance / variance).sqrt();
        }
        Some(Sample { t, y, dispersion })
    }

    /// The line through the samples, counted from the newest; sheds the oldest.
    fn regress(&mut self) -> Option<Line> {
        if self.on_line < LINE_MIN {
            return None;
        }
        let all = self.samples.make_contiguous();
        let newest = all.last()?.t;
        let weighed = weights(&all[all.len() - self.on_line..]);
        loop {
            let n = self.on_line;
            let used = &all[all.len() - n..];
            let points: Vec<_> = used
                .iter()
                .zip(&weighed[weighed.len() - n..])
                .map(|(sample, weight)| (sample.t - newest, sample.y, *weight))
                .collect();
            let line = Line::through(&points);
            let tested = &all[all.len().saturating_sub(2 * n)..];
            let above =
                |sample: &Sample| sample.y > line.intercept + line.slope * (sample.t - newest);
            let changes = tested
                .windows(2)
                .filter(|pair| above(&pair[0]) != above(&pair[1]));
            let runs = 1 + changes.count();
            if runs > critical_runs(tested.len()) || n <= SHED_MIN {
                return Some(line);
            }
            self.on_line -= 1;
        }
    }

    fn steer(&mut self, line: &Line, newest: f64, now: f64) {
        let measured_offset = line.intercept + line.slope * (now - newest);
        let known = self.skew.unwrap_or(1.0);
        let measured = line.slope_sd * student(self.on_line - 2);
        let before = self.clock.map_or(0.0, |clock| clock.frequency);
        let gain = if measured > SKEW_MAX {
            0.0
        } else {
            3.0 * known.powi(2) / (3.0 * known.powi(2) + measured.powi(2))
        };
        let frequency = before + gain * (line.slope - before);
        let extra =
            (before - frequency).powi(2) * (1.0 - gain) + (line.slope - frequency).powi(2) * gain;
        self.skew = Some(known + gain * (measured - known) + extra.sqrt());

        let Some(clock) = self.clock else {
            self.clock = Some(Clock {
                at: now,
                offset: measured_offset,
                frequency,
                slew: 0.0,
                slew_for: 0.0,
            });
            return;
        };
        let offset = clock.offset_at(now);
        let error = measured_offset - offset;
        let area = CORRECTION_RATIO * 0.5 * line.intercept_sd * POLL;
        let wanted_s = (area / error.abs()).max(SLEW_MIN_S);
        let slew = (error / wanted_s).clamp(-SLEW_MAX, SLEW_MAX);
        self.clock = Some(Clock {
            at: now,
            offset,
            frequency,
            slew,
            slew_for: if slew == 0.0 { 0.0 } else { error / slew },
        });
    }
}

/// How little each sample is worth: 1 for the best, more for those that are more
/// dispersed.
fn weights(samples: &[Sample]) -> Vec<f64> {
    let mut sorted: Vec<_> = samples.iter().map(|sample| sample.dispersion).collect();
    sorted.sort_by(f64::total_cmp);
    let least = sorted.first().copied().unwrap_or(PRECISION);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(least);
    // 0.7: their `SD_TO_DIST_RATIO`.
    let sd = ((median - least) / 0.7).min(least).max(PRECISION);
    samples
        .iter()
        .map(|sample| (1.0 + (sample.dispersion - least - PRECISION).max(0.0) / sd).powi(2))
        .collect()
}

/// With chance alone, nine of ten rows of `n` residuals have more runs.
fn critical_runs(n: usize) -> usize {
    if n < 8 {
        return 0;
    }
    let n = n as f64;
    ((n + 1.0) / 2.0 - 1.2816 * (n - 1.0).sqrt() / 2.0).round() as usize
}

/// Student's t at 99.95 %.
fn student(free: usize) -> f64 {
    const FEW: [f64; 8] = [636.6, 31.6, 12.92, 8.61, 6.869, 5.959, 5.408, 5.041];
    match free.checked_sub(1).and_then(|index| FEW.get(index)) {
        Some(t) => *t,
        None => 3.3 + 11.0 / free.max(1) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    /// What it publishes less UTC after `seconds` at 5 Hz, on a board that runs 30 ppm fast, with
    /// a latency that depends on the message's number. \[ns\]
    fn error_after(seconds: i64, latency: impl Fn(i64) -> i64) -> Option<i64> {
        let mut clock = Chrony::default();
        let local = |utc: i64| 7 * SECOND + utc + utc * 3 / 100_000;
        for number in 0..seconds * 5 {
            let epoch = number * SECOND / 5;
            clock.handle_mark(local(epoch + latency(number)), epoch);
        }
        let now = seconds * SECOND;
        Some(clock.utc_ns(local(now))? - now)
    }

    #[test]
    fn three_polls_set_it_and_a_steady_receiver_keeps_it_exact() {
        assert_eq!(error_after(47, |_| 40_000_000), None);
        for seconds in [49, 100, 600] {
            let error = error_after(seconds, |_| 40_000_000).unwrap() + 40_000_000;
            assert!(error.abs() < 2_000, "after {seconds} s: {error} ns");
        }
    }

    #[test]
    fn it_follows_the_middle_and_not_the_outliers() {
        // Even over 40 to 50 ms, and each seventh by a second late.
        let latency = |number: i64| {
            let spread = number.wrapping_mul(7_919) % 101 * 100_000;
            let stalled = if number % 7 == 0 { SECOND } else { 0 };
            40_000_000 + spread + stalled
        };
        let error = error_after(600, latency).unwrap() + 45_000_000;
        assert!(error.abs() < 1_500_000, "{error} ns");
    }

    #[test]
    fn the_tables_hold_at_their_ends() {
        assert_eq!((critical_runs(8), critical_runs(50)), (3, 21));
        assert!((student(1) - 636.6).abs() < 0.1);
        assert!((student(40) - 3.55).abs() < 0.05);
    }
}
