//! A time mark as a good receiver sends it.

use timebase::{Cycles, LeapSeconds, PulseForecast, TimeMark, Validity};
use utc_clock::UtcNanos;

/// A mark that every gate passes; none where the calendar ends.
#[must_use]
pub fn good_mark(arrival: Cycles, epoch: UtcNanos) -> Option<TimeMark> {
    Some(TimeMark {
        arrival,
        busy_us: 0,
        epoch: epoch.to_civil()?,
        t_acc_ns: 25,
        validity: Validity {
            date: true,
            time: true,
            fully_resolved: true,
            confirmed: true,
            leap_seconds_known: true,
        },
    })
}

/// A TIM-TP with nothing to be said against it.
#[must_use]
pub const fn good_forecast(arrival: Cycles, late_ps: Option<i32>) -> PulseForecast {
    PulseForecast {
        arrival,
        busy_us: 0,
        late_ps,
        tow_ms: 0,
        week: 0,
        is_utc_base: true,
        is_utc_available: true,
    }
}

/// A receiver's word that it has its leap count from GPS, with nothing announced.
#[must_use]
pub const fn leap_seconds(arrival: Cycles) -> LeapSeconds {
    LeapSeconds {
        arrival,
        busy_us: 0,
        source: 2,
        count: Some(18),
        event: None,
    }
}
