//! Plays a flight on the firmware's clock.
//!
//! *Purpose.* Readings of the very [`UtcClock`] that the image has, driven as the
//! firmware's GNSS task drives it.
//!
//! *Design.* A message is handled when its last byte has come in, an edge when the
//! task has been woken, a timeout when it is due and a little late. Between these the
//! clock is read each [`READ_EVERY`] of true time.
//!
//! *Limits.* The task itself takes no time.

use timebase::{
    Cycles, LeapEvent, LeapSeconds, Polarity, PulseEdge, PulseForecast, TimeMark, Validity,
};
use utc_clock::{ClockState, Counters, Published, Settings, Source, UtcClock, UtcNanos};
use world::{EventKind, WorldPicos};

use crate::{Flight, Header, READ_EVERY, Reading};

/// From a message's first byte to its last, per byte of its frame, in ns: 115200 baud.
const BYTE_NS: i64 = 86_806;
/// From an edge to its handling, in ns.
const PULSE_TASK_NS: i64 = 20_000;
/// How late the firmware's timers are: a tick and a wake-up, in cycles.
const TIMER_LATE: u64 = 10_000;
const DAY_NS: i64 = 86_400_000_000_000;

/// What the clock knows beside the flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Setup {
    /// The earliest date that is believed, in ns of UTC since 1970; the release's own
    /// without.
    pub floor_utc_ns: Option<i64>,
}

/// What was counted by the end of a flight.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Steps of the clock while it was set.
    pub steps: u64,
    /// What the clock counted, by name.
    pub counters: Vec<(&'static str, u64)>,
}

/// Plays `flight` from 0 to its last event and hands each reading to `each`.
///
/// # Panics
///
/// Never: the timeline is its own, so its writer is there to be taken.
pub fn play(flight: &Flight, setup: &Setup, mut each: impl FnMut(&Reading)) -> Totals {
    let line = Published::new();
    let settings = Settings {
        date_floor: setup
            .floor_utc_ns
            .map_or(Settings::DEFAULT.date_floor, UtcNanos),
        ..Settings::DEFAULT.with_latency_ns(flight.header.latency_us.saturating_mul(1_000))
    };
    let mut clock = UtcClock::new(settings, line.take_writer().expect("a line of its own"));
    clock.handle_pulse_width(flight.header.pulse.and_then(|pulse| {
        // An inverted pulse is none that the firmware asks for.
        pulse.is_high.then_some(pulse.width_ns / 1_000)
    }));
    let crystal = &flight.header.crystal;
    let cycles = |at: WorldPicos| Cycles(crystal.cycles_at(at));
    let mut handled: Vec<_> = flight
        .events
        .iter()
        .map(|event| (event.at.plus(handled_after_ps(&event.kind)), event))
        .collect();
    handled.sort_by_key(|(at, _)| *at);
    let mut handled = handled.into_iter().peekable();
    let end = flight.end();
    let mut read_at = WorldPicos(0);
    while read_at <= end {
        while let Some((now, event)) = handled.next_if(|(at, _)| *at <= read_at) {
            pass_until(&mut clock, cycles(now));
            handle(&mut clock, &flight.header, event.at, &event.kind, now);
            // The answer is in the flight, as if the question had been asked.
            let _ = clock.poll_leap_seconds(cycles(now));
        }
        let now = cycles(read_at);
        pass_until(&mut clock, now);
        let reading = line.reading_at(now);
        let source = match clock.source() {
            Source::Nothing => "nothing",
            Source::Message => "messages",
            Source::Pulse => "pulse",
        };
        let state = match reading.state {
            ClockState::Unset => {
                each(&Reading::unset(read_at, source));
                read_at = read_at.plus(READ_EVERY.0);
                continue;
            }
            ClockState::Set => "set",
            ClockState::Holdover => "holdover",
            ClockState::Unproved => "unproved",
        };
        each(&Reading {
            at: read_at,
            utc_ns: Some(reading.utc.0),
            uncertainty_ns: Some(reading.uncertainty_ns),
            state,
            source,
        });
        read_at = read_at.plus(READ_EVERY.0);
    }
    totals(clock.counters())
}

/// From an event to its handling, in ps.
const fn handled_after_ps(kind: &EventKind) -> i64 {
    let ns = match kind {
        EventKind::Mark { .. } | EventKind::Mark60 { .. } => 100 * BYTE_NS,
        EventKind::TimTp { .. } => 24 * BYTE_NS,
        EventKind::TimeLs { .. } => 32 * BYTE_NS,
        EventKind::Rise | EventKind::Fall => PULSE_TASK_NS,
    };
    ns * 1_000
}

/// Handles the timers that are due by `now`, each in its time.
fn pass_until(clock: &mut UtcClock<'_>, now: Cycles) {
    loop {
        let due = clock.poll_timeout().plus(TIMER_LATE);
        if due > now {
            return;
        }
        clock.handle_timeout(due);
        if clock.poll_timeout().plus(TIMER_LATE) <= due {
            // It asks for a time that is past: the next event is soon enough.
            return;
        }
    }
}

