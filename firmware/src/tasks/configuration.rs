//! The receiver's configuration: between the session that knows what to send and the line.

use timebase::{CORE_HZ, Cycles, StampedByte};
use ubx_link::{Action, Event, Finding, Session, SessionCounters, Setting, Unwanted};

use crate::drivers::uart::Writer;
use crate::settings;

/// From look to look whether a frame has left the wire, in cycles: 1 ms. Only while the receiver is
/// being configured.
const LOOK_EVERY: u64 = CORE_HZ as u64 / 1_000;

/// The session, and whether a frame of its is on its way out.
pub struct Configuration {
    session: Session,
    is_sending: bool,
}

impl Configuration {
    /// Of a receiver that is to be brought to [`settings::GPS_BAUD`].
    pub const fn new() -> Self {
        Self {
            session: Session::at(settings::GPS_BAUD),
            is_sending: false,
        }
    }

    /// Of a receiver that is tried at this rate, in baud, where the line is already.
    pub const fn trying(baud: u32) -> Self {
        Self {
            session: Session::trying(baud),
            is_sending: false,
        }
    }

    /// Takes bytes of the receiver. Before the messages in them.
    #[inline]
    pub fn handle_bytes(&mut self, now: Cycles, bytes: &[StampedByte]) {
        if self.session.wants_bytes() {
            self.session.handle_bytes(now, bytes);
        }
    }

    /// Takes a message of the receiver, and lowers how long it may have waited to what is proved.
    #[inline]
    pub fn handle_event(&mut self, now: Cycles, event: &mut Event) {
        self.session.handle_event(now, event);
        self.session.limit_wait(event);
    }

    /// Takes a message that is not used. Before [`Self::drive`].
    #[inline]
    pub fn handle_unwanted(&mut self, now: Cycles, what: Unwanted) {
        self.session.handle_unwanted(now, what);
    }

    /// NAV-TIMELS is wanted once. Before [`Self::drive`].
    #[inline]
    pub const fn handle_leap_seconds_wanted(&mut self) {
        self.session.handle_leap_seconds_wanted();
    }

    /// The width of the pulse, in µs, once the receiver has acknowledged it.
    #[inline]
    pub const fn pulse_width_us(&self) -> Option<u32> {
        self.session.pulse_width_us()
    }

    /// The next setting that the receiver does not take.
    #[inline]
    pub const fn poll_refusal(&mut self) -> Option<Setting> {
        self.session.poll_refusal()
    }

    /// What is new about the receiver.
    #[inline]
    pub fn poll_finding(&mut self) -> Option<Finding> {
        self.session.poll_finding()
    }

    /// What is known of the receiver.
    pub const fn finding(&self) -> Finding {
        self.session.finding()
    }

    /// Sets whether the receiver is to forecast its pulse. Before [`Self::drive`].
    #[inline]
    pub const fn handle_forecasts_wanted(&mut self, wanted: bool) {
        self.session.handle_forecasts_wanted(wanted);
    }

    /// Does what the session asks for. The new rate of the line, in baud, if it changes.
    #[inline]
    pub fn drive(&mut self, writer: &mut Writer, now: Cycles) -> Option<u32> {
        let mut new_baud = None;
        if self.is_sending && writer.is_idle() {
            self.is_sending = false;
            self.session.handle_sent(now);
        }
        while let Some(action) = self.session.poll(now) {
            match action {
                Action::SetBaud(baud) => {
                    writer.set_baud(baud);
                    new_baud = Some(baud);
                }
                Action::Transmit(frame) => {
                    writer.send(frame);
                    self.is_sending = true;
                }
            }
        }
        new_baud
    }

    /// When to call [`Self::drive`] again if no byte comes.
    #[inline]
    pub fn poll_timeout(&self, now: Cycles) -> Option<Cycles> {
        if self.is_sending {
            // The session waits for nothing else meanwhile.
            return Some(now.plus(LOOK_EVERY));
        }
        self.session.poll_timeout()
    }

    /// What has happened so far.
    pub const fn counters(&self) -> SessionCounters {
        self.session.counters()
    }
}
