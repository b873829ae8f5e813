//! The configuration session: what is sent to the receiver, when, and at which rate.
//!
//! *Purpose.* A receiver with any settings is brought to our rate and NAV-PVT alone, and again
//! after it has restarted; with TIM-TP beside it while forecasts of the pulse are wanted.
//!
//! *Design.* A state machine without I/O. [`Session::poll`] returns what to do next. The caller
//! does it, passes on every event of the receiver ([`Session::handle_event`]), and reports when the
//! last bit has left ([`Session::handle_sent`]): before that the session does nothing, and above
//! all does not change the rate.
//!
//! An *attempt* sends CFG-PRT at one rate, changes to ours, gives the receiver time to do the same,
//! and sends the first setting there. The answer to CFG-PRT is not waited for, because its rate is
//! not defined. If any event comes, the receiver is found, and the other settings follow, each
//! until it is answered or has been sent [`Session::TRIES`] times. Whether TIM-TP is wanted is the
//! last of them, and is sent again when it changes. It comes on request only, since a burst should
//! begin with NAV-PVT. What comes and is not used is switched off as it comes
//! ([`Session::handle_unwanted`]). What the receiver refuses [`Session::TRIES`] times is reported
//! ([`Session::poll_refusal`]) and not asked again before it is found anew. If no event comes, the next
//! attempt takes the next rate of [`BAUDS`]. After a *round* of all of them the session waits for
//! [`Session::SILENCE`]. While events come, no rate is tried: only silence of that length begins a
//! new round.
//!
//! NAV-TIMELS is polled on request ([`Session::handle_leap_seconds_wanted`]), one at a time. The receiver
//! answers in the order of its queue, so that what comes behind an answer was made after its poll: it
//! waited no longer than since then, even on a line that is full ([`Session::limit_wait`]).
//!
//! *Whose pulse.* A width is the receiver's as soon as it has acknowledged CFG-TP5, however late that
//! comes, and until it is lost ([`Session::pulse_width_us`]).
//!
//! *Limits.* A receiver that sends at our rate but does not receive us is left as it is. After more
//! than 100 framing errors in a second an M8 ignores its line for the rest of it (it reports "More
//! than 100 frame errors, UART RX was disabled"), so an attempt at a wrong rate may spoil the next
//! one at the right rate. Therefore a round that follows one without success begins one rate later.
//! The answer to a poll is taken for the last one's: a queue of more than 10 s is not bounded.

use timebase::Cycles;

use crate::config::{BAUD, BAUDS, LONGEST, POLL_LEAP_SECONDS, PULSE_WIDTH_US, Setting};
use crate::event::Event;
use crate::unwanted::{PAUSE, Table, Unwanted};

/// What is sent once the receiver is found, in this order; then
/// [`Setting::Forecasts`].
const SETTINGS: [Setting; 4] = [
    Setting::Rate,
    Setting::Message,
    Setting::Navigation,
    Setting::Pulse,
];

/// How long an answer is waited for, in cycles: 400 ms. PX4 waits 250 ms (`PX4-GPSDrivers`,
/// `ubx.h`); at the factory's one epoch a second some receivers take longer.
const ANSWER: u64 = millis(400);

/// From the end of CFG-PRT to the first frame at our rate, in cycles: 100 ms. The receiver changes
/// its rate after it has processed the frame.
const SETTLE: u64 = millis(100);

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
    /// CFG-PRT is to be sent.
    SendPort,
    /// CFG-PRT is leaving.
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

/// The configuration session; see the [module](self).
#[derive(Clone, Debug)]
pub struct Session {
    state: State,
    /// The rate that both ends of the line are to have, in baud.
    own_baud: u32,
    /// The present rate of the UART, in baud.
    baud: u32,
    /// Which of [`BAUDS`] the attempt is for, with our rate in the place of [`BAUD`].
    rate: usize,
    /// Attempts of this round, this one included.
    attempts: usize,
    /// The present one of [`SETTINGS`]; behind them is [`Setting::Forecasts`], and then `off`.
    setting: usize,
    /// What switches off a message that has come.
    off: Option<Setting>,
    /// How often the present setting has been sent.
    tries: u8,
    /// Whether forecasts are wanted.
    wants_forecasts: bool,
    /// What was last sent about forecasts.
    sent_forecasts: bool,
    unwanted: Table,
    /// A setting that was refused, until it is asked for.
    refusal: Option<Setting>,
    has_acknowledged_pulse: bool,
    leap_seconds: Poll,
    /// When the last event of this round came.
    last_event: Option<Cycles>,
    buffer: [u8; LONGEST],
    counters: SessionCounters,
}

