//! The GNSS task in the paper's variants: PX4 1.9's poll, sleep, read, parse, set the clock.
//!
//! *Purpose.* What the paper's boards did with the receiver's bytes, on the same board as pixclock.
//!
//! *Design.* `pollOrRead` of PX4's `src/drivers/gps/gps.cpp`: once there are bytes, the task sleeps as
//! [`Wait`] says, in whole ticks, and reads what is there by then. Each NAV-PVT in it sets the clock as
//! of the last tick ([`PaperClock`]). Framing and configuration are those of the other variant.
//!
//! *Limits.* What costs a PX4 more is left out, in its favour: its many other tasks; the other
//! messages that it asks the receiver for; that it sees the DMA's bytes up to 1 ms late. The pulse's
//! wire is not read.

use embassy_futures::select::{Either, select};
use embassy_time::{Instant, Timer};
use fault_record::Hang;
use paper_clock::{Outcome, PaperClock, Wait, wakes_at};
use timebase::{Cycles, TimeMark};
use ubx_link::Event;
use utc_clock::{Ppb, SecondProof};
use variant::Variant;

use super::receiver::{REPORT_EVERY, Receiver, first_instant_after};
use crate::base_time;
use crate::clock_events::{self, ClockEvent};
use crate::drivers::pulse::EdgeCounters;
use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::reports::{GNSS, GnssReport};
use crate::settings::{GPS_BAUD, VARIANT};
use crate::supervision::{self, no_later};

/// The wait between poll and read.
const WAIT: Wait = match VARIANT {
    Variant::PaperStep1 | Variant::PaperStep2 { .. } => Wait::Constant,
    Variant::PaperDefault | Variant::Pixclock { .. } => Wait::ForCharacters { baud: GPS_BAUD },
};

/// Runs forever, on the high executor.
#[embassy_executor::task]
pub async fn run(line: (Reader, Writer)) {
    let mut receiver = Receiver::new(line);
    let mut clock = PaperClock::new();
    let mut report_due = Cycles::BOOT;
    loop {
        supervision::came_by(Hang::Gnss);
        let now = time::now();
        receiver.configure(now);
        if now >= report_due {
            report_due = now.plus(REPORT_EVERY);
            GNSS.set(report(&receiver, &clock));
        }
        let due = receiver
            .poll_timeout(now)
            .unwrap_or(report_due)
            .min(report_due);
        let timer = Timer::at(no_later(first_instant_after(due)));
        if let Either::First(()) = select(receiver.wait(), timer).await
            && let Some(us) = WAIT.before_read(receiver.waiting())
        {
            let wakes_at = wakes_at(time::last_tick(), us, time::TICK_PERIOD);
            // A tick is a whole number of µs.
            Timer::at(Instant::from_micros(wakes_at.as_micros())).await;
        }
        receiver.take();
        let now = time::now();
        while let Some(event) = receiver.poll(now) {
            if let Event::NavPvt { mark, .. } = event {
                set(&mut clock, &mark);
            }
        }
    }
}

/// Sets the clock to a mark.
fn set(clock: &mut PaperClock, mark: &TimeMark) {
    let outcome = clock.handle_mark(mark, time::last_tick());
    base_time::set(clock.base_time());
    if outcome == Outcome::Set {
        defmt::info!("the clock is set");
        clock_events::push(ClockEvent::Set);
    }
}

fn report(receiver: &Receiver, clock: &PaperClock) -> GnssReport {
    GnssReport {
        receiver: receiver.report(),
        clock: clock.counters(),
        source: clock.source(),
        second: SecondProof::Open,
        frequency: Ppb(0),
        edges: EdgeCounters::default(),
    }
}
