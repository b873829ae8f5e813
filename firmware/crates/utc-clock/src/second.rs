//! Which second it is: the leap count, the votes of the marks, and what contradicts them.
//!
//! *Purpose.* A clock can have the phase right to 40 ns and be 3 s off, as one is that believes
//! the leap count that a receiver was built with. This knows what the number of the second rests
//! on, and how far it may be off.
//!
//! *Design.* The number is *open* until the leap count is believed and [`VOTES`] marks have said
//! the same whole second since; then it is *proved*, and the crystal keeps it. From then on a whole
//! second changes for a reason only: a leap second that was announced, or a contradiction of the
//! same whole seconds that stands for [`STANDS_S`] while no pulse is followed. Before that, a
//! contradiction widens the uncertainty, which holds both numbers, and asks for NAV-TIMELS.
//!
//! An announced leap second is tied to the end of a UTC day, for `timeToLsEvent` differs by 1 s
//! between receivers. The clock counts on through second 60, as POSIX does, and steps when it is
//! over.
//!
//! *Limits.* A sky that is forged from the start is believed.

use timebase::{CORE_HZ, Cycles, LeapEvent, LeapSeconds};

use crate::outcome::SecondProof;
use crate::utc::UtcNanos;

/// A second, in ns.
pub(crate) const SECOND_NS: i64 = 1_000_000_000;

/// The leap count when this was released: none since 2017-01-01 (IERS Bulletin C 72). A receiver
/// that has fewer does not know.
pub(crate) const RELEASED_COUNT: i8 = 18;

/// While the number is open it may be off by all leap seconds there were. \[ns\]
const OPEN_NS: u64 = 18 * SECOND_NS as u64;

/// So many marks vote, of which four fifths have to agree.
const VOTES: u8 = 5;

/// From the third mark on that says the same, a contradiction is one.
const CONTRADICTING: u8 = 3;

/// So many marks in a row that agree with the clock end a contradiction.
const AGREEING: u8 = 3;

/// A contradiction that has stood for so long is right.
const STANDS_S: u64 = 300;

/// A mark is late by up to this when it names the right second. \[ns\]
const LATE_NS: i64 = 750_000_000;

/// A residual less its whole seconds lies in here when it is whole: lateness is one-sided. \[ns\]
const WHOLE_NS: core::ops::RangeInclusive<i64> = -400_000_000..=150_000_000;

/// A mark that is farther from the clock is none of this second. \[ns\]
const NEAR_NS: u64 = 700_000_000;

/// After so long without a mark that names a second the receiver may have been started anew, with
/// another leap count: until it has been asked for that again, votes prove nothing.
/// \[cycles\] 4.5 s, 12 s
const SILENT: i64 = CORE_HZ as i64 * 9 / 2;
const ASKED_AGAIN: u64 = 12 * CORE_HZ as u64;

/// From one question for NAV-TIMELS to the next, until the count is believed and afterwards. \[s\]
const ASK_S: u64 = 10;
const ASK_RESOLVED_S: u64 = 600;

/// An event is asked about, and awaited, from so long before it to so long after. \[s\]
const EVENT_S: i64 = 120;
/// An event further away is only noted, for the answers to come. \[s\]
const EVENT_NEAR_S: i64 = 40_000;
/// `timeToLsEvent` may be off by so much. \[s\]
const EVENT_OFF_S: i64 = 5;

const DAY_S: i64 = 86_400;

/// What a mark says of the number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Judged {
    /// Nothing new: it names the second that the clock has.
    Same,
    /// It names another one, and is not followed.
    Refused,
    /// The number changes by so many seconds, which are to be added to the clock.
    Moved(i64),
}

/// A leap second that is to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Event {
    change: i8,
    /// What the clock reads when it is due to step. \[ns\]
    due: UtcNanos,
}

/// Marks in a row that name the same other second.
#[derive(Clone, Copy, Debug)]
struct Contradiction {
    by_s: i64,
    marks: u8,
    since: Cycles,
    /// Marks in a row that agreed with the clock since.
    agreeing: u8,
}

/// Votes about the number.
#[derive(Clone, Copy, Debug, Default)]
struct Votes {
    by_s: i64,
    agreeing: u8,
    all: u8,
}

/// What is known about the number of the second.
#[derive(Clone, Debug)]
pub(crate) struct Second {
    count: Option<i8>,
    /// Somebody has said so, and no receiver.
    is_configured: bool,
    is_proved: bool,
    votes: Votes,
    /// What was announced last, and when, until the second is proved.
    announced: Option<(Cycles, LeapEvent)>,
    event: Option<Event>,
    contradiction: Option<Contradiction>,
    ask_at: Cycles,
    may_ask_at: Cycles,
    /// When a mark last named a second, and from when on votes prove one.
    named_at: Option<Cycles>,
    votes_from: Cycles,
}

