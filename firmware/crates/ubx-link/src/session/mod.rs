//! The configuration session: what is sent to the receiver, when, and at which rate.
//!
//! *Purpose.* A receiver of any generation and with any settings is brought to our rate and NAV-PVT
//! alone, and again after it has restarted; with TIM-TP beside it while forecasts of the pulse are wanted.
//!
//! *Design.* A state machine without I/O. [`Session::poll`] returns what to do next. The caller
//! does it, passes on every event of the receiver ([`Session::handle_event`]) and, while
//! [`Session::wants_bytes`], its bytes ([`Session::handle_bytes`]), and reports when the
//! last bit has left ([`Session::handle_sent`]): before that the session does nothing, and above
//! all does not change the rate.
//!
//! An *attempt* polls CFG-PRT at one rate: its answer has the protocols that the port had. With it, or
//! 100 ms later, it sends CFG-VALSET and CFG-PRT, of which each generation takes its own,
//! changes to our rate, gives the receiver time to do the same, and polls MON-VER there. The answers to
//! the two are not waited for, because their rate is not defined. If any event comes, the receiver
//! is found, and the settings follow (`steps`), each until it is answered or has been sent
//! [`Session::TRIES`] times. Whether TIM-TP is wanted is the last of them, and is sent again when it
//! changes. It comes on request only, since a burst should begin with NAV-PVT. Behind the settings, and behind
//! the polls, what the receiver may have in its flash is switched off, while NAV-PVT comes already: some 220
//! bytes and as many answers, which hold up nothing. What comes and is not used for all that is switched
//! off as it comes ([`Session::handle_unwanted`]). What the receiver refuses
//! [`Session::TRIES`] times is reported ([`Session::poll_refusal`]) and not asked again before it is found
//! anew. If no event comes, the next attempt takes the next rate. A *round* of all of them takes 3.8 s, and
//! the next begins 1 s later. While events come, no rate is tried: silence of [`Session::SILENCE`]
//! begins a new round. A receiver that was quiet for more than 1.5 s, or sends NMEA again, may have
//! restarted or be another one: it is asked what it is, and all settings are sent again.
//!
//! *The rate is saved* once in a receiver that was found at another rate: with the protocols
//! that its port had, so that who uses it next finds them. An M8 whose CFG-PRT was not answered is
//! not saved: nobody knows its protocols.
//!
//! *Whose pulse.* A width is the receiver's as soon as it has acknowledged the pulse's setting, and until
//! it is lost ([`Session::pulse_width_us`]). CFG-TP5's acknowledgement has a name of its own and counts
//! however late it comes. All CFG-VALSET have one name: so the pulse's is the first behind a MON-VER, whose
//! answer is behind all answers to what was sent before it, and only what comes while the session
//! waits for it counts. If none did, all is sent again 10 s later.
//!
//! *Limits.* A receiver that sends at our rate but does not receive us is left as it is.

mod finding;
mod leap_poll;
mod order;
mod received;
mod search;
mod steps;

use timebase::{Cycles, StampedByte};

use crate::answers::{Answers, Protocols};
use crate::config::{
    BAUD, POLL_LEAP_SECONDS, POLL_PORT, PULSE_WIDTH_US, Setting, UBX_ALONE, write_greeting,
};
use crate::event::Event;
use crate::frame_buffer::{Buffer, LONGEST};
use crate::unwanted::{Table, Unwanted};
pub use finding::Finding;
use finding::Findings;
use leap_poll::LeapPoll;
use order::STEPS;
use search::Search;

/// How long an answer is waited for, in cycles: 400 ms. PX4 waits 250 ms (`PX4-GPSDrivers`,
/// `ubx.h`); at the factory's one epoch a second some receivers take longer.
const ANSWER: u64 = millis(400);

/// The same of CFG-PRT, from which only the protocols are learnt: 100 ms.
const PORT_ANSWER: u64 = millis(100);

/// From the end of CFG-PRT to the first frame at our rate, in cycles: 100 ms. The receiver changes
/// its rate after it has processed the frame.
const SETTLE: u64 = millis(100);

/// A receiver that was quiet for longer than this may have restarted, in cycles: 1.5 s. One that has
/// refused our rate sends a solution a second.
const RESTART: u64 = millis(1_500);

const NAV_TIMELS: (u8, u8) = (0x01, 0x26);

const fn millis(ms: u64) -> u64 {
    Cycles::from_micros(ms * 1_000).0
}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action<'a> {
    /// Set the UART to this rate, in baud, in both directions and at once: everything before has
    /// left.
    SetBaud(u32),
    /// Send these bytes, and call [`Session::handle_sent`] when the last of them
    /// has left the wire.
    Transmit(&'a [u8]),
}

