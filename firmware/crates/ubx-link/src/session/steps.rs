//! The order in which a receiver is configured, and what follows when it does not answer.

use timebase::Cycles;

use super::order::STEPS;
use super::{Acknowledged, Finding, Session, State, count, millis};
use crate::config::Setting;
use crate::identity::Generation;
use crate::unwanted::{PAUSE, Table};

/// From a round without success to the next, in cycles: 1 s. A round takes 3.8 s, so that one that begins
/// to speak behind its attempt is found within 9 s.
pub(super) const BETWEEN_ROUNDS: u64 = millis(1_000);

impl Session {
    /// The present setting; `None` behind the last.
    #[inline(never)]
    pub(super) fn setting(&self) -> Option<Setting> {
        const FORECASTS: usize = STEPS.len();
        const OFF: usize = FORECASTS + 1;
        match self.step {
            FORECASTS => Some(Setting::Forecasts {
                on: self.wants_forecasts,
            }),
            OFF => self.off,
            step => STEPS.get(step).map(|(setting, _)| *setting),
        }
    }

    /// Whether the present step is for this receiver.
    #[inline(never)]
    pub(super) fn is_for_this(&self) -> bool {
        let Some((setting, only)) = STEPS.get(self.step) else {
            return true;
        };
        // What an M8 saves is its port: as it was found, or not at all.
        let may_save = self.protocols.is_some() || *only == Some(Generation::Keys);
        only.is_none_or(|only| self.findings.generation() == Some(only))
            && (*setting != Setting::Save || self.has_changed_rate && !self.is_saved && may_save)
    }

    /// Writes `setting` to the buffer, and notes that it leaves: the frame's length. `None` if there are no
    /// words for it, so that it counts as refused.
    #[inline(never)]
    pub(super) fn write(&mut self, setting: Setting) -> Option<usize> {
        let generation = self.findings.generation().unwrap_or(Generation::Messages);
        let length = setting.write(generation, self.search.own_baud(), &mut self.buffer);
        self.tries = self.tries.wrapping_add(1);
        match setting {
            _ if length == 0 => {
                self.tries = Self::TRIES;
                self.handle_refused();
                return None;
            }
            Setting::Forecasts { on } => self.sent_forecasts = on,
            Setting::Version => self.answers.handle_wanted(true),
            Setting::Save => self.is_saved = true,
            _ => {}
        }
        Some(length)
    }

    /// Whether the present setting may be sent once more: what may never come, in advance, is sent once.
    const fn may_try_again(&self) -> bool {
        !self.is_in_advance && self.tries < Self::TRIES
    }

    /// The present setting was refused once more.
    #[inline(never)]
    pub(super) fn handle_refused(&mut self) {
        if self.may_try_again() {
            self.state = State::SendSetting;
            return;
        }
        if self.is_in_advance {
            self.unwanted.handle_refused_in_advance();
            self.next_step();
            return;
        }
        self.refusal = self.setting();
        if self.refusal == Some(Setting::Pulse) {
            self.pulse = Acknowledged::Refused;
        }
        if let Some(off) = self.off {
            self.unwanted.handle_refused(off);
        }
        self.next_step();
    }

    /// All settings are through.
    #[inline(never)]
    pub(super) fn finish(&mut self, now: Cycles) {
        self.findings.handle_there();
        self.again_from = now.plus(PAUSE);
        self.state = self.listening(now);
    }

    pub(super) fn listening(&self, now: Cycles) -> State {
        State::Listening {
            until: self.last_event.unwrap_or(now).plus(Self::SILENCE),
        }
    }

    /// A receiver with keys has neither acknowledged nor refused the pulse.
    pub(super) fn has_to_begin_again(&self) -> bool {
        self.pulse == Acknowledged::NotYet && self.findings.generation() == Some(Generation::Keys)
    }

    /// What has come and is not used is asked to be off.
    pub(super) fn switch_off(&mut self, off: Setting) {
        if off == Setting::Port {
            // Sentences of a port that has UBX alone: it has restarted.
            self.begin_settings();
        } else {
            self.off = Some(off);
            self.begin_step(STEPS.len() + 1);
            // Refused once already: that is one of the three times.
            self.tries = u8::from(self.unwanted.was_refused_in_advance(off));
        }
    }

    /// The wait for an answer is over.
    #[cold]
    pub(super) fn no_answer(&mut self, now: Cycles) {
        if self.last_event.is_some() {
            count(&mut self.counters.unanswered);
            if self.may_try_again() {
                self.state = State::SendSetting;
            } else {
                self.next_step();
            }
        } else if self.search.begin_attempt() {
            self.state = State::SetOtherRate;
        } else {
            self.findings.handle(Finding::Silent);
            let until = now.plus(BETWEEN_ROUNDS);
            self.state = State::Listening { until };
        }
    }

    #[cold]
    pub(super) fn begin_round(&mut self, now: Cycles) {
        count(&mut self.counters.rounds);
        self.unwanted = Table::new();
        self.pulse = Acknowledged::NotYet;
        self.has_changed_rate = false;
        self.findings.handle_lost();
        self.leap_seconds.handle_lost(now);
        self.search.begin_round(self.last_event.take().is_some());
        self.state = State::SetOtherRate;
    }

    pub(super) const fn begin_settings(&mut self) {
        self.is_in_step = false;
        if self.may_have_restarted {
            self.unwanted.begin_again();
        }
        self.may_have_restarted = false;
        self.is_in_advance = false;
        self.begin_step(0);
    }

    pub(super) const fn begin_step(&mut self, step: usize) {
        (self.step, self.tries) = (step, 0);
        self.state = State::SendSetting;
    }

    #[inline(never)]
    pub(super) fn next_step(&mut self) {
        self.off = None;
        self.is_in_advance = false;
        if self.step == 0 && self.findings.generation().is_none() {
            // It is left alone until it is gone.
            self.begin_step(usize::MAX);
            return;
        }
        self.begin_step(self.step.wrapping_add(1));
        while !self.is_for_this() {
            self.step = self.step.wrapping_add(1);
        }
    }
}
