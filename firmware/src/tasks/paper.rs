//! The GNSS task in the paper's variants: PX4 1.9's poll, sleep, read, parse, set the clock.
//!
//! *Purpose.* What the paper's boards did with the receiver's bytes, on the same board as pixclock.
//!
//! *Design.* `pollOrRead` of PX4's `src/drivers/gps/gps.cpp`: once there are bytes, the task sleeps as
//! [`Wait`] says, in whole ticks, and reads what is there by then. Each NAV-PVT in it sets the clock as
//! of the last tick ([`PaperClock`]). The default searches the receiver's rate ([`RateSearch`]). Framing and
//! configuration are those of the other variant.
//!
//! *Limits.* What costs a PX4 more is left out, in its favour: its many other tasks, unless the image has a load; the other
//! messages that it asks the receiver for; that it sees the DMA's bytes up to 1 ms late. The pulse's
//! wire is not read.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_futures::select::{Either, select};
use embassy_time::{Instant, Timer};
use fault_record::Hang;
use paper_clock::{Outcome, PaperClock, RateSearch, Wait, wakes_at};
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

/// Whether the receiver's rate is searched: the paper sets it from step I on.
const SEARCHES: bool = matches!(VARIANT, Variant::PaperDefault);

/// The rate of the receiver's line, where it is searched the one that is tried. \[Bd\]
static BAUD: AtomicU32 = AtomicU32::new(GPS_BAUD);

/// The rate of the receiver's line, where it is searched the one that is tried. \[Bd\]
pub fn baud() -> u32 {
    BAUD.load(Relaxed)
}

/// The wait between poll and read.
fn wait() -> Wait {
    match VARIANT {
        Variant::PaperStep1 | Variant::PaperStep2 { .. } | Variant::PaperTickOnly { .. } => {
            Wait::Constant
        }
        Variant::PaperDefault | Variant::Pixclock { .. } => Wait::ForCharacters { baud: baud() },
    }
}

/// Runs forever, on the high executor.
#[embassy_executor::task]
pub async fn run(line: (Reader, Writer)) {
    let mut receiver = Receiver::new(line);
    let mut clock = PaperClock::new();
    let mut search = RateSearch::new();
    let mut report_due = Cycles::BOOT;
    loop {
        supervision::came_by(Hang::Gnss);
        let now = time::now();
        if SEARCHES && let Some(baud) = search.poll(now) {
            receiver.try_rate(baud);
            BAUD.store(baud, Relaxed);
        }
        receiver.configure(now);
        if now >= report_due {
            report_due = now.plus(REPORT_EVERY);
            GNSS.set(report(&receiver, &clock));
        }
        let of_search = search.poll_timeout().filter(|_| SEARCHES);
        let timeouts = [receiver.poll_timeout(now), of_search];
        let due = timeouts.into_iter().flatten().fold(report_due, Cycles::min);
        let timer = Timer::at(no_later(first_instant_after(due)));
        if let Either::First(()) = select(receiver.wait(), timer).await
            && let Some(us) = wait().before_read(receiver.waiting())
        {
            sleep(us).await;
        }
        let now = time::now();
        receiver.take(now);
        while let Some(event) = receiver.poll(now) {
            if let Event::NavPvt { mark, .. } = event {
                search.handle_nav_pvt();
                set(&mut clock, &mark);
            }
        }
    }
}

/// A sleep of `us` µs as NuttX has it: until enough ticks are counted, and a tick that is lost makes it
/// longer.
async fn sleep(us: u32) {
    let end = wakes_at(time::counted_ticks(), us, time::TICK_PERIOD);
    loop {
        let left = end.since(time::counted_ticks());
        if left <= 0 {
            return;
        }
        // Where no tick is lost this is the last of them; a tick is a whole number of µs.
        let due = time::last_tick().plus(left.cast_unsigned());
        Timer::at(Instant::from_micros(due.as_micros())).await;
    }
}

/// Sets the clock to a mark.
fn set(clock: &mut PaperClock, mark: &TimeMark) {
    let outcome = clock.handle_mark(mark, time::counted_ticks());
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