/// What has happened so far. All wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionCounters {
    /// Rounds begun: 1 after a boot that goes well.
    pub rounds: u32,
    /// Attempts at a rate.
    pub attempts: u32,
    /// Settings accepted by the receiver.
    pub accepted: u32,
    /// Times that the receiver has refused a setting.
    pub refused: u32,
    /// Settings that were not answered, after the receiver had been found.
    pub unanswered: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// An attempt begins: the UART gets its rate.
    SetOtherRate,
    /// CFG-PRT is to be polled.
    AskPort,
    /// The poll of CFG-PRT is leaving.
    AskingPort,
    /// Its answer is awaited.
    AwaitingPort { until: Cycles, may_wait: bool },
    /// CFG-VALSET and CFG-PRT are to be sent.
    SendPort,
    /// They are leaving.
    SendingPort,
    /// The UART gets our rate again.
    SetOwnRate,
    /// The receiver changes its rate.
    Settling { until: Cycles },
    /// A setting is to be sent.
    SendSetting,
    /// A setting is leaving.
    SendingSetting,
    /// The setting's answer is awaited.
    Waiting { until: Cycles },
    /// The poll of NAV-TIMELS is leaving.
    SendingPoll,
    /// Nothing is to be done, unless no event comes before `until`.
    Listening { until: Cycles },
}

/// What is known about the acknowledgement of the pulse's setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Acknowledged {
    NotYet,
    Yes,
    Refused,
}

/// The configuration session; see the [module](self).
#[derive(Clone, Debug)]
pub struct Session {
    state: State,
    search: Search,
    /// The present rate of the UART, in baud.
    baud: u32,
    answers: Answers,
    findings: Findings,
    /// The protocols that the port had when it was found at another rate.
    protocols: Option<Protocols>,
    /// The receiver was found at another rate.
    has_changed_rate: bool,
    /// This receiver has been asked to save its rate.
    is_saved: bool,
    /// The present one of [`STEPS`]; behind them is [`Setting::Forecasts`], and then `off`.
    step: usize,
    /// What switches off a message that has come.
    off: Option<Setting>,
    /// Nothing of it has come, but it may be in the receiver's flash.
    is_in_advance: bool,
    /// How often the present setting has been sent.
    tries: u8,
    /// Whether forecasts are wanted.
    wants_forecasts: bool,
    /// What was last sent about forecasts.
    sent_forecasts: bool,
    unwanted: Table,
    /// A setting that was refused, until it is asked for.
    refusal: Option<Setting>,
    /// What was sent before the settings is answered.
    is_in_step: bool,
    /// All settings are to be sent again.
    may_have_restarted: bool,
    pulse: Acknowledged,
    leap_seconds: LeapPoll,
    /// When the last event of this round came.
    last_event: Option<Cycles>,
    /// From then on all settings may be sent again.
    again_from: Cycles,
    buffer: Buffer,
    counters: SessionCounters,
}

impl Default for Session {
    fn default() -> Self {
        Self::new()
    }
}

impl Session {
    /// How often a setting is sent before the session goes on without its answer.
    pub const TRIES: u8 = 3;

    /// How long no event may come before the receiver counts as lost, in cycles: 3 s.
    pub const SILENCE: u64 = millis(3_000);

    /// A session for [`BAUD`] that begins its first round at once, on a UART at that rate.
    #[must_use]
    pub const fn new() -> Self {
        Self::at(BAUD)
    }

    /// The same for another of [`BAUDS`](crate::BAUDS).
    #[must_use]
    pub const fn at(own_baud: u32) -> Self {
        Self {
            state: State::SetOtherRate,
            search: Search::at(own_baud),
            baud: own_baud,
            answers: Answers::new(),
            findings: Findings::NONE,
            protocols: None,
            has_changed_rate: false,
            is_saved: false,
            step: 0,
            off: None,
            is_in_advance: false,
            tries: 0,
            wants_forecasts: false,
            sent_forecasts: false,
            unwanted: Table::new(),
            refusal: None,
            is_in_step: false,
            may_have_restarted: false,
            pulse: Acknowledged::NotYet,
            leap_seconds: LeapPoll::NONE,
            last_event: None,
            again_from: Cycles::BOOT,
            buffer: [0; LONGEST],
            counters: SessionCounters {
                rounds: 1,
                attempts: 0,
                accepted: 0,
                refused: 0,
                unanswered: 0,
            },
        }
    }

