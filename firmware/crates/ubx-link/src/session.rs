//! The configuration session: what leaves for the receiver, when, and at which rate.
//!
//! *Purpose.* To bring a receiver, whatever it was left at, to our rate and
//! NAV-PVT alone, and back to it when it has restarted; with TIM-TP beside it while
//! somebody wants forecasts of the pulse.
//!
//! *Design.* A state machine without I/O. [`Session::poll`] says what to do next;
//! the wiring does it and tells the session of everything readable that comes in
//! ([`Session::handle_event`]) and when the last bit handed out has left
//! ([`Session::handle_sent`]): before that the session asks for nothing, above all
//! for no other rate.
//!
//! An *attempt* sends CFG-PRT at one rate, goes to ours, lets the receiver do the same, and
//! sends the first setting there. CFG-PRT itself is not waited for: its answer comes at a rate that
//! is not defined. If anything readable comes, the receiver is found, and the other settings
//! follow, each until it is answered or [`TRIES`] times. Whether TIM-TP is to come is the last of
//! them and is sent again when the wish changes; a receiver that refuses is not asked again. It
//! comes on request only, since a burst should begin with NAV-PVT. If nothing comes, the next
//! attempt takes the next rate of [`BAUDS`]. After a *round* of all of them the session listens for
//! [`SILENCE`]. While frames arrive, no rate is tried: only silence of [`SILENCE`] begins a new
//! round.
//!
//! *Limits.* A receiver that does not hear us but talks at our rate is left alone.
//! More than 100 framing errors in a second make an M8 deaf for the rest of it (it
//! says so: "More than 100 frame errors, UART RX was disabled"), so
//! that an attempt at a wrong rate may spoil the next one at the right rate; so
//! each round begins one rate later than the one before it that found nobody.

use timebase::Cycles;

use crate::config::{BAUD, BAUDS, LONGEST, Setting};
use crate::event::Event;

/// What is sent once the receiver is found, in this order; then
/// [`Setting::Forecasts`].
const SETTINGS: [Setting; 4] = [
    Setting::Rate,
    Setting::Message,
    Setting::Navigation,
    Setting::Pulse,
];

/// How often a setting is sent before the session goes on without its answer.
pub const TRIES: u8 = 3;

/// How long an answer is waited for. PX4 waits 250 ms (`PX4-GPSDrivers`, `ubx.h`);
/// at the factory's one epoch a second some receivers take longer.
const ANSWER: u64 = millis(400);

/// From the end of CFG-PRT to the first frame at our rate: the receiver changes
/// its rate after it has dealt with the frame.
const SETTLE: u64 = millis(100);

/// How long nothing readable may come before the receiver counts as lost.
pub const SILENCE: u64 = millis(3_000);

const fn millis(ms: u64) -> u64 {
    Cycles::from_micros(ms * 1_000).0
}

/// What the wiring has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action<'a> {
    /// Set the UART to so many baud, both ways, at once: everything handed out
    /// before has left.
    SetBaud(u32),
    /// Send these bytes, and call [`Session::handle_sent`] when the last of them
    /// has left the wire.
    Transmit(&'a [u8]),
}

/// What has happened to the configuration so far. Each wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionCounters {
    /// Rounds begun: 1 after a boot that goes well.
    pub rounds: u32,
    /// Attempts at a rate.
    pub attempts: u32,
    /// Settings accepted by the receiver.
    pub accepted: u32,
    /// Settings refused by the receiver.
    pub refused: u32,
    /// Times that no answer came to a setting once the receiver had been found.
    pub unanswered: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// An attempt begins: to its rate.
    Tune,
    /// CFG-PRT goes out.
    Knock,
    /// CFG-PRT is leaving.
    Knocking,
    /// Back to our rate.
    Return,
    /// The receiver changes its rate.
    Settling { until: Cycles },
    /// A setting goes out.
    Send,
    /// A setting is leaving.
    Sending,
    /// A setting's answer is due.
    Waiting { until: Cycles },
    /// Nothing is to be done unless nothing comes before `until`.
    Listening { until: Cycles },
}

/// The configuration session; see the [module](self).
#[derive(Clone, Debug)]
pub struct Session {
    state: State,
    /// The rate on both ends of the line.
    ours: u32,
    /// What the UART is set to.
    baud: u32,
    /// Which of [`BAUDS`] the attempt is for, with our rate in the place of [`BAUD`].
    rate: usize,
    /// Attempts of this round, this one included.
    attempts: usize,
    /// Which of [`SETTINGS`], or the one behind them, is at hand, and how often it has
    /// been sent.
    setting: usize,
    tries: u8,
    /// Whether forecasts are wanted, and whether the receiver was told so last.
    wants_forecasts: bool,
    told_forecasts: bool,
    /// When something readable last came in this round.
    heard: Option<Cycles>,
    buffer: [u8; LONGEST],
    counters: SessionCounters,
}

impl Default for Session {
    fn default() -> Self {
        Self::new()
    }
}

impl Session {
    /// A session for [`BAUD`] that begins its first round at once, on a UART at that rate.
    #[must_use]
    pub const fn new() -> Self {
        Self::at(BAUD)
    }

