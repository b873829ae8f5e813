//! How often the clock misleads, over schedules that nobody has seen.
//!
//! *Purpose.* Counts the misleading schedules, and that it was not bought with
//! silence: how available the clock was while nothing was wrong.
//!
//! *Design.* A [`Schedule`] is played once; of its readings those count for
//! availability in which nothing is wrong and has not been for long enough
//! ([`Schedule::calm`]). Constants are tuned with [`TUNING`] alone.
//!
//! | figure | of which readings | counts those that |
//! |---|---|---|
//! | set | calm | are set |
//! | within | calm and set | are within 400 ns with a pulse, within the receiver's floor and 30 ms without |
//! | claimed | calm and set | claim 5 µs at most with a pulse, 250 ms without |
//! | close | the pulse was followed for 60 s on end and nothing was wrong in them | claim 200 ns at most |
//!
//! *Limits.* What nothing on the board can detect is judged apart.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::{AddAssign, Range};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use world::WorldPicos;
use world::schedule::Schedule;

use crate::judge::Tally;
use crate::player::{self, Setup};
use crate::{Flight, READ_EVERY, Reading};

/// Seeds that constants may be tuned with, or were: some thousands were played to judge, and then to
/// see what had to be mended.
pub const TUNING: Range<u64> = 0..9_000_000;
/// Seeds that judge: no constant was tuned with them.
pub const JUDGING: Range<u64> = 11_000_000..11_002_000;
/// Seeds that are played each time that everything is checked, so that nothing that was mended
/// comes back.
pub const CHECKED: Range<u64> = 2_000_000..2_000_200;
/// Schedules that can be detected for each one that cannot.
pub const TELLABLE_PER_UNTELLABLE: u64 = 10;

/// A schedule without faults has a receiver with a latency that no clock allows for.
const NO_FAULT: &str = "long latency";

/// The word for a followed pulse, as the player says it.
const PULSE: &str = "pulse";

const WITHIN_WITH_PULSE_NS: u64 = 400;
const WITHIN_BEYOND_FLOOR_NS: f64 = 30e6;
const CLAIM_WITH_PULSE_NS: u64 = 5_000;
const CLAIM_WITHOUT_PULSE_NS: u64 = 250_000_000;
const CLOSE_AFTER_S: f64 = 60.0;
const CLOSE_CLAIM_NS: u64 = 200;
/// Each share is at least this.
const LEAST_PERMILLE: u64 = 999;

/// A part of a whole, both counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Share {
    /// That did.
    pub good: u64,
    /// Of all.
    pub of: u64,
}

impl Share {
    const fn count(&mut self, is_good: bool) {
        self.of += 1;
        self.good += is_good as u64;
    }

    /// In percent; 100 of nothing.
    #[must_use]
    pub fn percent(self) -> f64 {
        if self.of == 0 {
            100.0
        } else {
            100.0 * self.good as f64 / self.of as f64
        }
    }

    /// Whether it is large enough.
    #[must_use]
    pub const fn is_enough(self) -> bool {
        self.good * 1_000 >= self.of * LEAST_PERMILLE
    }
}

impl AddAssign for Share {
    fn add_assign(&mut self, other: Self) {
        self.good += other.good;
        self.of += other.of;
    }
}

/// How available the clock was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Availability {
    /// See the table above.
    pub set: Share,
    /// See the table above.
    pub within: Share,
    /// See the table above.
    pub claimed: Share,
    /// See the table above.
    pub close: Share,
}