    /// A session that asks for the settings at `baud`, where the UART is already, and sends no CFG-PRT
    /// before it knows the receiver: for a caller that tries rates itself. Without an answer it looks
    /// for the receiver as any other.
    #[must_use]
    pub const fn trying(baud: u32) -> Self {
        Self {
            state: State::SendSetting,
            search: Search::last_at(baud),
            ..Self::at(baud)
        }
    }

    /// What has happened so far.
    #[must_use]
    pub const fn counters(&self) -> SessionCounters {
        self.counters
    }

    /// Whether the receiver has been found in this round and every setting has
    /// been answered or given up.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        matches!(self.state, State::Listening { .. })
            && self.last_event.is_some()
            && self.findings.generation().is_some()
    }

    /// What is known of the receiver.
    #[must_use]
    pub const fn finding(&self) -> Finding {
        self.findings.now()
    }

    /// What is new about that, once. After each `handle_…` and [`Self::poll`].
    pub fn poll_finding(&mut self) -> Option<Finding> {
        self.findings.poll()
    }

    /// Whether TIM-TP is wanted, which it is while pulses come. Call [`Self::poll`] afterwards.
    pub const fn handle_forecasts_wanted(&mut self, wanted: bool) {
        self.wants_forecasts = wanted;
    }

    /// NAV-TIMELS is wanted once: it is polled as soon as the receiver is found and configured. Call
    /// [`Self::poll`] afterwards.
    pub const fn handle_leap_seconds_wanted(&mut self) {
        self.leap_seconds.is_wanted = true;
    }

    /// The receiver has sent a message that we do not use: to be called for each of
    /// [`Link::poll_unwanted`](crate::Link::poll_unwanted). Call [`Self::poll`] afterwards.
    pub fn handle_unwanted(&mut self, now: Cycles, what: Unwanted) {
        if what == Unwanted::Nmea {
            self.handle_speaking();
            // A port that was found at another rate still has its protocols for a moment.
            if !matches!(self.state, State::Listening { .. }) {
                return;
            }
        }
        self.unwanted.handle(now, what);
        if let Some(setting) = self.unwanted.poll_stubborn() {
            self.refusal = Some(setting);
        }
    }

    /// A setting that the receiver has refused as often as it was asked, once; or one that it has
    /// accepted and does not keep. After each `handle_…`.
    pub const fn poll_refusal(&mut self) -> Option<Setting> {
        self.refusal.take()
    }

    /// How long the receiver's pulse is high, as it has acknowledged; `None` as long as it has not,
    /// so that no pulse is its. \[µs\]
    #[must_use]
    pub const fn pulse_width_us(&self) -> Option<u32> {
        match self.pulse {
            Acknowledged::Yes => Some(PULSE_WIDTH_US),
            Acknowledged::NotYet | Acknowledged::Refused => None,
        }
    }

    /// Lowers how long the line had been busy before an event to what a poll proves: what arrives
    /// behind an answer was made after its poll. After [`Self::handle_event`].
    #[inline]
    pub fn limit_wait(&self, event: &mut Event) {
        self.leap_seconds.limit_wait(event);
    }

    /// What to do now, one thing a call. Call until it is `None`, after each `handle_…` and at
    /// [`Self::poll_timeout`].
    #[inline(never)]
    pub fn poll(&mut self, now: Cycles) -> Option<Action<'_>> {
        loop {
            match self.state {
                State::SetOtherRate => {
                    self.state = State::AskPort;
                    if let Some(action) = self.set_baud(self.search.baud()) {
                        return Some(action);
                    }
                }
                State::AskPort => {
                    self.state = State::AskingPort;
                    self.protocols = None;
                    self.answers.handle_wanted(true);
                    count(&mut self.counters.attempts);
                    return Some(Action::Transmit(&POLL_PORT));
                }
                State::AwaitingPort { until, .. } if now >= until => self.state = State::SendPort,
                State::SendPort => {
                    self.state = State::SendingPort;
                    let known = self.protocols.filter(|_| !self.is_saved);
                    let protocols = known.unwrap_or(UBX_ALONE);
                    let baud = self.search.own_baud();
                    let length = write_greeting(baud, protocols, &mut self.buffer);
                    return Some(self.transmit(length));
                }
                State::SetOwnRate => {
                    // Only what comes at our rate is from a receiver that is found.
                    self.last_event = None;
                    self.has_changed_rate = !self.search.is_at_own();
                    let until = now.plus(SETTLE);
                    self.state = State::Settling { until };
                    if let Some(action) = self.set_baud(self.search.own_baud()) {
                        return Some(action);
                    }
                }
                State::SendSetting => {
                    let Some(setting) = self.setting() else {
                        self.finish(now);
                        continue;
                    };
                    if let Some(length) = self.write(setting) {
                        self.state = State::SendingSetting;
                        return Some(self.transmit(length));
                    }
                }
                State::Settling { until } if now >= until => self.begin_settings(),
                State::Waiting { until } if now >= until => self.no_answer(now),
                State::Listening { until } if now >= until => self.begin_round(now),
                State::Listening { .. } if self.is_done() => {
                    if self.wants_forecasts != self.sent_forecasts {
                        self.begin_step(STEPS.len());
                    } else if self.has_to_begin_again() && now >= self.again_from {
                        self.begin_settings();
                    } else if let Some(off) = self.unwanted.poll_off(now) {
                        self.switch_off(off);
                    } else if self.leap_seconds.poll(now) {
                        self.state = State::SendingPoll;
                        return Some(Action::Transmit(&POLL_LEAP_SECONDS));
                    } else {
                        let off = self.unwanted.poll_in_advance(now)?;
                        self.is_in_advance = true;
                        self.switch_off(off);
                    }
                }
                _ => return None,
            }
        }
    }

    /// When to call [`Self::poll`] if nothing happens before; `None` while bytes are leaving.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Cycles> {
        match self.state {
            State::Listening { until } if self.is_done() => {
                let mut due = until;
                if self.leap_seconds.is_wanted {
                    due = due.min(self.leap_seconds.may_leave());
                }
                if self.has_to_begin_again() {
                    due = due.min(self.again_from);
                }
                Some(due)
            }
            State::AwaitingPort { until, .. }
            | State::Settling { until }
            | State::Waiting { until }
            | State::Listening { until } => Some(until),
            _ => None,
        }
    }

    /// The last bit of what [`Action::Transmit`] handed out has left the wire.
    pub fn handle_sent(&mut self, now: Cycles) {
        self.state = match self.state {
            State::AskingPort => State::AwaitingPort {
                until: now.plus(PORT_ANSWER),
                may_wait: true,
            },
            State::SendingPort => State::SetOwnRate,
            State::SendingSetting => State::Waiting {
                until: now.plus(ANSWER),
            },
            State::SendingPoll => self.listening(now),
            other => other,
        };
    }

    /// Whether the bytes of the line are of interest.
    #[inline]
    #[must_use]
    pub const fn wants_bytes(&self) -> bool {
        self.answers.is_wanted()
    }

    /// The receiver has sent these bytes; does nothing unless [`Self::wants_bytes`].
    #[inline(never)]
    pub fn handle_bytes(&mut self, now: Cycles, bytes: &[StampedByte]) {
        for stamped in bytes {
            if !self.answers.is_wanted() {
                return;
            }
            if let Some(answer) = self.answers.push(stamped.byte) {
                self.handle_answer(now, answer);
            }
        }
    }

    /// The receiver has sent this: to be called for every [`Event`].
    #[inline(never)]
    pub fn handle_event(&mut self, now: Cycles, event: &Event) {
        let before = self.last_event.replace(now);
        match *event {
            Event::Ack { class, id } => self.handle_ack((class, id)),
            Event::Nak { class, id } => self.handle_nak((class, id)),
            Event::LeapSeconds(_) if !self.leap_seconds.handle_answer(now) => {
                let (class, id) = NAV_TIMELS;
                self.handle_unwanted(now, Unwanted::Ubx { class, id });
            }
            _ => {}
        }
        match self.state {
            // No attempt is needed: its rate is ours.
            State::SetOtherRate => self.begin_settings(),
            State::AwaitingPort { .. } => self.handle_speaking(),
            // It speaks between two rounds, and its rate is ours.
            State::Listening { .. } if before.is_none() => self.begin_settings(),
            State::Listening { .. } => {
                let quiet = before.map_or(0, |before| now.0.saturating_sub(before.0));
                self.may_have_restarted |= quiet > RESTART;
                self.state = self.listening(now);
            }
            _ => {}
        }
    }

    fn set_baud(&mut self, baud: u32) -> Option<Action<'static>> {
        let other = self.baud != baud;
        self.baud = baud;
        other.then_some(Action::SetBaud(baud))
    }

    fn transmit(&self, length: usize) -> Action<'_> {
        Action::Transmit(self.buffer.get(..length).unwrap_or_default())
    }
}

const fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
