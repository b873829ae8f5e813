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
    /// The epoch of the solution in the receiver's calendar fields, unchecked.
    pub epoch: CivilTime,
    /// The receiver's own estimate of its time accuracy, in ns (tAcc);
    /// `u32::MAX` when it has none.
    pub t_acc_ns: u32,
    /// What the receiver claims about those fields.
    pub validity: Validity,
}

/// An edge of the time pulse, as the hardware captured it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseMark {
    /// When the edge came.
    pub edge: Cycles,
}

/// What the receiver announces about its next time pulse (UBX-TIM-TP).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseForecast {
    /// When the first byte of the message had arrived: before the pulse.
    pub arrival: Cycles,
    /// By how much the pulse will come after its second,
    /// because the receiver can only make it at an edge of its own clock; in ps.
    pub late_ps: i32,
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
