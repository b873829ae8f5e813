//! The GNSS task: bytes in, marks to the clock, and the receiver's configuration.

use embassy_futures::select::select;
use embassy_time::{Instant, Timer};
use timebase::{CORE_HZ, Cycles, TimeMark};
use ubx_link::{Action, Event, Fix, Link, Session};
use utc_clock::{Outcome, Settings, UtcClock};

use crate::drivers::time;
use crate::drivers::uart::{INCOMING, Reader, Writer};
use crate::settings;
use crate::shared::{CLOCK, GNSS, GnssReport, NEWS};

/// From report to report, in cycles: 1 s.
const REPORT_EVERY: u64 = CORE_HZ as u64;

/// How often it is looked whether a frame has left the wire, in cycles: 1 ms. Only
/// while the receiver is being configured.
const LOOK_EVERY: u64 = CORE_HZ as u64 / 1_000;

// All that the ring holds fits at once.
const _: () = assert!(INCOMING <= Link::ROOM);

/// Runs for ever, on the prompt executor.
#[embassy_executor::task]
pub async fn run(mut reader: Reader, mut writer: Writer) {
    let mut receiver = Receiver::new();
    let mut report_due = Cycles::BOOT;
    loop {
        let now = time::now();
        receiver.listen(&mut reader, now);
        receiver.configure(&mut writer, now);
        receiver.clock.handle_timeout(now);
        if now >= report_due {
            report_due = now.plus(REPORT_EVERY);
            GNSS.tell(receiver.report(&reader));
        }
        let due = receiver.poll_timeout(now).min(report_due);
        select(reader.wait(), Timer::at(first_instant_after(due))).await;
    }
}

/// The state machines that the receiver's bytes go through.
struct Receiver {
    link: Link,
    session: Session,
    clock: UtcClock<'static>,
    /// A frame of the session's is on its way out.
    is_sending: bool,
    /// The last solution, and when it arrived.
    fix: Option<(Cycles, Fix)>,
}

impl Receiver {
    fn new() -> Self {
        let settings = Settings {
            latency_ns: settings::LATENCY_NS,
            ..Settings::DEFAULT
        };
        Self {
            link: Link::new(),
            session: Session::new(),
            clock: UtcClock::new(settings, &CLOCK),
            is_sending: false,
            fix: None,
        }
    }

    /// Takes what has come in.
    fn listen(&mut self, reader: &mut Reader, now: Cycles) {
        reader.take(|bytes| {
            self.link.hear(bytes);
        });
        while let Some(event) = self.link.poll(now) {
            self.session.handle_event(now, &event);
            if let Event::NavPvt { mark, fix } = event {
                self.fix = Some((mark.arrival, fix));
                follow(&mut self.clock, &mark);
            }
        }
    }

    /// Does what the session asks for.
    fn configure(&mut self, writer: &mut Writer, now: Cycles) {
        if self.is_sending && writer.is_idle() {
            self.is_sending = false;
            self.session.handle_sent(now);
        }
        while let Some(action) = self.session.poll(now) {
            match action {
                Action::SetBaud(baud) => writer.set_baud(baud),
                Action::Transmit(frame) => {
                    writer.send(frame);
                    self.is_sending = true;
                }
            }
        }
    }

    /// When one of the state machines has to be asked again.
    fn poll_timeout(&self, now: Cycles) -> Cycles {
        let mut due = self.clock.poll_timeout();
        if self.is_sending {
            due = due.min(now.plus(LOOK_EVERY));
        }
        for timeout in [self.session.poll_timeout(), self.link.poll_timeout(now)] {
            due = timeout.map_or(due, |timeout| due.min(timeout));
        }
        due
    }

    fn report(&self, reader: &Reader) -> GnssReport {
        GnssReport {
            link: self.link.counters(),
            session: self.session.counters(),
            clock: self.clock.counters(),
            line: reader.errors(),
            fix: self.fix,
        }
    }
}

/// Gives a mark to the clock, and tells what came of it.
fn follow(clock: &mut UtcClock<'static>, mark: &TimeMark) {
    let outcome = clock.handle_mark(mark, time::now());
    match outcome {
        Outcome::Set => defmt::info!("the clock is set"),
        Outcome::Stepped { by_ns } => defmt::warn!("the clock steps by {=i64} ns", by_ns),
        Outcome::Slewed { .. } | Outcome::Refused(_) => return,
    }
    // A full queue means that nobody listens; the log has it.
    let _ = NEWS.try_send(outcome);
}

/// The first of embassy's µs that is not earlier than `time`.
fn first_instant_after(time: Cycles) -> Instant {
    Instant::from_micros(time.as_micros().saturating_add(1))
}
