//! What the session makes of what the receiver sends.

use timebase::Cycles;

use super::{Acknowledged, PORT_ANSWER, Session, State, count, millis};
use crate::answers::Answer;
use crate::config::Setting;
use crate::identity::Generation;

/// The same if the receiver sends at this rate, in cycles: 1.2 s. At 9600 the sentences of a factory's
/// receiver fill half of each second.
const PORT_ANSWER_BEHIND: u64 = millis(1_200);

/// Class and id of CFG-VALSET and CFG-PRT.
const VALSET: (u8, u8) = (0x06, 0x8a);
const CFG_PRT: (u8, u8) = (0x06, 0x00);

impl Session {
    #[inline(never)]
    pub(super) fn handle_answer(&mut self, now: Cycles, answer: Answer) {
        self.last_event = Some(now);
        match (answer, self.state) {
            (Answer::Port(protocols), State::AwaitingPort { .. }) => {
                self.protocols = Some(protocols);
                self.handle_found();
            }
            (Answer::Version, _) => {
                let before = self.findings.generation();
                if self.findings.handle_version(self.answers.identity()) {
                    self.is_saved = false;
                    self.pulse = Acknowledged::NotYet;
                }
                self.answers.handle_wanted(false);
                let after = self.findings.generation();
                match self.state {
                    State::Waiting { .. } if self.step == 0 => {
                        self.is_in_step = true;
                        self.next_step();
                    }
                    // It answers late, and is configured as another one.
                    State::Listening { .. } if before != after => self.begin_settings(),
                    _ => {}
                }
            }
            _ => {}
        }
    }

    /// The receiver sends at the rate at which its port is asked.
    #[inline(never)]
    pub(super) fn handle_speaking(&mut self) {
        if self.search.is_at_own() {
            if matches!(self.state, State::AwaitingPort { .. }) && self.last_event.is_some() {
                self.begin_settings();
            }
        } else if let State::AwaitingPort {
            until,
            may_wait: true,
        } = self.state
        {
            self.state = State::AwaitingPort {
                until: until.plus(PORT_ANSWER_BEHIND - PORT_ANSWER),
                may_wait: false,
            };
        }
    }

    /// The receiver has answered at the rate of the attempt.
    pub(super) fn handle_found(&mut self) {
        if self.search.is_at_own() {
            self.has_changed_rate = false;
            self.begin_settings();
        } else {
            self.state = State::SendPort;
        }
    }

    #[inline(never)]
    pub(super) fn handle_ack(&mut self, message: (u8, u8)) {
        if message == VALSET {
            self.findings.handle_keys_taken();
        }
        if message == Setting::Pulse.message(Generation::Messages) {
            self.pulse = Acknowledged::Yes;
        }
        if self.awaits(message) {
            count(&mut self.counters.accepted);
            if self.setting() == Some(Setting::Pulse) && self.is_in_step {
                self.pulse = Acknowledged::Yes;
            }
            self.next_step();
        }
    }

    #[inline(never)]
    pub(super) fn handle_nak(&mut self, message: (u8, u8)) {
        if message == Setting::Pulse.message(Generation::Messages) {
            self.pulse = Acknowledged::NotYet;
        }
        if matches!(self.state, State::AwaitingPort { .. }) && message == CFG_PRT {
            // It does not know the question.
            self.handle_found();
        } else if self.awaits(message) {
            if self.setting().is_some_and(Setting::is_optional) {
                self.next_step();
                return;
            }
            count(&mut self.counters.refused);
            self.handle_refused();
        }
    }

    /// Whether an answer about `message` is waited for.
    pub(super) fn awaits(&self, message: (u8, u8)) -> bool {
        let generation = self.findings.generation();
        matches!(self.state, State::Waiting { .. })
            && generation.is_some_and(|generation| {
                let awaited = self.setting().map(|setting| setting.message(generation));
                awaited == Some(message)
            })
    }
}
