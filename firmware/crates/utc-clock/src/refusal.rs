//! Why a mark or a pulse did not move the clock.
//!
//! *Purpose.* What the receiver's line and the pulse's wire deliver is judged here and there;
//! every judgement has its name here, so that it can be counted, logged and tested.
//!
//! *Limits.* Of several reasons the first one that was met is named.

use core::error::Error;
use core::fmt;

use crate::calendar::CalendarError;

/// Why a mark was not followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// `validDate` is not set.
    Date,
    /// `validTime` is not set.
    Time,
    /// `fullyResolved` is not set.
    Unresolved,
    /// `confirmedTime` is not set, and the settings demand it.
    Unconfirmed,
    /// The receiver's own accuracy is worse than 100 µs, or unknown.
    Inaccurate,
    /// The fields name no instant.
    Calendar(CalendarError),
    /// The epoch is before [`Settings::date_floor`](crate::Settings::date_floor), or 1024 weeks and
    /// more after it.
    TooOld,
    /// The epoch lies in a leap second, which has no number of its own.
    LeapSecond,
    /// The arrival is in the future, or more than 10 s ago.
    Stamp,
    /// Two changes of course are still to begin: of marks that come within a millisecond,
    /// the third was held up somewhere.
    Backlog,
    /// The epoch is that of the mark before.
    DuplicateEpoch,
    /// The epoch is earlier than that of the mark before.
    EpochBack,
    /// Too far from the clock, and not (yet) confirmed by the marks after it.
    Outlier,
    /// Later than any jitter, but not as far off as an outlier.
    Late,
    /// Earlier than any floor wanders, and not (yet) confirmed by the marks after it.
    Early,
    /// The receiver's time drifts away as no crystal does.
    Drift,
    /// It waited behind other messages for longer than it can be believed with.
    Waited,
    /// The board's crystal is off by more than 110 ppm, beyond all that is promised of it: the clock
    /// is unset.
    Crystal,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Date => "the date is not valid",
            Self::Time => "the time of day is not valid",
            Self::Unresolved => "the second is not fully resolved",
            Self::Unconfirmed => "the time is not confirmed",
            Self::Inaccurate => "the receiver's accuracy is worse than 100 µs",
            Self::Calendar(error) => return error.fmt(f),
            Self::TooOld => "the epoch is not within 1024 weeks of the date floor",
            Self::LeapSecond => "the epoch lies in a leap second",
            Self::Stamp => "the arrival is in the future or more than 10 s ago",
            Self::Backlog => "two changes of course are still to begin",
            Self::DuplicateEpoch => "the epoch is that of the mark before",
            Self::EpochBack => "the epoch is earlier than that of the mark before",
            Self::Outlier => "too far from the clock",
            Self::Late => "later than any jitter",
            Self::Early => "earlier than any floor wanders",
            Self::Drift => "the receiver drifts as no crystal does",
            Self::Waited => "it waited behind other messages",
            Self::Crystal => "the crystal is off by more than 110 ppm",
        })
    }
}

impl Error for Refusal {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Calendar(error) => Some(error),
            _ => None,
        }
    }
}

/// Why a pulse was not followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PulseRefusal {
    /// The clock is not set, so that it is unknown which second the pulse marks.
    Unnumbered,
    /// Its width is not the one that the receiver was configured for, or none was.
    Width,
    /// Its train is not proved (yet) to be the receiver's pulse.
    Unproved,
    /// It does not come on a second by the messages, whatever latency they have.
    OffSecond,
    /// It is not where the pulses before it predict it.
    OffLine,
    /// Its second has had its pulse.
    Doubled,
    /// The edge is in the future, or more than 10 s ago.
    Stamp,
    /// Two changes of course are still to begin.
    Backlog,
}

impl fmt::Display for PulseRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unnumbered => "the clock is not set, so its second is unknown",
            Self::Width => "not as wide as the receiver was configured to make it",
            Self::Unproved => "not proved to be the receiver's pulse",
            Self::OffSecond => "not on a second",
            Self::OffLine => "not where the pulses before it predict it",
            Self::Doubled => "its second has had its pulse",
            Self::Stamp => "the edge is in the future or more than 10 s ago",
            Self::Backlog => "two changes of course are still to begin",
        })
    }
}

impl Error for PulseRefusal {}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    #[test]
    fn a_calendar_refusal_shows_its_field_and_has_it_as_source() {
        let refusal = Refusal::Calendar(CalendarError::Month(13));
        assert_eq!(refusal.to_string(), "month 13");
        assert_eq!(refusal.source().unwrap().to_string(), "month 13");
        assert!(Refusal::Late.source().is_none());
    }
}
