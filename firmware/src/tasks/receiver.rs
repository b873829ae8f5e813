//! The receiver's line and its configuration: what the GNSS tasks of all variants share.
//!
//! *Design.* [`Receiver`] has everything between the line and the clock, so that the receiver is
//! configured alike, and sends the same, in every variant. When to read the line, and what to do
//! with a mark, is up to the task.

use embassy_time::Instant;
use timebase::{CORE_HZ, Cycles, Fix};
use ubx_link::{Event, Finding, Link};

use super::configuration::Configuration;
use crate::clock_events::{self, ClockEvent};
use crate::drivers::uart::{INCOMING, Reader, Writer};
use crate::reports::ReceiverReport;
use crate::settings;

/// From report to report, in cycles: 1 s.
pub const REPORT_EVERY: u64 = CORE_HZ as u64;

// `take` must find room for all that the ring holds.
const _: () = assert!(INCOMING <= Link::ROOM);

/// The state machines that the receiver's bytes go through, with the ends of its line.
pub struct Receiver {
    reader: Reader,
    writer: Writer,
    link: Link,
    configuration: Configuration,
    /// The last solution, and when it arrived.
    fix: Option<(Cycles, Fix)>,
    #[cfg(stanag)]
    epoch: Option<(timebase::CivilTime, timebase::Validity)>,
}

impl Receiver {
    /// The receiver at that line, not configured yet.
    pub fn new((reader, writer): (Reader, Writer)) -> Self {
        Self {
            reader,
            writer,
            link: Link::at(settings::GPS_BAUD),
            configuration: Configuration::new(),
            fix: None,
            #[cfg(stanag)]
            epoch: None,
        }
    }

    /// Tries the receiver at this rate, in baud. What was on its way is lost.
    pub fn try_rate(&mut self, baud: u32) {
        self.writer.set_baud(baud);
        self.link.handle_baud(baud);
        self.configuration = Configuration::trying(baud);
    }

    /// Waits until bytes are there.
    pub async fn wait(&mut self) {
        self.reader.wait().await;
    }

    /// The number of bytes that are there.
    pub fn waiting(&self) -> usize {
        self.reader.waiting()
    }

    /// Takes the bytes that are there. After that, [`Self::poll`] until it returns `None`.
    pub fn take(&mut self, now: Cycles) {
        self.reader.take(|bytes| {
            self.link.push(bytes);
            self.configuration.handle_bytes(now, bytes);
        });
    }

    /// The next message in the bytes that were taken.
    #[inline]
    pub fn poll(&mut self, now: Cycles) -> Option<Event> {
        let Some(mut event) = self.link.poll(now) else {
            if let Some(what) = self.link.poll_unwanted() {
                self.configuration.handle_unwanted(now, what);
            }
            return None;
        };
        self.configuration.handle_event(now, &mut event);
        if let Event::NavPvt { mark, fix } = &event {
            self.fix = Some((mark.arrival, *fix));
            #[cfg(stanag)]
            {
                self.epoch = Some((mark.epoch, mark.validity));
            }
        }
        Some(event)
    }

    /// NAV-TIMELS is wanted once. Before [`Self::configure`].
    pub const fn handle_leap_seconds_wanted(&mut self) {
        self.configuration.handle_leap_seconds_wanted();
    }

    /// How long the receiver's pulse is high; `None` while it has not acknowledged that. [µs]
    pub const fn pulse_width_us(&self) -> Option<u32> {
        self.configuration.pulse_width_us()
    }

    /// Sets whether the receiver is to forecast its pulse. Before [`Self::configure`].
    pub const fn handle_forecasts_wanted(&mut self, wanted: bool) {
        self.configuration.handle_forecasts_wanted(wanted);
    }

    /// Goes on with the receiver's configuration.
    pub fn configure(&mut self, now: Cycles) {
        if let Some(baud) = self.configuration.drive(&mut self.writer, now) {
            self.link.handle_baud(baud);
        }
        while let Some(setting) = self.configuration.poll_refusal() {
            let (class, id) = setting.subject();
            defmt::warn!(
                "the receiver refuses {=str} ({=u8:02x}-{=u8:02x})",
                setting.name(),
                class,
                id
            );
            clock_events::push(ClockEvent::Refused(setting));
        }
        if let Some(finding) = self.configuration.poll_finding() {
            log(finding);
            clock_events::push(ClockEvent::Receiver(finding));
        }
    }

    /// When to call [`Self::poll`] and [`Self::configure`] again if no byte comes.
    pub fn poll_timeout(&self, now: Cycles) -> Option<Cycles> {
        let timeouts = [
            self.configuration.poll_timeout(now),
            self.link.poll_timeout(now),
        ];
        timeouts.into_iter().flatten().min()
    }

    /// What came over the line so far.
    pub fn report(&self) -> ReceiverReport {
        ReceiverReport {
            link: self.link.counters(),
            session: self.configuration.counters(),
            finding: self.configuration.finding(),
            line: self.reader.errors(),
            fix: self.fix,
            #[cfg(stanag)]
            epoch: self.epoch,
        }
    }
}

/// What is new about the receiver, into the log.
fn log(finding: Finding) {
    match finding {
        Finding::Searching => {}
        Finding::Silent => defmt::warn!("no receiver answers"),
        Finding::Unnamed => defmt::warn!("the receiver does not say what it is"),
        Finding::Used(identity) => defmt::info!(
            "the receiver is {=str}, {=str}, protocol {=u16}/100",
            identity.model(),
            identity.firmware(),
            identity.protocol()
        ),
        Finding::Unused(identity, why) => defmt::warn!(
            "the receiver is {=str} and not used: {=str}",
            identity.model(),
            why.reason()
        ),
    }
}

/// The first of embassy's µs that is not earlier than `time`.
pub fn first_instant_after(time: Cycles) -> Instant {
    Instant::from_micros(time.as_micros().saturating_add(1))
}