impl Availability {
    /// The shares by their names.
    #[must_use]
    pub const fn shares(&self) -> [(&'static str, Share); 4] {
        [
            ("set", self.set),
            ("within", self.within),
            ("claimed", self.claimed),
            ("close", self.close),
        ]
    }

    /// Whether each share is large enough.
    #[must_use]
    pub fn is_enough(&self) -> bool {
        self.shares().iter().all(|(_, share)| share.is_enough())
    }
}

impl AddAssign for Availability {
    fn add_assign(&mut self, other: Self) {
        self.set += other.set;
        self.within += other.within;
        self.claimed += other.claimed;
        self.close += other.close;
    }
}

/// A schedule that was played.
#[derive(Clone, Debug)]
pub struct Played {
    /// Which.
    pub schedule: Schedule,
    /// All its readings.
    pub tally: Tally,
    /// Those in which the clock had no excuse.
    pub availability: Availability,
    /// The largest error beside its claim, over runs of more than a second.
    pub nearest: f64,
}

impl Played {
    /// What makes it worse than others: misleading, then unavailable, then near to
    /// misleading.
    fn badness(&self) -> (i64, u64, f64) {
        let missing = self.availability.shares();
        let missing = missing.iter().map(|(_, share)| share.of - share.good).max();
        (
            self.tally.misleading().0,
            missing.unwrap_or(0),
            self.nearest,
        )
    }
}

/// Plays a schedule.
#[must_use]
pub fn play(schedule: Schedule) -> Played {
    let flight = Flight::from(&schedule);
    let setup = Setup::default();
    let calm = schedule.calm();
    let has_pulse = schedule.receiver.has_pulse;
    let mut tally = Tally::default();
    let mut availability = Availability::default();
    let mut nearest = Nearest::default();
    let mut followed_from: Option<WorldPicos> = None;
    player::play(&flight, &setup, |reading| {
        let truth = flight.header.utc_ns(reading.at);
        tally.push(reading, truth);
        nearest.push(reading, truth);
        let at_s = reading.at.as_secs();
        let claim = reading.claim();
        if calm.has(at_s) {
            availability.set.count(claim.is_some());
            if let Some((utc_ns, claim_ns)) = claim {
                let (within_ns, most_ns) = if has_pulse {
                    (WITHIN_WITH_PULSE_NS, CLAIM_WITH_PULSE_NS)
                } else {
                    let floor_ns = schedule.floor_ms(at_s) * 1e6;
                    let within_ns = (floor_ns + WITHIN_BEYOND_FLOOR_NS) as u64;
                    (within_ns, CLAIM_WITHOUT_PULSE_NS)
                };
                let is_within = utc_ns.abs_diff(truth) <= within_ns;
                availability.within.count(is_within);
                availability.claimed.count(claim_ns <= most_ns);
            }
        }
        if reading.source != PULSE {
            followed_from = None;
            return;
        }
        let from = *followed_from.get_or_insert(reading.at);
        let is_close = from.as_secs() + CLOSE_AFTER_S <= at_s;
        if is_close && calm.has_been_for(at_s, CLOSE_AFTER_S) {
            let is_good = claim.is_some_and(|(_, claim_ns)| claim_ns <= CLOSE_CLAIM_NS);
            availability.close.count(is_good);
        }
    });
    Played {
        schedule,
        tally,
        availability,
        nearest: nearest.worst,
    }
}

/// How near to misleading a clock came: over a second on end, the smallest of the
/// errors beside their claims; the largest of these.
#[derive(Default)]
struct Nearest {
    window: VecDeque<f64>,
    worst: f64,
}

impl Nearest {
    /// Readings of a second and a little more.
    const READINGS: usize = (1_000_000_000_000 / READ_EVERY.0) as usize + 2;

    fn push(&mut self, reading: &Reading, truth: i64) {
        let Some((utc_ns, claim_ns)) = reading.claim() else {
            self.window.clear();
            return;
        };
        let beside = utc_ns.abs_diff(truth) as f64 / claim_ns.max(1) as f64;
        self.window.push_back(beside);
        if self.window.len() > Self::READINGS {
            self.window.pop_front();
        }
        if self.window.len() == Self::READINGS && beside > self.worst {
            let least = self.window.iter().copied().fold(f64::INFINITY, f64::min);
            self.worst = self.worst.max(least);
        }
    }
}

/// Many schedules together.
#[derive(Debug, Default)]
pub struct Campaign {
    /// How many.
    pub schedules: u64,
    /// Those that misled, by their seeds, in order.
    pub misleading: Vec<u64>,
    /// For each kind of fault the schedules that misled, of those that had it.
    pub misled_by: BTreeMap<&'static str, Share>,
    /// With a pulse.
    pub with_pulse: Availability,
    /// Without one.
    pub without_pulse: Availability,
    /// How long all of them lasted, in s.
    pub lasted_s: f64,
    /// The worst, the very worst first.
    pub worst: Vec<Played>,
}

impl Campaign {
    /// Whether none misled, and the clock was available.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.misleading.is_empty() && self.with_pulse.is_enough() && self.without_pulse.is_enough()
    }

