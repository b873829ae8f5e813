//! The GNSS task: bytes in, marks to the clock, the clock to everybody.

use embassy_futures::select::select;
use embassy_time::{Instant, Timer};
use timebase::{CORE_HZ, Cycles, TimeMark};
use ubx_link::{Event, Link};
use utc_clock::{Outcome, Settings, UtcClock};

use crate::drivers::time;
use crate::drivers::uart::{Reader, Writer};
use crate::settings;
use crate::shared::{CLOCK, GNSS, GnssReport, NEWS};

/// From report to report: 1 s.
const REPORT_EVERY: u64 = CORE_HZ as u64;

/// Runs for ever, on the interrupt-level executor.
#[embassy_executor::task]
pub async fn run(mut reader: Reader, mut writer: Writer) {
    let mut link = Link::new();
    let mut clock = UtcClock::new(
        Settings {
            latency_ns: settings::LATENCY_NS,
            ..Settings::DEFAULT
        },
        &CLOCK,
    );
    let mut fix = None;
    let mut report_due = Cycles::BOOT;
    loop {
        let now = time::now();
        while let Some(event) = link.poll(now, || reader.take()) {
            match event {
                Event::NavPvt {
                    mark,
                    fix: solution,
                } => {
                    fix = Some((mark.arrival, solution));
                    follow(&mut clock, &mark);
                }
                Event::Ack { .. } | Event::Nak { .. } => {}
            }
        }
        clock.handle_timeout(time::now());
        if now >= report_due {
            report_due = now.plus(REPORT_EVERY);
            GNSS.tell(GnssReport {
                link: link.counters(),
                clock: clock.counters(),
                line: reader.errors(),
                fix,
            });
        }
        let due = clock.poll_timeout().min(report_due);
        select(reader.wait(), Timer::at(first_instant_after(due))).await;
    }
}

/// Gives a mark to the clock, and tells what came of it.
fn follow(clock: &mut UtcClock<'_>, mark: &TimeMark) {
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
