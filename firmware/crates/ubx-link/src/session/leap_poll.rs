//! The polls of NAV-TIMELS, and what their answers prove.
//!
//! *Design.* One at a time. The receiver answers in the order of its queue, so that what comes behind an
//! answer was made after its poll: it waited no longer than since then, even on a line that is full.
//!
//! *Limits.* The answer to a poll is taken for the last one's: a queue of more than 10 s is not bounded.

use timebase::Cycles;

use crate::event::Event;
use crate::unwanted::PAUSE;

/// The polls of NAV-TIMELS.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeapPoll {
    pub(super) is_wanted: bool,
    /// When the one began to leave whose answer is awaited.
    sent: Option<Cycles>,
    /// When the one began to leave that was answered last.
    answered: Option<Cycles>,
    /// From then on a NAV-TIMELS is the answer to a poll: none has come by itself for so long.
    answers_from: Cycles,
}

impl LeapPoll {
    pub(super) const NONE: Self = Self {
        is_wanted: false,
        sent: None,
        answered: None,
        answers_from: Cycles(PAUSE),
    };

    /// The receiver was lost: what was asked is not answered any more.
    pub(super) fn handle_lost(&mut self, now: Cycles) {
        *self = Self {
            is_wanted: self.is_wanted,
            answers_from: now.plus(PAUSE),
            ..Self::NONE
        };
    }

    /// When the next one may leave: the answer to the one before may still be on its way.
    pub(super) fn may_leave(&self) -> Cycles {
        self.sent.map_or(Cycles::BOOT, |sent| sent.plus(PAUSE))
    }

    /// Whether one is to leave now; if so, it does.
    pub(super) fn poll(&mut self, now: Cycles) -> bool {
        let leaves = self.is_wanted && now >= self.may_leave();
        if leaves {
            self.is_wanted = false;
            self.sent = Some(now);
        }
        leaves
    }

    /// Takes a NAV-TIMELS; whether it is an answer.
    pub(super) fn handle_answer(&mut self, now: Cycles) -> bool {
        let Some(sent) = self.sent.take() else {
            self.answers_from = now.plus(PAUSE);
            self.answered = None;
            return false;
        };
        if sent >= self.answers_from {
            self.answered = Some(sent);
        }
        true
    }

    /// Lowers how long the line had been busy before an event to what a poll proves.
    #[inline]
    pub(super) fn limit_wait(&self, event: &mut Event) {
        let Some(asked) = self.answered else {
            return;
        };
        let (arrival, busy_us) = match event {
            Event::NavPvt { mark, .. } => (mark.arrival, &mut mark.busy_us),
            Event::TimTp(forecast) => (forecast.arrival, &mut forecast.busy_us),
            Event::LeapSeconds(received) => (received.arrival, &mut received.busy_us),
            Event::Ack { .. } | Event::Nak { .. } => return,
        };
        let since = Cycles(arrival.0.saturating_sub(asked.0)).as_micros();
        *busy_us = u32::try_from(since).map_or(*busy_us, |since| since.min(*busy_us));
    }
}
