//! The GNSS task: bytes and edges in, marks and pulses to the clock, and the
//! receiver's configuration.

use embassy_futures::select::select3;
use embassy_time::{Instant, Timer};
use timebase::{CORE_HZ, Cycles, TimeMark};
use ubx_link::{Event, Fix, Link};
use utc_clock::{Outcome, PulseOutcome, Settings, Source, UtcClock};

use super::configuration::Configuration;
use crate::drivers::pulse::Pulse;
use crate::drivers::time;
use crate::drivers::uart::{INCOMING, Reader, Writer};
use crate::settings;
use crate::shared::{CLOCK, CLOCK_EVENTS, ClockEvent, GNSS, GnssReport};

/// From report to report, in cycles: 1 s.
pub(super) const REPORT_EVERY: u64 = CORE_HZ as u64;

/// Forecasts of the pulse are wanted for so long after an edge, in cycles: 10 s.
const FORECASTS_FOR: u64 = 10 * CORE_HZ as u64;

// All that the ring holds fits at once.
const _: () = assert!(INCOMING <= Link::ROOM);

/// Runs for ever, on the prompt executor.
#[embassy_executor::task]
pub async fn run(mut reader: Reader, mut writer: Writer, mut pulse: Pulse) {
    let mut receiver = Receiver::new();
    let mut report_due = Cycles::BOOT;
    loop {
        let now = time::now();
        receiver.listen(&mut reader, now);
        receiver.watch(&mut pulse);
        receiver.configure(&mut writer, now);
        receiver.clock.handle_timeout(now);
        receiver.tell_source();
        if now >= report_due {
            report_due = now.plus(REPORT_EVERY);
            GNSS.tell(receiver.report(&reader, &pulse));
        }
        let due = receiver.poll_timeout(now).min(report_due);
        let timer = Timer::at(first_instant_after(due));
        select3(reader.wait(), pulse.wait(), timer).await;
    }
}

/// The state machines that the receiver's bytes go through.
struct Receiver {
    link: Link,
    configuration: Configuration,
    clock: UtcClock<'static>,
    /// The last solution, and when it arrived.
    fix: Option<(Cycles, Fix)>,
    /// The last edge of the pulse's wire.
    edge: Option<Cycles>,
    /// What steered the clock last.
    source: Source,
}

impl Receiver {
    fn new() -> Self {
        let settings = Settings::DEFAULT.with_latency_ns(settings::LATENCY_NS);
        Self {
            link: Link::new(),
            configuration: Configuration::new(),
            clock: UtcClock::new(settings, &CLOCK),
            fix: None,
            edge: None,
            source: Source::Nothing,
        }
    }

    /// Takes what has come in.
    fn listen(&mut self, reader: &mut Reader, now: Cycles) {
        reader.take(|bytes| {
            self.link.push(bytes);
        });
        while let Some(event) = self.link.poll(now) {
            self.configuration.handle_event(now, &event);
            match event {
                Event::NavPvt { mark, fix } => {
                    self.fix = Some((mark.arrival, fix));
                    self.follow(&mark);
                }
                Event::TimTp(forecast) => self.clock.handle_forecast(&forecast),
                Event::Ack { .. } | Event::Nak { .. } => {}
            }
        }
    }

    /// Gives a mark to the clock, and tells what came of it.
    fn follow(&mut self, mark: &TimeMark) {
        match self.clock.handle_mark(mark, time::now()) {
            Outcome::Set => {
                defmt::info!("the clock is set");
                tell(ClockEvent::Set);
            }
            Outcome::Stepped { by_ns } => tell_step(by_ns),
            Outcome::Slewed { .. } | Outcome::Confirmed | Outcome::Refused(_) => {}
        }
    }

    /// Takes what has come over the pulse's wire. After [`Self::listen`]: a forecast
    /// comes before its pulse.
    fn watch(&mut self, pulse: &mut Pulse) {
        while let Some(mark) = pulse.take() {
            self.edge = Some(mark.edge);
            if let PulseOutcome::Stepped { by_ns } = self.clock.handle_pulse(&mark, time::now()) {
                tell_step(by_ns);
            }
        }
    }

    /// Tells when the pulse begins to steer, or does not any more.
    fn tell_source(&mut self) {
        let before = core::mem::replace(&mut self.source, self.clock.source());
        match (before == Source::Pulse, self.source == Source::Pulse) {
            (false, true) => {
                defmt::info!("the pulse steers the clock");
                tell(ClockEvent::PulseFollowed);
            }
            (true, false) => {
                defmt::warn!("the pulse does not steer the clock any more");
                tell(ClockEvent::PulseLost);
            }
            _ => {}
        }
    }

    /// Goes on with the receiver's configuration.
    fn configure(&mut self, writer: &mut Writer, now: Cycles) {
        let has_pulse = self.edge.is_some_and(|edge| edge.plus(FORECASTS_FOR) > now);
        self.configuration.handle_forecasts_wanted(has_pulse);
        self.configuration.drive(writer, now);
    }

    /// When one of the state machines has to be asked again.
    fn poll_timeout(&self, now: Cycles) -> Cycles {
        let mut due = self.clock.poll_timeout();
        let of_configuration = self.configuration.poll_timeout(now);
        for timeout in [of_configuration, self.link.poll_timeout(now)] {
            due = timeout.map_or(due, |timeout| due.min(timeout));
        }
        due
    }

    fn report(&self, reader: &Reader, pulse: &Pulse) -> GnssReport {
        GnssReport {
            link: self.link.counters(),
            session: self.configuration.counters(),
            clock: self.clock.counters(),
            line: reader.errors(),
            edges: pulse.counters(),
            source: self.source,
            frequency: self.clock.frequency(),
            fix: self.fix,
        }
    }
}

fn tell_step(by_ns: i64) {
    defmt::warn!("the clock steps by {=i64} ns", by_ns);
    tell(ClockEvent::Stepped { by_ns });
}

pub(super) fn tell(news: ClockEvent) {
    // A full queue means that nobody listens; the log has it.
    let _ = CLOCK_EVENTS.try_send(news);
}

/// The first of embassy's µs that is not earlier than `time`.
pub(super) fn first_instant_after(time: Cycles) -> Instant {
    Instant::from_micros(time.as_micros().saturating_add(1))
}