    /// The same for another of [`BAUDS`].
    #[must_use]
    pub const fn at(ours: u32) -> Self {
        Self {
            state: State::Tune,
            ours,
            baud: ours,
            rate: 0,
            attempts: 1,
            setting: 0,
            tries: 0,
            wants_forecasts: false,
            told_forecasts: false,
            heard: None,
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

    /// What has happened so far.
    #[must_use]
    pub const fn counters(&self) -> SessionCounters {
        self.counters
    }

    /// Whether the receiver has been found in this round and every setting has
    /// been answered or given up.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        matches!(self.state, State::Listening { .. }) && self.heard.is_some()
    }

    /// Says whether TIM-TP is wanted: while pulses come. Call [`Session::poll`]
    /// afterwards.
    pub const fn want_forecasts(&mut self, wanted: bool) {
        self.wants_forecasts = wanted;
    }

    /// What to do now, one thing a call: call until it is `None`, after each
    /// `handle_…` and when [`Session::poll_timeout`] has come.
    pub fn poll(&mut self, now: Cycles) -> Option<Action<'_>> {
        loop {
            match self.state {
                State::Tune => {
                    self.state = State::Knock;
                    if let Some(action) = self.tune(self.rate()) {
                        return Some(action);
                    }
                }
                State::Knock => {
                    self.state = State::Knocking;
                    count(&mut self.counters.attempts);
                    return Some(self.transmit(Setting::Port));
                }
                State::Return => {
                    let until = now.plus(SETTLE);
                    self.state = State::Settling { until };
                    if let Some(action) = self.tune(self.ours) {
                        return Some(action);
                    }
                }
                State::Send => {
                    let Some(setting) = self.setting() else {
                        let until = self.heard.unwrap_or(now).plus(SILENCE);
                        self.state = State::Listening { until };
                        continue;
                    };
                    if let Setting::Forecasts { on } = setting {
                        self.told_forecasts = on;
                    }
                    self.state = State::Sending;
                    self.tries = self.tries.wrapping_add(1);
                    return Some(self.transmit(setting));
                }
                State::Settling { until } if now >= until => self.begin_settings(),
                State::Waiting { until } if now >= until => self.no_answer(now),
                State::Listening { until } if now >= until => self.begin_round(),
                State::Listening { .. } if self.has_to_tell_forecasts() => {
                    (self.setting, self.tries) = (SETTINGS.len(), 0);
                    self.state = State::Send;
                }
                _ => return None,
            }
        }
    }

    /// When to call [`Session::poll`] again if nothing happens before; `None` while
    /// bytes are leaving.
    #[must_use]
    pub const fn poll_timeout(&self) -> Option<Cycles> {
        match self.state {
            State::Settling { until } | State::Waiting { until } | State::Listening { until } => {
                Some(until)
            }
            _ => None,
        }
    }

    /// The last bit of what [`Action::Transmit`] handed out has left the wire.
    pub fn handle_sent(&mut self, now: Cycles) {
        match self.state {
            State::Knocking => self.state = State::Return,
            State::Sending => {
                let until = now.plus(ANSWER);
                self.state = State::Waiting { until };
            }
            _ => {}
        }
    }

    /// Something readable has come from the receiver: every [`Event`] goes here.
    pub fn handle_event(&mut self, now: Cycles, event: &Event) {
        self.heard = Some(now);
        match self.state {
            // Frames arrive: no attempt.
            State::Tune => self.begin_settings(),
            State::Listening { .. } => {
                let until = now.plus(SILENCE);
                self.state = State::Listening { until };
            }
            State::Waiting { .. } => {
                let awaited = self.setting().map(Setting::message);
                match *event {
                    Event::Ack { class, id } if awaited == Some((class, id)) => {
                        count(&mut self.counters.accepted);
                        self.next_setting();
                    }
                    Event::Nak { class, id } if awaited == Some((class, id)) => {
                        count(&mut self.counters.refused);
                        self.next_setting();
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }

    /// The setting at hand; `None` behind the last.
    fn setting(&self) -> Option<Setting> {
        let last = Setting::Forecasts {
            on: self.wants_forecasts,
        };
        SETTINGS.iter().chain([&last]).nth(self.setting).copied()
    }

    const fn has_to_tell_forecasts(&self) -> bool {
        self.heard.is_some() && self.wants_forecasts != self.told_forecasts
    }

    /// The wait for an answer is over.
    fn no_answer(&mut self, now: Cycles) {
        if self.heard.is_some() {
            count(&mut self.counters.unanswered);
            if self.tries < TRIES {
                self.state = State::Send;
            } else {
                self.next_setting();
            }
        } else if self.attempts < BAUDS.len() {
            self.attempts = self.attempts.wrapping_add(1);
            self.next_rate();
            self.state = State::Tune;
        } else {
            let until = now.plus(SILENCE);
            self.state = State::Listening { until };
        }
    }

    fn begin_round(&mut self) {
        count(&mut self.counters.rounds);
        if self.heard.take().is_some() {
            self.rate = 0;
        } else {
            // Past the last of the round before, and past its first.
            self.next_rate();
            self.next_rate();
        }
        self.attempts = 1;
        self.state = State::Tune;
    }

    /// The rate that the attempt is for: ours has changed places with [`BAUD`].
    fn rate(&self) -> u32 {
        match BAUDS.get(self.rate).copied().unwrap_or(BAUD) {
            BAUD => self.ours,
            ours if ours == self.ours => BAUD,
            other => other,
        }
    }

    const fn next_rate(&mut self) {
        let next = self.rate.wrapping_add(1);
        self.rate = if next < BAUDS.len() { next } else { 0 };
    }

    const fn begin_settings(&mut self) {
        (self.setting, self.tries) = (0, 0);
        self.state = State::Send;
    }

    const fn next_setting(&mut self) {
        (self.setting, self.tries) = (self.setting.wrapping_add(1), 0);
        self.state = State::Send;
    }

    fn tune(&mut self, baud: u32) -> Option<Action<'static>> {
        let other = self.baud != baud;
        self.baud = baud;
        other.then_some(Action::SetBaud(baud))
    }

    fn transmit(&mut self, setting: Setting) -> Action<'_> {
        let length = setting.write(self.ours, &mut self.buffer);
        Action::Transmit(self.buffer.get(..length).unwrap_or_default())
    }
}

const fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