/// The polls of NAV-TIMELS.
#[derive(Clone, Copy, Debug)]
struct Poll {
    is_wanted: bool,
    /// When the one began to leave whose answer is awaited.
    sent: Option<Cycles>,
    /// When the one began to leave that was answered last.
    answered: Option<Cycles>,
    /// From then on a NAV-TIMELS is the answer to a poll: none has come by itself for so long.
    answers_from: Cycles,
}

impl Poll {
    const NONE: Self = Self {
        is_wanted: false,
        sent: None,
        answered: None,
        answers_from: Cycles(PAUSE),
    };

    /// When the next one may leave: the answer to the one before may still be on its way.
    fn may_leave(&self) -> Cycles {
        self.sent.map_or(Cycles::BOOT, |sent| sent.plus(PAUSE))
    }

    /// Takes a NAV-TIMELS; whether it is an answer.
    fn handle_answer(&mut self, now: Cycles) -> bool {
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

    /// The same for another of [`BAUDS`].
    #[must_use]
    pub const fn at(own_baud: u32) -> Self {
        Self {
            state: State::SetOtherRate,
            own_baud,
            baud: own_baud,
            rate: 0,
            attempts: 1,
            setting: 0,
            off: None,
            tries: 0,
            wants_forecasts: false,
            sent_forecasts: false,
            unwanted: Table::new(),
            refusal: None,
            has_acknowledged_pulse: false,
            leap_seconds: Poll::NONE,
            last_event: None,
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

    /// A session that asks for the settings at `baud`, where the UART is already, and sends no CFG-PRT: for a
    /// caller that tries rates itself. After [`Self::SILENCE`] it looks for the receiver as any other.
    #[must_use]
    pub const fn trying(baud: u32) -> Self {
        Self {
            state: State::SendSetting,
            attempts: BAUDS.len(),
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
        matches!(self.state, State::Listening { .. }) && self.last_event.is_some()
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
        if self.has_acknowledged_pulse {
            Some(PULSE_WIDTH_US)
        } else {
            None
        }
    }

    /// Lowers how long the line had been busy before an event to what a poll proves: what arrives
    /// behind an answer was made after its poll. After [`Self::handle_event`].
    #[inline]
    pub fn limit_wait(&self, event: &mut Event) {
        let Some(asked) = self.leap_seconds.answered else {
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

    /// What to do now, one thing a call. Call until it is `None`, after each `handle_…` and at
    /// [`Self::poll_timeout`].
    #[inline(never)]
    pub fn poll(&mut self, now: Cycles) -> Option<Action<'_>> {
        loop {
            match self.state {
                State::SetOtherRate => {
                    self.state = State::SendPort;
                    if let Some(action) = self.set_baud(self.rate()) {
                        return Some(action);
                    }
                }
                State::SendPort => {
                    self.state = State::SendingPort;
                    count(&mut self.counters.attempts);
                    return Some(self.transmit(Setting::Port));
                }
                State::SetOwnRate => {
                    let until = now.plus(SETTLE);
                    self.state = State::Settling { until };
                    if let Some(action) = self.set_baud(self.own_baud) {
                        return Some(action);
                    }
                }
                State::SendSetting => {
                    let Some(setting) = self.setting() else {
                        self.listen(now);
                        continue;
                    };
                    if let Setting::Forecasts { on } = setting {
                        self.sent_forecasts = on;
                    }
                    self.state = State::SendingSetting;
                    self.tries = self.tries.wrapping_add(1);
                    return Some(self.transmit(setting));
                }
                State::Settling { until } if now >= until => self.begin_settings(),
                State::Waiting { until } if now >= until => self.no_answer(now),
                State::Listening { until } if now >= until => self.begin_round(now),
                State::Listening { .. } if self.has_to_send_forecasts() => {
                    (self.setting, self.tries) = (SETTINGS.len(), 0);
                    self.state = State::SendSetting;
                }
                State::Listening { .. } if self.last_event.is_some() => {
                    self.off = self.unwanted.poll_off(now);
                    if self.off.is_some() {
                        (self.setting, self.tries) = (SETTINGS.len() + 1, 0);
                        self.state = State::SendSetting;
                    } else if self.leap_seconds.is_wanted && now >= self.leap_seconds.may_leave() {
                        self.leap_seconds.is_wanted = false;
                        self.leap_seconds.sent = Some(now);
                        self.state = State::SendingPoll;
                        return Some(Action::Transmit(&POLL_LEAP_SECONDS));
                    } else {
                        return None;
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
            State::Listening { until } if self.leap_seconds.is_wanted && self.is_done() => {
                Some(until.min(self.leap_seconds.may_leave()))
            }
            State::Settling { until } | State::Waiting { until } | State::Listening { until } => {
                Some(until)
            }
            _ => None,
        }
    }

    /// The last bit of what [`Action::Transmit`] handed out has left the wire.
    pub fn handle_sent(&mut self, now: Cycles) {
        match self.state {
            State::SendingPort => self.state = State::SetOwnRate,
            State::SendingSetting => {
                let until = now.plus(ANSWER);
                self.state = State::Waiting { until };
            }
            State::SendingPoll => self.listen(now),
            _ => {}
        }
    }

    /// The receiver has sent this: to be called for every [`Event`].
    #[inline(never)]
    pub fn handle_event(&mut self, now: Cycles, event: &Event) {
        self.last_event = Some(now);
        let pulse = Setting::Pulse.message();
        match *event {
            Event::Ack { class, id } if (class, id) == pulse => self.has_acknowledged_pulse = true,
            Event::Nak { class, id } if (class, id) == pulse => self.has_acknowledged_pulse = false,
            Event::LeapSeconds(_) if !self.leap_seconds.handle_answer(now) => {
                let (class, id) = NAV_TIMELS;
                self.handle_unwanted(now, Unwanted::Ubx { class, id });
            }
            _ => {}
        }
        match self.state {
            // No attempt is needed: its rate is ours.
            State::SetOtherRate => self.begin_settings(),
            State::Listening { .. } => {
                let until = now.plus(Self::SILENCE);
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
                        self.handle_refused();
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }

    /// The present setting; `None` behind the last.
    fn setting(&self) -> Option<Setting> {
        let last = Setting::Forecasts {
            on: self.wants_forecasts,
        };
        let all = SETTINGS.iter().copied().chain([last]).chain(self.off);
        all.into_iter().nth(self.setting)
    }

    /// The present setting was refused once more.
    fn handle_refused(&mut self) {
        if self.tries < Self::TRIES {
            self.state = State::SendSetting;
            return;
        }
        self.refusal = self.setting();
        if let Some(off) = self.off {
            self.unwanted.handle_refused(off);
        }
        self.next_setting();
    }

    fn listen(&mut self, now: Cycles) {
        let until = self.last_event.unwrap_or(now).plus(Self::SILENCE);
        self.state = State::Listening { until };
    }

    const fn has_to_send_forecasts(&self) -> bool {
        self.last_event.is_some() && self.wants_forecasts != self.sent_forecasts
    }

    /// The wait for an answer is over.
    #[cold]
    fn no_answer(&mut self, now: Cycles) {
        if self.last_event.is_some() {
            count(&mut self.counters.unanswered);
            if self.tries < Self::TRIES {
                self.state = State::SendSetting;
            } else {
                self.next_setting();
            }
        } else if self.attempts < BAUDS.len() {
            self.attempts = self.attempts.wrapping_add(1);
            self.next_rate();
            self.state = State::SetOtherRate;
        } else {
            let until = now.plus(Self::SILENCE);
            self.state = State::Listening { until };
        }
    }

    #[cold]
    fn begin_round(&mut self, now: Cycles) {
        count(&mut self.counters.rounds);
        self.unwanted = Table::new();
        self.has_acknowledged_pulse = false;
        self.leap_seconds = Poll {
            is_wanted: self.leap_seconds.is_wanted,
            answers_from: now.plus(PAUSE),
            ..Poll::NONE
        };
        if self.last_event.take().is_some() {
            self.rate = 0;
        } else {
            // Beyond the last rate of the round before, and beyond its first.
            self.next_rate();
            self.next_rate();
        }
        self.attempts = 1;
        self.state = State::SetOtherRate;
    }

    /// The rate that the attempt is for, in baud: our rate and [`BAUD`] change places.
    fn rate(&self) -> u32 {
        match BAUDS.get(self.rate).copied().unwrap_or(BAUD) {
            BAUD => self.own_baud,
            own if own == self.own_baud => BAUD,
            other => other,
        }
    }

    const fn next_rate(&mut self) {
        let next = self.rate.wrapping_add(1);
        self.rate = if next < BAUDS.len() { next } else { 0 };
    }

    const fn begin_settings(&mut self) {
        (self.setting, self.tries) = (0, 0);
        self.state = State::SendSetting;
    }

    const fn next_setting(&mut self) {
        self.off = None;
        (self.setting, self.tries) = (self.setting.wrapping_add(1), 0);
        self.state = State::SendSetting;
    }

    fn set_baud(&mut self, baud: u32) -> Option<Action<'static>> {
        let other = self.baud != baud;
        self.baud = baud;
        other.then_some(Action::SetBaud(baud))
    }

    fn transmit(&mut self, setting: Setting) -> Action<'_> {
        let length = setting.write(self.own_baud, &mut self.buffer);
        Action::Transmit(self.buffer.get(..length).unwrap_or_default())
    }
}

const fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
