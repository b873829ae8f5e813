//! Moments as the receiver states them, each with the moment at which it arrived.
//!
//! *Purpose.* The values that go from the receiver's line and from its time pulse to the clock.
//!
//! *Design.* They have the receiver's own fields, claims and accuracy. Nothing is checked, a month
//! may be 13: to judge them is the clock's work.

use crate::Cycles;

/// A moment of UTC as the receiver states it, and when the message arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeMark {
    /// When the first byte of the message had arrived.
    pub arrival: Cycles,
    /// How long the receiver's line had been busy by then without a gap of two byte times; 0 when
    /// it was idle, `u32::MAX` for that long and longer. The message was made after that
    /// began, so that it waited in the receiver's queue for no longer. \[µs\]
    pub busy_us: u32,
    /// The epoch of the solution in the receiver's calendar fields, unchecked.
    pub epoch: CivilTime,
    /// The receiver's own estimate of its time accuracy, in ns (tAcc);
    /// `u32::MAX` when it has none.
    pub t_acc_ns: u32,
    /// What the receiver claims about those fields.
    pub validity: Validity,
}

/// An edge on the time pulse's wire, as the hardware captured it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseEdge {
    /// When the edge came.
    pub at: Cycles,
    /// Which way it went.
    pub polarity: Polarity,
}

/// Which way an edge goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polarity {
    /// From low to high: a pulse begins, at the top of the second.
    Rise,
    /// From high to low: a pulse ends.
    Fall,
}

/// What the receiver announces about its next time pulse (UBX-TIM-TP).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseForecast {
    /// When the first byte of the message had arrived: before the pulse.
    pub arrival: Cycles,
    /// How long the line had been busy by then, as in [`TimeMark::busy_us`]. \[µs\]
    pub busy_us: u32,
    /// By how much the pulse will come after the second that it stands for,
    /// because the receiver can only make it at an edge of its own clock (−`qErr`);
    /// `None` where the receiver calls its `qErr` invalid (flags, bit 4). \[ps\]
    pub late_ps: Option<i32>,
    /// Time of week of the pulse in the base that `is_utc_base` names (`towMS`). \[ms\]
    pub tow_ms: u32,
    /// Week of the pulse in the same base.
    pub week: u16,
    /// The base is UTC; otherwise it is the time of a satellite system, which may be seconds or
    /// hours away (flags, bit 0).
    pub is_utc_base: bool,
    /// The receiver knows UTC (flags, bit 1).
    pub is_utc_available: bool,
}

/// Where the receiver has its count of leap seconds from (UBX-NAV-TIMELS).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeapSeconds {
    /// When the first byte of the message had arrived.
    pub arrival: Cycles,
    /// How long the line had been busy by then, as in [`TimeMark::busy_us`]. \[µs\]
    pub busy_us: u32,
    /// `srcOfCurrLs`: 0 the firmware, 1 GPS and GLONASS compared, 2 GPS, 3 SBAS, 4 BeiDou,
    /// 5 Galileo, 6 aided, 7 configured, 8 NavIC, 255 unknown.
    pub source: u8,
    /// `currLs`: GPS time less UTC; `None` where the receiver does not call it valid
    /// (valid, bit 0). \[s\]
    pub count: Option<i8>,
    /// The next event, or the last one; `None` where the receiver does not call it valid
    /// (valid, bit 1).
    pub event: Option<LeapEvent>,
}

/// A leap second that is announced, or one that has been.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeapEvent {
    /// `lsChange`: +1 for a second 60, −1 for a minute without its second 59, 0 for none.
    pub change: i8,
    /// `timeToLsEvent`: to the begin of second 60; below 0 it is over. Receivers differ
    /// by 1 s. \[s\]
    pub in_s: i32,
}

/// Calendar fields of UTC, as they stand in a NAV-PVT: any value can occur.
///
/// `nano` is signed: the fields are rounded to 10 ms, so it runs from
/// −5 000 000 to +995 000 000 (u-blox M8 receiver description, UBX-NAV-PVT).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CivilTime {
    /// Year, as in 2026.
    pub year: u16,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day of the month, 1 to 31.
    pub day: u8,
    /// Hour, 0 to 23.
    pub hour: u8,
    /// Minute, 0 to 59.
    pub minute: u8,
    /// Second, 0 to 60; 60 is a leap second.
    pub second: u8,
    /// Nanoseconds to add to the fields above; may be negative.
    pub nano: i32,
}

/// What the receiver claims about a [`TimeMark`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Validity {
    /// `validDate`: the date is valid.
    pub date: bool,
    /// `validTime`: the time of day is valid.
    pub time: bool,
    /// `fullyResolved`: no whole-second uncertainty is left.
    pub fully_resolved: bool,
    /// `confirmedTime`: confirmed by a second source. Timing receivers never
    /// set it.
    pub confirmed: bool,
    /// The leap-second count came from the sky; `false` while the receiver still
    /// uses the count that it was built with (utcStandard is 0xf).
    pub leap_seconds_known: bool,
}
