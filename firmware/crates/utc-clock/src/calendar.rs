//! The calendar: a receiver's fields to UTC and back, 1980 to 2100.
//!
//! *Purpose.* Fields become an instant at every mark ([`UtcNanos::from_civil`]), an instant becomes
//! fields where people read it ([`UtcNanos::to_civil`]).
//!
//! *Design.* Years are counted from March, so that the leap day is the last of
//! its year and the months are a straight line with a remainder; the origin is
//! 1968-03-01, the start of a leap cycle. In this range 2100 alone breaks the
//! rule of four years. All of it is 32-bit arithmetic without a division by
//! anything but constants: seconds since 1970 fit `u32` until 2106.
//!
//! A leap second, 23:59:60, has the instant that POSIX gives it: the same
//! number as the 00:00:00 that follows. Whether a clock may follow a mark inside of one
//! is decided in [`gate`](crate::gate).
//!
//! *Limits.* Which months had a leap second is not known here: 23:59:60 is
//! accepted on any day, at any other time of day it is refused.

use core::error::Error;
use core::fmt;

use timebase::CivilTime;

use crate::utc::UtcNanos;

/// The years that the calendar knows; 1980 is where GPS begins.
const YEARS: core::ops::RangeInclusive<u16> = 1980..=2100;

/// 2100-03-01 in days since 1968-03-01: the leap day before it did not happen.
const AFTER_MISSING_LEAP_DAY: u32 = 48_212;
/// 1970-01-01 in days since 1968-03-01.
const UNIX_EPOCH: u32 = 671;
const DAY_S: u32 = 86_400;

/// Why calendar fields name no instant: the offending field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CalendarError {
    /// Not 1980 to 2100.
    Year(u16),
    /// Not 1 to 12.
    Month(u8),
    /// Not a day of that month.
    Day(u8),
    /// Not 0 to 23.
    Hour(u8),
    /// Not 0 to 59.
    Minute(u8),
    /// Not 0 to 59, nor 60 at 23:59.
    Second(u8),
    /// A second or more, in either direction.
    Nano(i32),
}

impl fmt::Display for CalendarError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Year(year) => write!(f, "year {year}"),
            Self::Month(month) => write!(f, "month {month}"),
            Self::Day(day) => write!(f, "day {day}"),
            Self::Hour(hour) => write!(f, "hour {hour}"),
            Self::Minute(minute) => write!(f, "minute {minute}"),
            Self::Second(second) => write!(f, "second {second}"),
            Self::Nano(nano) => write!(f, "{nano} ns"),
        }
    }
}

impl Error for CalendarError {}

impl UtcNanos {
    /// The instant that calendar fields and their signed `nano` name.
    ///
    /// # Errors
    /// The first field that is out of its range.
    #[inline]
    pub const fn from_civil(civil: &CivilTime) -> Result<Self, CalendarError> {
        let CivilTime {
            year,
            month,
            day,
            hour,
            minute,
            second,
            nano,
        } = *civil;
        if year < *YEARS.start() || year > *YEARS.end() {
            return Err(CalendarError::Year(year));
        }
        if month < 1 || month > 12 {
            return Err(CalendarError::Month(month));
        }
        if day < 1 || day > days_in_month(year, month) {
            return Err(CalendarError::Day(day));
        }
        if hour > 23 {
            return Err(CalendarError::Hour(hour));
        }
        if minute > 59 {
            return Err(CalendarError::Minute(minute));
        }
        let leap_second = second == 60 && hour == 23 && minute == 59;
        if second > 59 && !leap_second {
            return Err(CalendarError::Second(second));
        }
        if nano <= -1_000_000_000 || nano >= 1_000_000_000 {
            return Err(CalendarError::Nano(nano));
        }

        let before_march = month < 3;
        let years = year as u32 - 1968 - before_march as u32;
        let months = if before_march {
            month as u32 + 9
        } else {
            month as u32 - 3
        };
        let day_of_year = (153 * months + 2) / 5 + day as u32 - 1;
        let mut days = 1461 * years / 4 + day_of_year;
        if years == 2100 - 1968 {
            days -= 1;
        }
        let seconds =
            (days - UNIX_EPOCH) * DAY_S + hour as u32 * 3_600 + minute as u32 * 60 + second as u32;
        Ok(Self(seconds as i64 * 1_000_000_000 + nano as i64))
    }

    /// The calendar fields of an instant, `nano` from 0 to 999 999 999; `None`
    /// outside of 1980 to 2100. It divides: for people, not for marks.
    #[must_use]
    pub const fn to_civil(self) -> Option<CivilTime> {
        let seconds = self.0.div_euclid(1_000_000_000);
        let nano = self.0.rem_euclid(1_000_000_000) as i32;
        if seconds < 0 || seconds > u32::MAX as i64 {
            return None;
        }
        let seconds = seconds as u32;

        let mut days = seconds / DAY_S + UNIX_EPOCH;
        if days >= AFTER_MISSING_LEAP_DAY {
            days += 1;
        }
        let years = (4 * days + 3) / 1461;
        let day_of_year = days - 1461 * years / 4;
        let months = (5 * day_of_year + 2) / 153;
        let before_march = months >= 10;
        let year = (1968 + years + before_march as u32) as u16;
        if year < *YEARS.start() || year > *YEARS.end() {
            return None;
        }
        let second_of_day = seconds % DAY_S;
        Some(CivilTime {
            year,
            month: if before_march { months - 9 } else { months + 3 } as u8,
            day: (day_of_year - (153 * months + 2) / 5 + 1) as u8,
            hour: (second_of_day / 3_600) as u8,
            minute: (second_of_day / 60 % 60) as u8,
            second: (second_of_day % 60) as u8,
            nano,
        })
    }
}

