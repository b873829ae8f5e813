//! The GNSS task: the receiver's messages and pulses go to the clock.

use embassy_futures::select::select3;
use embassy_time::Timer;
use fault_record::Hang;
use timebase::{CORE_HZ, Cycles, TimeMark};
use ubx_link::Event;
use utc_clock::{Outcome, PulseOutcome, Settings, UtcClock};

use super::receiver::{REPORT_EVERY, Receiver, first_instant_after};
use crate::clock::CLOCK;
use crate::clock_events::{self, ClockEvent};
use crate::clock_news::ClockNews;
use crate::drivers::pulse::{AT_MOST_OFF_NS, Pulse};
use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::reports::{GNSS, GnssReport};
use crate::supervision::{self, no_later};
use crate::{image_words, settings};

/// The receiver is to forecast its pulse for this time after an edge, in cycles: 10 s.
const FORECASTS_FOR: u64 = 10 * CORE_HZ as u64;

/// Runs forever, on the high executor.
#[embassy_executor::task]
pub async fn run(line: (Reader, Writer), pulse: Pulse) {
    let mut gnss = Gnss::new(line, pulse);
    let mut report_due = Cycles::BOOT;
    loop {
        supervision::came_by(Hang::Gnss);
        let now = time::now();
        gnss.handle_messages(now);
        gnss.handle_pulses();
        gnss.configure(now);
        gnss.clock.handle_timeout(now);
        gnss.note_news(now);
        if now >= report_due {
            report_due = now.plus(REPORT_EVERY);
            GNSS.set(gnss.report());
        }
        let due = gnss.poll_timeout(now).min(report_due);
        let timer = Timer::at(no_later(first_instant_after(due)));
        select3(gnss.receiver.wait(), gnss.pulse.wait(), timer).await;
    }
}

/// The receiver, its pulse, and the clock that they steer.
struct Gnss {
    receiver: Receiver,
    pulse: Pulse,
    clock: UtcClock<'static>,
    /// The last edge of the pulse's wire.
    edge: Option<Cycles>,
    news: ClockNews,
    /// The course that the news were noted of.
    noted: Cycles,
}

impl Gnss {
    fn new(line: (Reader, Writer), pulse: Pulse) -> Self {
        let Some(writer) = CLOCK.take_writer() else {
            panic!("the clock has a writer already");
        };
        let settings = Settings {
            // Where a recording has no NAV-TIMELS that would prove it.
            leap_seconds: image_words::leap_seconds(),
            date_floor: image_words::date_floor(),
            pulse_uncertainty_ns: Settings::DEFAULT.pulse_uncertainty_ns + AT_MOST_OFF_NS,
            ..Settings::DEFAULT.with_latency_ns(settings::LATENCY_NS)
        };
        Self {
            receiver: Receiver::new(line),
            pulse,
            clock: UtcClock::new(settings, writer),
            edge: None,
            news: ClockNews::new(),
            noted: Cycles::BOOT,
        }
    }

    /// Takes what came over the receiver's line.
    fn handle_messages(&mut self, now: Cycles) {
        self.receiver.take(now);
        while let Some(event) = self.receiver.poll(now) {
            match event {
                Event::NavPvt { mark, .. } => self.handle_mark(&mark),
                Event::TimTp(forecast) => self.clock.handle_forecast(&forecast),
                Event::LeapSeconds(received) => {
                    self.clock.handle_leap_seconds(&received, time::now());
                }
                Event::Ack { .. } | Event::Nak { .. } => {}
            }
        }
        self.clock
            .handle_pulse_width(self.receiver.pulse_width_us());
    }

    fn handle_mark(&mut self, mark: &TimeMark) {
        match self.clock.handle_mark(mark, time::now()) {
            Outcome::Set => {
                defmt::info!("the clock is set");
                clock_events::push(ClockEvent::Set);
            }
            Outcome::Stepped { by_ns } => push_step(by_ns),
            Outcome::Slewed { .. } | Outcome::Confirmed | Outcome::Refused(_) => {}
        }
    }

    /// Takes what came over the pulse's wire. After [`Self::handle_messages`]: a forecast comes
    /// before its pulse.
    fn handle_pulses(&mut self) {
        while let Some(edge) = self.pulse.take() {
            self.edge = Some(edge.at);
            if let PulseOutcome::Stepped { by_ns } = self.clock.handle_edge(&edge, time::now()) {
                push_step(by_ns);
            }
        }
    }

    /// Notes what is new about the clock, which shows with a new course only.
    fn note_news(&mut self, now: Cycles) {
        let course = self.clock.course_begins();
        if course != self.noted {
            self.noted = course;
            let state = CLOCK.reading_at(course.max(now)).state;
            self.news.note(&self.clock, state);
        }
    }

    /// Goes on with the receiver's configuration.
    fn configure(&mut self, now: Cycles) {
        let has_pulse = self.edge.is_some_and(|edge| edge.plus(FORECASTS_FOR) > now);
        self.receiver.handle_forecasts_wanted(has_pulse);
        if self.clock.poll_leap_seconds(now) {
            self.receiver.handle_leap_seconds_wanted();
        }
        self.receiver.configure(now);
    }

    /// When the loop has to come round again.
    fn poll_timeout(&self, now: Cycles) -> Cycles {
        let due = self.clock.poll_timeout();
        let of_receiver = self.receiver.poll_timeout(now);
        of_receiver.map_or(due, |timeout| due.min(timeout))
    }

    fn report(&self) -> GnssReport {
        GnssReport {
            receiver: self.receiver.report(),
            clock: self.clock.counters(),
            source: self.clock.source(),
            second: self.clock.second_proof(),
            frequency: self.clock.frequency(),
            edges: self.pulse.counters(),
        }
    }
}

fn push_step(by_ns: i64) {
    defmt::warn!("the clock steps by {=i64} ns", by_ns);
    clock_events::push(ClockEvent::Stepped { by_ns });
}