impl Second {
    /// An open number; the leap count is believed from the start where somebody configured it.
    pub(crate) fn new(configured_count: Option<i8>) -> Self {
        Self {
            count: configured_count,
            is_configured: configured_count.is_some(),
            is_proved: false,
            votes: Votes::default(),
            announced: None,
            event: None,
            contradiction: None,
            ask_at: Cycles::BOOT,
            may_ask_at: Cycles::BOOT,
            named_at: None,
            votes_from: Cycles::BOOT,
        }
    }

    /// Whether date and second are proved, and not contradicted.
    pub(crate) fn is_proved(&self) -> bool {
        self.is_proved && !self.is_contradicted()
    }

    /// How far the number may be off. \[ns\]
    pub(crate) fn uncertainty_ns(&self) -> u64 {
        let open = if self.is_proved { 0 } else { OPEN_NS };
        match self.contradiction {
            Some(Contradiction { by_s, marks, .. }) if marks >= CONTRADICTING => {
                let by_ns = by_s
                    .unsigned_abs()
                    .saturating_add(1)
                    .saturating_mul(SECOND_NS as u64);
                open.saturating_add(by_ns)
            }
            _ => open,
        }
    }

    /// Whether it has never been proved since it was last opened.
    pub(crate) const fn is_open(&self) -> bool {
        !self.is_proved
    }

    /// The same in one word.
    pub(crate) fn proof(&self) -> SecondProof {
        match (self.is_contradicted(), self.is_proved) {
            (true, _) => SecondProof::Contradicted,
            (false, true) => SecondProof::Proved,
            (false, false) => SecondProof::Open,
        }
    }

    /// Whether marks name another second than the clock.
    pub(crate) fn is_contradicted(&self) -> bool {
        self.contradiction
            .is_some_and(|contradiction| contradiction.marks >= CONTRADICTING)
    }

    /// Nothing is known of the number any more but the leap count.
    pub(crate) fn open(&mut self) {
        self.is_proved = false;
        self.votes = Votes::default();
        self.contradiction = None;
        self.event = None;
    }

    /// Judges a mark whose epoch is `residual_ns` ahead of the clock, or behind; whether it is
    /// `prompt`, so that it did not wait.
    pub(crate) fn judge(
        &mut self,
        residual_ns: i64,
        at: Cycles,
        is_prompt: bool,
        is_pulse_followed: bool,
    ) -> Judged {
        let by_s = div_floor_second(residual_ns.saturating_add(LATE_NS));
        let rest_ns = residual_ns.wrapping_sub(by_s.wrapping_mul(SECOND_NS));
        let is_whole = by_s == 0 || WHOLE_NS.contains(&rest_ns);
        let named_at = self.named_at.replace(at);
        if !self.is_proved {
            if !self.is_configured && named_at.is_some_and(|named| at.since(named) > SILENT) {
                self.votes_from = at.plus(ASKED_AGAIN);
                self.votes = Votes::default();
            }
            if !is_whole {
                // A line that is fresh has to find itself first.
                let is_near = residual_ns.unsigned_abs() < 2 * SECOND_NS as u64;
                return if is_near {
                    Judged::Same
                } else {
                    Judged::Refused
                };
            }
            if self.count.is_some() {
                return self.vote(by_s, at >= self.votes_from);
            }
        }
        if !is_whole && residual_ns.unsigned_abs() < NEAR_NS {
            // No other second, but a label or a latency that is another one.
            return Judged::Same;
        }
        if by_s == 0 {
            self.agree();
            return Judged::Same;
        }
        if !is_prompt || !is_whole {
            return Judged::Refused;
        }
        let run = match &mut self.contradiction {
            Some(run) if run.by_s == by_s => {
                run.marks = run.marks.saturating_add(1);
                run.agreeing = 0;
                *run
            }
            other => *other.insert(Contradiction {
                by_s,
                marks: 1,
                since: at,
                agreeing: 0,
            }),
        };
        if run.marks == CONTRADICTING {
            self.ask_at = at;
        }
        let stands = at.0.saturating_sub(run.since.0) > STANDS_S * u64::from(CORE_HZ);
        let is_over = if self.is_proved {
            stands && !is_pulse_followed
        } else {
            run.marks >= CONTRADICTING
        };
        if is_over {
            self.contradiction = None;
            Judged::Moved(by_s)
        } else {
            Judged::Refused
        }
    }

    fn agree(&mut self) {
        if let Some(run) = &mut self.contradiction {
            run.agreeing += 1;
            if run.agreeing >= AGREEING || run.marks < CONTRADICTING {
                self.contradiction = None;
            }
        }
    }

    fn vote(&mut self, by_s: i64, may_prove: bool) -> Judged {
        let votes = &mut self.votes;
        votes.all = votes.all.saturating_add(1);
        if votes.by_s == by_s {
            votes.agreeing = votes.agreeing.saturating_add(1);
        } else if votes.agreeing == 0 {
            *votes = Votes {
                by_s,
                agreeing: 1,
                all: votes.all,
            };
        } else {
            votes.agreeing -= 1;
        }
        let enough = u16::from(votes.agreeing) * 5 >= u16::from(votes.all) * 4;
        if may_prove && votes.agreeing >= VOTES - 1 && votes.all >= VOTES && enough {
            let by_s = votes.by_s;
            self.is_proved = true;
            self.contradiction = None;
            self.votes = Votes::default();
            return if by_s == 0 {
                Judged::Same
            } else {
                Judged::Moved(by_s)
            };
        }
        if votes.all >= 4 * VOTES {
            *votes = Votes::default();
        }
        if by_s == 0 {
            Judged::Same
        } else {
            Judged::Refused
        }
    }