/// ISO 8601, see [`UtcNanos`].
impl fmt::Display for UtcNanos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(t) = self.to_civil() else {
            return write!(f, "{} ns", self.0);
        };
        write!(
            f,
            "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}",
            t.year, t.month, t.day, t.hour, t.minute, t.second
        )?;
        let decimals = f.precision().unwrap_or(9).min(9);
        if decimals > 0 {
            let unit = 10_i32.pow(9 - decimals as u32);
            write!(f, ".{:0decimals$}", t.nano / unit)?;
        }
        f.write_str("Z")
    }
}

/// Days of a month from 1 to 12 in one of [`YEARS`].
const fn days_in_month(year: u16, month: u8) -> u8 {
    if month == 2 {
        28 + (year.is_multiple_of(4) && year != 2100) as u8
    } else {
        30 + ((month + (month >> 3)) & 1)
    }
}

#[cfg(test)]
mod tests {
    use std::format;

    use super::*;

    const fn civil(date: (u16, u8, u8), time: (u8, u8, u8), nano: i32) -> CivilTime {
        CivilTime {
            year: date.0,
            month: date.1,
            day: date.2,
            hour: time.0,
            minute: time.1,
            second: time.2,
            nano,
        }
    }

    #[test]
    fn a_negative_nano_reaches_into_the_year_before() {
        // As u-blox sends it: the fields were rounded up to the new year.
        let sent = civil((2026, 1, 1), (0, 0, 0), -4_999_999);
        let utc = UtcNanos::from_civil(&sent).unwrap();
        let meant = civil((2025, 12, 31), (23, 59, 59), 995_000_001);
        assert_eq!(utc, UtcNanos::from_civil(&meant).unwrap());
        assert_eq!(utc.to_civil(), Some(meant));
    }

    #[test]
    fn a_leap_second_is_the_second_that_follows() {
        let leap = UtcNanos::from_civil(&civil((2016, 12, 31), (23, 59, 60), 250_000_000));
        let next = UtcNanos::from_civil(&civil((2017, 1, 1), (0, 0, 0), 250_000_000));
        assert_eq!(leap, next);
        assert!(leap.is_ok());
    }

    #[test]
    fn each_field_is_refused_by_name() {
        use CalendarError as E;
        let noon = (12, 0, 0);
        let cases = [
            (civil((1979, 12, 31), noon, 0), E::Year(1979)),
            (civil((2101, 1, 1), noon, 0), E::Year(2101)),
            (civil((2026, 0, 1), noon, 0), E::Month(0)),
            (civil((2026, 13, 1), noon, 0), E::Month(13)),
            (civil((2026, 2, 30), noon, 0), E::Day(30)),
            (civil((2027, 2, 29), noon, 0), E::Day(29)),
            (civil((2100, 2, 29), noon, 0), E::Day(29)),
            (civil((2026, 4, 31), noon, 0), E::Day(31)),
            (civil((2026, 4, 0), noon, 0), E::Day(0)),
            (civil((2026, 4, 1), (24, 0, 0), 0), E::Hour(24)),
            (civil((2026, 4, 1), (0, 60, 0), 0), E::Minute(60)),
            (civil((2026, 4, 1), (0, 0, 60), 0), E::Second(60)),
            (civil((2026, 4, 1), (23, 59, 61), 0), E::Second(61)),
            (
                civil((2026, 4, 1), noon, 1_000_000_000),
                E::Nano(1_000_000_000),
            ),
            (civil((2026, 4, 1), noon, i32::MIN), E::Nano(i32::MIN)),
        ];
        for (fields, error) in cases {
            assert_eq!(UtcNanos::from_civil(&fields), Err(error), "{fields:?}");
        }
    }

    #[test]
    fn instants_outside_the_range_have_no_fields() {
        let first = UtcNanos::from_civil(&civil((1980, 1, 1), (0, 0, 0), 0)).unwrap();
        let last = UtcNanos::from_civil(&civil((2100, 12, 31), (23, 59, 59), 999_999_999)).unwrap();
        assert!(first.to_civil().is_some() && last.to_civil().is_some());
        for outside in [first.0 - 1, last.0 + 1, 0, -1, i64::MIN, i64::MAX] {
            assert_eq!(UtcNanos(outside).to_civil(), None);
        }
    }

    #[test]
    fn shown_as_iso_8601() {
        let t = UtcNanos(1_451_606_400_001_002_003);
        assert_eq!(format!("{t}"), "2016-01-01T00:00:00.001002003Z");
        assert_eq!(format!("{t:.6}"), "2016-01-01T00:00:00.001002Z");
        assert_eq!(format!("{t:.0}"), "2016-01-01T00:00:00Z");
        assert_eq!(format!("{}", UtcNanos(-7)), "-7 ns");
    }
}
