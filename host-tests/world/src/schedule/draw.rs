//! Schedules drawn from seeds.
//!
//! *Design.* A fault that breaks a rule of [`Schedule::is_detectable`] together with the
//! others is drawn again.

use fastrand::Rng;

use super::pieces::{LAST_BEGIN_S, LASTS_S, OF_MESSAGES, OF_PULSES, UNTELLABLE};
use super::sizes::{between, reach, whole};
use super::{Fault, FieldReceiver, Schedule};
use crate::chance::{Stream, even, stream};

/// The first and the last day on which a flight begins, in s since 1970: 2025-06-01
/// and 2040-01-01.
const DAYS_S: std::ops::Range<i64> = 1_748_736_000..2_208_988_800;
/// Limit of a crystal's error, in ppm.
const MOST_PPM: f64 = 97.0;
/// Limit of its change, in ppm a minute.
const MOST_PPM_PER_MIN: f64 = 1.0;
/// Schedules for each one that has a leap second.
const EVENT_ONE_IN: u32 = 12;
const DAY_S: i64 = 86_400;
/// Attempts at a fault that keeps the rules.
const ATTEMPTS: usize = 200;

impl Schedule {
    /// The schedule of a seed: two to five faults, in every second one two at once.
    #[must_use]
    pub fn draw(seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Schedule);
        let mut schedule = Self::without_faults(seed, &mut rng);
        let faults = rng.usize(2..=5);
        let is_at_once = seed.is_multiple_of(2);
        while schedule.faults.len() < faults {
            let within = if is_at_once && schedule.faults.len() == 1 {
                schedule.faults.first().copied()
            } else {
                None
            };
            if !schedule.add_fault(&mut rng, within) {
                // Nothing fits the first one.
                schedule.faults.clear();
            }
        }
        schedule
            .faults
            .sort_by(|one, next| one.from_s.total_cmp(&next.from_s));
        schedule
    }

    /// A schedule with a fault that nothing on the board can detect.
    #[must_use]
    pub fn draw_undetectable(seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Schedule);
        let mut schedule = Self::without_faults(seed, &mut rng);
        // The last kind is a floor that no clock without a pulse allows for.
        let kind = rng.usize(0..=UNTELLABLE.len());
        if let Some(draw) = UNTELLABLE.get(kind) {
            schedule.receiver.has_pulse = true;
            schedule.faults.push(draw(&mut rng, &schedule.receiver));
        } else {
            schedule.receiver.has_pulse = false;
            schedule.receiver.floor_ms = 300.0 + 300.0 * even(&mut rng);
        }
        schedule
    }

    fn without_faults(seed: u64, rng: &mut Rng) -> Self {
        let periods_ms = [200, 200, 200, 200, 200, 100, 1_000, 60, 40];
        let receiver = FieldReceiver {
            period_ms: periods_ms[rng.usize(..periods_ms.len())],
            floor_ms: between(rng, 20.0, 110.0),
            jitter_ms: between(rng, 0.3, 4.0),
            late_one_in: if rng.bool() { rng.u32(20..200) } else { 0 },
            lost_one_in: if rng.bool() { rng.u32(20..500) } else { 0 },
            is_tim_tp_behind: rng.bool(),
            has_pulse: rng.u32(..10) < 7,
            pulse_noise_ns: between(rng, 3.0, 35.0),
            width_ms: f64::from(rng.u32(20..=150)),
            t_acc_ns: rng.u32(8..=100),
            valid_from_s: if rng.bool() {
                0.0
            } else {
                reach(rng, 1.0, 60.0).round()
            },
            leap_source: [2, 2, 2, 3, 4, 5][rng.usize(..6)],
            is_event_late: false,
        };
        let start_s = rng.i64(DAYS_S);
        let crystal = crystal(rng);
        let mut schedule = Self {
            seed,
            lasts_s: LASTS_S,
            start_utc_ns: start_s * 1_000_000_000,
            leap_at_s: None,
            receiver,
            crystal,
            faults: Vec::new(),
        };
        schedule.draw_event();
        schedule
    }

    /// In one schedule of [`EVENT_ONE_IN`], a leap second at the end of its day.
    fn draw_event(&mut self) {
        let mut rng = stream(self.seed, Stream::ScheduleEvent);
        if rng.u32(..EVENT_ONE_IN) != 0 {
            return;
        }
        let leap_s = between(&mut rng, 300.0, LAST_BEGIN_S).floor();
        let day_s = self.start_utc_ns / 1_000_000_000 / DAY_S * DAY_S;
        self.start_utc_ns = (day_s - leap_s as i64) * 1_000_000_000;
        self.leap_at_s = Some(leap_s);
        self.receiver.is_event_late = rng.bool();
    }

    /// Adds a fault that begins within `within`, if that is one; says whether one was
    /// found.
    fn add_fault(&mut self, rng: &mut Rng, within: Option<Fault>) -> bool {
        for _ in 0..ATTEMPTS {
            let of_pulse = self.receiver.has_pulse && rng.bool();
            let draw = if of_pulse {
                OF_PULSES[rng.usize(..OF_PULSES.len())]
            } else {
                OF_MESSAGES[rng.usize(..OF_MESSAGES.len())]
            };
            let mut fault = draw(rng, &self.receiver);
            if let Some(first) = within {
                // What is there from the start cannot be moved into another one.
                let can_move = fault.from_s > 0.0;
                let room_s = (first.until_s - first.from_s).min(LASTS_S - first.from_s);
                if can_move {
                    let lasts_s = fault.until_s - fault.from_s;
                    fault.from_s = whole(first.from_s + even(rng) * room_s * 0.8);
                    fault.until_s = fault.from_s + lasts_s;
                }
                if fault.from_s >= first.until_s || first.from_s >= fault.until_s {
                    continue;
                }
            }
            self.faults.push(fault);
            if self.is_detectable() {
                return true;
            }
            self.faults.pop();
        }
        false
    }
}

/// Linear between knots of 20 s to 3 minutes, each piece at up to the steepest.
fn crystal(rng: &mut Rng) -> Vec<(f64, f64)> {
    let mut at_s = 0.0;
    let mut ppm = between(rng, -MOST_PPM, MOST_PPM);
    let mut knots = vec![(at_s, ppm)];
    while at_s < LASTS_S {
        let lasts_s = between(rng, 20.0, 180.0).round();
        let sign = if rng.bool() { 1.0 } else { -1.0 };
        let by = sign * reach(rng, 0.0, MOST_PPM_PER_MIN) * lasts_s / 60.0;
        // Turns round at the end.
        let next = if (ppm + by).abs() > MOST_PPM {
            ppm - by
        } else {
            ppm + by
        };
        at_s += lasts_s;
        ppm = next;
        knots.push((at_s, ppm));
    }
    knots
}