    /// Takes an answer to NAV-TIMELS; `utc` is what the clock reads, if it is set.
    pub(crate) fn handle_leap_seconds(&mut self, received: &LeapSeconds, utc: Option<UtcNanos>) {
        let is_from_sky = matches!(received.source, 1..=5 | 7 | 8);
        let Some(count) = received
            .count
            .filter(|count| is_from_sky && *count >= RELEASED_COUNT)
        else {
            if !self.is_proved && !self.is_configured {
                // It has started anew, and its marks have the count that it does not know.
                self.count = None;
                self.votes = Votes::default();
            }
            return;
        };
        if self.count.is_none() {
            // What voted before did so with another count.
            self.votes = Votes::default();
            self.contradiction = None;
        }
        let believed = *self.count.get_or_insert(count);
        let Some(event) = received.event.filter(|_| count == believed) else {
            return;
        };
        if event.change != 0 {
            self.announced = Some((received.arrival, event));
        } else {
            self.announced = None;
            if let (Some(utc), Some(pending)) = (utc, self.event)
                && pending.due.since(utc) > 10 * SECOND_NS
            {
                self.event = None;
            }
        }
    }

    /// Ties what is announced to the end of a day, as soon as the second is proved; `utc` is what
    /// the clock reads now.
    #[inline(never)] // Seldom: it may be small.
    pub(crate) fn tie_event(&mut self, now: Cycles, utc: UtcNanos) {
        if !self.is_proved || self.announced.is_none() {
            return;
        }
        let Some((arrival, event)) = self.announced.take() else {
            return;
        };
        let passed_s = i64::try_from(now.0.saturating_sub(arrival.0) / u64::from(CORE_HZ));
        let in_s = i64::from(event.in_s).saturating_sub(passed_s.unwrap_or(i64::MAX));
        if self.event.is_some() || !(1..EVENT_NEAR_S).contains(&in_s) {
            return;
        }
        let at_s = utc.0.div_euclid(SECOND_NS).saturating_add(in_s);
        let midnight_s = (at_s + DAY_S / 2).div_euclid(DAY_S) * DAY_S;
        if (midnight_s - at_s).abs() <= EVENT_OFF_S {
            // A second 60 is over one second later; without its second 59 a day ends earlier.
            let due_s = midnight_s + if event.change > 0 { 1 } else { -1 };
            self.event = Some(Event {
                change: event.change.signum(),
                due: UtcNanos(due_s.saturating_mul(SECOND_NS)),
            });
        }
    }

    /// What the clock reads when its number is due to change.
    pub(crate) fn event_due(&self) -> Option<UtcNanos> {
        self.event.map(|event| event.due)
    }

    /// The announced leap second is over: by how many seconds the clock has to step.
    pub(crate) fn take_event(&mut self) -> Option<i64> {
        let event = self.event.take()?;
        self.count = self.count.map(|count| count.saturating_add(event.change));
        self.contradiction = None;
        Some(-i64::from(event.change))
    }

    /// Whether NAV-TIMELS may be asked for now.
    #[inline]
    pub(crate) fn may_ask(&self, now: Cycles) -> bool {
        now >= self.ask_at && now >= self.may_ask_at
    }

    /// Whether NAV-TIMELS is to be asked for now; the next time is set.
    #[inline(never)] // Seldom: it may be small.
    pub(crate) fn poll_ask(&mut self, now: Cycles, utc: UtcNanos) -> bool {
        if !self.may_ask(now) {
            return false;
        }
        let is_event_near = self
            .event
            .is_some_and(|event| event.due.since(utc).abs() < EVENT_S * SECOND_NS);
        let pause_s = if !self.is_proved() || is_event_near {
            ASK_S
        } else {
            ASK_RESOLVED_S
        };
        self.ask_at = now.plus(pause_s * u64::from(CORE_HZ));
        self.may_ask_at = now.plus(u64::from(CORE_HZ));
        if let Some(event) = self.event {
            // A minute before an event the questions come closer.
            let until_s = event.due.since(utc) / SECOND_NS - EVENT_S / 2;
            if let Ok(until_s) = u64::try_from(until_s) {
                self.ask_at = self
                    .ask_at
                    .min(now.plus(until_s.min(ASK_RESOLVED_S) * u64::from(CORE_HZ)));
            }
        }
        true
    }
}

/// Whole seconds in `ns`, rounded down; without a 64-bit division where they are few.
fn div_floor_second(ns: i64) -> i64 {
    if (0..SECOND_NS).contains(&ns) {
        0
    } else {
        ns.div_euclid(SECOND_NS)
    }
}