fn handle(
    clock: &mut UtcClock<'_>,
    header: &Header,
    at: WorldPicos,
    kind: &EventKind,
    now: WorldPicos,
) {
    let arrival = Cycles(header.crystal.cycles_at(at));
    let now = Cycles(header.crystal.cycles_at(now));
    match *kind {
        EventKind::Mark {
            utc_ns,
            t_acc_ns,
            valid,
            busy_us,
        } => {
            if let Some(epoch) = UtcNanos(utc_ns).to_civil() {
                let mark = TimeMark {
                    arrival,
                    busy_us: busy(busy_us),
                    epoch,
                    t_acc_ns,
                    validity: validity(valid),
                };
                let _ = clock.handle_mark(&mark, now);
            }
        }
        EventKind::Mark60 { nano, busy_us } => {
            // Second 60 ends the day before the midnight that is nearest.
            let day = (header.utc_ns(at) + DAY_NS / 2).div_euclid(DAY_NS);
            if let Some(mut epoch) = UtcNanos((day * DAY_NS).saturating_sub(1)).to_civil() {
                (epoch.second, epoch.nano) = (60, nano);
                let mark = TimeMark {
                    arrival,
                    busy_us: busy(busy_us),
                    epoch,
                    t_acc_ns: 25,
                    validity: validity(0x37),
                };
                let _ = clock.handle_mark(&mark, now);
            }
        }
        EventKind::Rise | EventKind::Fall => {
            let polarity = match kind {
                EventKind::Rise => Polarity::Rise,
                _ => Polarity::Fall,
            };
            let at = arrival;
            let _ = clock.handle_edge(&PulseEdge { at, polarity }, now);
        }
        EventKind::TimTp {
            late_ps,
            names,
            busy_us,
        } => {
            // What a flight does not say is not claimed.
            let flags = names.map_or(0, |names| names.flags);
            clock.handle_forecast(&PulseForecast {
                arrival,
                busy_us: busy(busy_us),
                late_ps: (flags & 0x10 == 0).then_some(late_ps),
                tow_ms: names.map_or(0, |names| names.tow_ms),
                week: names.map_or(0, |names| names.week),
                is_utc_base: flags & 1 != 0,
                is_utc_available: flags & 2 != 0,
            });
        }
        EventKind::TimeLs {
            source,
            count,
            change,
            to_event_s,
            busy_us,
        } => {
            let received = LeapSeconds {
                arrival,
                busy_us: busy(busy_us),
                source,
                count: Some(count),
                event: Some(LeapEvent {
                    change,
                    in_s: to_event_s,
                }),
            };
            clock.handle_leap_seconds(&received, now);
        }
    }
}

/// How long the line had been busy; where nobody looked, it is taken for idle.
fn busy(busy_us: Option<u64>) -> u32 {
    busy_us.map_or(0, |us| u32::try_from(us).unwrap_or(u32::MAX))
}

/// `valid` of NAV-PVT, with the standard of NAV-TIMEUTC in the upper half.
const fn validity(valid: u8) -> Validity {
    Validity {
        date: valid & 1 != 0,
        time: valid & 2 != 0,
        fully_resolved: valid & 4 != 0,
        confirmed: false,
        leap_seconds_known: valid >> 4 != 0xf,
    }
}

fn totals(counters: Counters) -> Totals {
    Totals {
        steps: u64::from(counters.steps_forward) + u64::from(counters.steps_back),
        counters: vec![
            ("accepted", counters.accepted.into()),
            ("refused", counters.refused().into()),
            ("sets", counters.sets.into()),
            ("holdovers", counters.holdovers.into()),
            ("pulses", counters.pulses.into()),
            ("pulse_locks", counters.pulse_locks.into()),
            ("pulse_width", counters.pulse_width.into()),
            ("pulse_unproved", counters.pulse_unproved.into()),
            ("pulse_off_line", counters.pulse_off_line.into()),
            ("pulse_doubled", counters.pulse_doubled.into()),
            ("pulse_q_err", counters.pulse_q_err.into()),
            ("outlier", counters.outlier.into()),
            ("late", counters.late.into()),
            ("early", counters.early.into()),
            ("drift", counters.drift.into()),
            ("waited", counters.waited.into()),
            ("crystal", counters.crystal.into()),
            ("date_out", counters.too_old.into()),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::Tally;

    #[test]
    fn a_good_flight_is_read_each_37_ms_and_held() {
        let mut text = String::from("# ppm 20\n");
        for k in 0..300_i64 {
            let at_us = k * 200_000 + 70_000 + k * 7_919 % 3_000;
            let utc_ns = Header::default().start_utc_ns + k * 200_000_000;
            text += &format!("{at_us},mark,{utc_ns},25,37,0\n");
        }
        let flight = Flight::parse(&text).unwrap();
        let mut tally = Tally::default();
        let mut times = Vec::new();
        play(&flight, &Setup::default(), |reading| {
            times.push(reading.at);
            tally.push(reading, flight.header.utc_ns(reading.at));
        });
        assert_eq!(times[..3], [0, 37, 74].map(WorldPicos::from_millis));
        let last = times[times.len() - 1];
        assert!(last <= flight.end() && flight.end() < last.plus(READ_EVERY.0));
        assert!(!tally.is_misleading());
        assert!(tally.set > tally.readings * 9 / 10, "{tally:?}");
    }
}