    fn take(&mut self, played: Played, worst: usize) {
        self.schedules += 1;
        self.lasted_s += played.schedule.lasts_s;
        let is_misleading = played.tally.is_misleading();
        if is_misleading {
            self.misleading.push(played.schedule.seed);
        }
        let faults = played.schedule.faults.iter();
        let mut kinds: BTreeSet<_> = faults.map(|fault| fault.kind.name()).collect();
        if kinds.is_empty() {
            kinds.insert(NO_FAULT);
        }
        for kind in kinds {
            self.misled_by.entry(kind).or_default().count(is_misleading);
        }
        if played.schedule.receiver.has_pulse {
            self.with_pulse += played.availability;
        } else {
            self.without_pulse += played.availability;
        }
        self.worst.push(played);
        self.sort();
        self.worst.truncate(worst);
    }

    fn sort(&mut self) {
        // Ties by their seeds, for several threads take them in any order.
        self.worst.sort_by(|one, next| {
            let (one_is, next_is) = (one.badness(), next.badness());
            (next_is.0, next_is.1)
                .cmp(&(one_is.0, one_is.1))
                .then(next_is.2.total_cmp(&one_is.2))
                .then(one.schedule.seed.cmp(&next.schedule.seed))
        });
    }
}

/// Draws and plays a schedule a seed, on all cores, and keeps the `worst` ones; reports
/// `done` after each.
pub fn campaign(
    seeds: Range<u64>,
    draw: fn(u64) -> Schedule,
    worst: usize,
    done: &(dyn Fn() + Sync),
) -> Campaign {
    let next = AtomicU64::new(seeds.start);
    let campaign = Mutex::new(Campaign::default());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds.end {
                        return;
                    }
                    let played = play(draw(seed));
                    let mut campaign = campaign
                        .lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner);
                    campaign.take(played, worst);
                    drop(campaign);
                    done();
                }
            });
        }
    });
    let mut campaign = campaign
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    campaign.misleading.sort_unstable();
    campaign
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_of_tuning_and_of_judging_have_nothing_in_common() {
        const { assert!(TUNING.end <= JUDGING.start) };
        assert_eq!(JUDGING.end - JUDGING.start, 2_000);
        assert_eq!(CHECKED.end - CHECKED.start, 200);
    }

    #[test]
    fn a_share_of_nothing_is_enough_and_one_in_a_thousand_may_fail() {
        assert!(Share::default().is_enough());
        assert!(
            Share {
                good: 999,
                of: 1_000
            }
            .is_enough()
        );
        assert!(
            !Share {
                good: 998,
                of: 1_000
            }
            .is_enough()
        );
        let mut all = Availability::default();
        all.close.count(false);
        assert!(!all.is_enough());
    }

    #[test]
    fn a_schedule_is_near_when_it_is_beyond_for_a_second() {
        let mut nearest = Nearest::default();
        let mut push = |k: i64, error_ns: i64| {
            let at = WorldPicos(k * READ_EVERY.0);
            let reading = Reading {
                at,
                utc_ns: Some(error_ns),
                uncertainty_ns: Some(100),
                state: "set",
                source: "messages",
            };
            nearest.push(&reading, 0);
        };
        (0..20).for_each(|k| push(k, 500));
        (20..60).for_each(|k| push(k, -90));
        (60..80).for_each(|k| push(k, 500));
        assert!((nearest.worst - 0.9).abs() < 1e-9);
    }

    #[test]
    fn a_campaign_is_the_same_on_any_number_of_cores() {
        let seeds = TUNING.start..TUNING.start + 4;
        let together = campaign(seeds.clone(), Schedule::draw, 2, &|| {});
        let mut one_by_one = Campaign::default();
        for seed in seeds.rev() {
            one_by_one.take(play(Schedule::draw(seed)), 2);
        }
        let worst = |campaign: &Campaign| {
            campaign
                .worst
                .iter()
                .map(|played| played.schedule.seed)
                .collect::<Vec<_>>()
        };
        assert_eq!(worst(&together), worst(&one_by_one));
        assert_eq!(together.with_pulse, one_by_one.with_pulse);
        assert_eq!(together.without_pulse, one_by_one.without_pulse);
        assert_eq!(together.schedules, 4);
    }
}
