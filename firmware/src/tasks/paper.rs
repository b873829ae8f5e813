//! The GNSS task in the paper's variants: PX4 1.9's poll, sleep, read, parse, set the clock.
//!
//! *Purpose.* What the paper's boards did with the receiver's bytes, on the same board as ours.
//!
//! *Design.* `pollOrRead` of PX4's `src/drivers/gps/gps.cpp`: once bytes are seen, the task
//! sleeps as [`Wait`] says, in whole ticks, reads what is there by then, and each NAV-PVT in it
//! sets the clock as of the last tick ([`PaperClock`]). Framing and configuration are those of
//! [`gnss`](super::gnss), so that the receiver says the same at the same moments in each variant.
//!
//! *Limits.* What costs a PX4 more is left out, in its favour: the dozens of other tasks; the
//! other messages that it asks the receiver for; that a read sees the DMA's bytes only as of its
//! last look, up to a ms ago. What comes over the pulse's wire is not listened to.

use embassy_futures::select::{Either, select};
use embassy_time::{Instant, Timer};
use paper_clock::{Outcome, PaperClock, Wait, wakes_at};
use timebase::Cycles;
use ubx_link::{Event, Fix, Link};
use utc_clock::Ppb;
use variant::Variant;

use super::configuration::Configuration;
use super::gnss::{REPORT_EVERY, first_instant_after, tell};
use crate::drivers::pulse::EdgeCounters;
use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::settings::{GPS_BAUD, VARIANT};
use crate::shared::{BASE_TIME, ClockEvent, GNSS, GnssReport};

/// Between poll and read.
const WAIT: Wait = match VARIANT {
    Variant::PaperStep1 | Variant::PaperStep2 { .. } => Wait::Constant,
    Variant::PaperDefault | Variant::Pixclock { .. } => Wait::ForCharacters { baud: GPS_BAUD },
};

/// Runs for ever, on the prompt executor.
#[embassy_executor::task]
pub async fn run(mut reader: Reader, mut writer: Writer) {
    let mut receiver = Receiver {
        link: Link::new(),
        configuration: Configuration::new(),
        clock: PaperClock::new(),
        fix: None,
    };
    let mut report_due = Cycles::BOOT;
    loop {
        let now = time::now();
        receiver.configuration.drive(&mut writer, now);
        if now >= report_due {
            report_due = now.plus(REPORT_EVERY);
            GNSS.tell(receiver.report(&reader));
        }
        let due = receiver
            .poll_timeout(now)
            .unwrap_or(report_due)
            .min(report_due);
        let timer = Timer::at(first_instant_after(due));
        if let Either::First(()) = select(reader.wait(), timer).await
            && let Some(us) = WAIT.before_read(reader.waiting())
        {
            let wakes_at = wakes_at(time::last_tick(), us, time::TICK_PERIOD);
            // A tick is a whole number of µs.
            Timer::at(Instant::from_micros(wakes_at.as_micros())).await;
        }
        receiver.read(&mut reader);
    }
}

/// The state machines that the receiver's bytes go through.
struct Receiver {
    link: Link,
    configuration: Configuration,
    clock: PaperClock,
    /// The last solution, and when it arrived.
    fix: Option<(Cycles, Fix)>,
}

impl Receiver {
    /// Takes what has come in, and sets the clock by it.
    fn read(&mut self, reader: &mut Reader) {
        reader.take(|bytes| {
            self.link.push(bytes);
        });
        let now = time::now();
        while let Some(event) = self.link.poll(now) {
            self.configuration.handle_event(now, &event);
            if let Event::NavPvt { mark, fix } = event {
                self.fix = Some((mark.arrival, fix));
                let outcome = self.clock.handle_mark(&mark, time::last_tick());
                BASE_TIME.tell(self.clock.base_time());
                if outcome == Outcome::Set {
                    defmt::info!("the clock is set");
                    tell(ClockEvent::Set);
                }
            }
        }
    }

    /// When one of the state machines has to be asked again.
    fn poll_timeout(&self, now: Cycles) -> Option<Cycles> {
        let timeouts = [
            self.configuration.poll_timeout(now),
            self.link.poll_timeout(now),
        ];
        timeouts.into_iter().flatten().min()
    }

    fn report(&self, reader: &Reader) -> GnssReport {
        GnssReport {
            link: self.link.counters(),
            session: self.configuration.counters(),
            clock: self.clock.counters(),
            line: reader.errors(),
            edges: EdgeCounters::default(),
            source: self.clock.source(),
            frequency: Ppb(0),
            fix: self.fix,
        }
    }
}
