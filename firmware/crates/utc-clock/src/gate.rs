//! The gate: whether a mark may be believed at all.
//!
//! *Purpose.* Keeps away from the estimators what the receiver itself does not vouch for.
//!
//! *Design.* In a recorded cold start of an M8 `validDate` and `validTime` were
//! both set for 36 s while tAcc was `0xFFFF_FFFF`, for 20 epochs of them with a
//! 3D fix. So all three claims are demanded, and an accuracy, too.
//!
//! A mark inside a leap second is refused: its instant is shared with the second
//! after it, so a clock set from it would be a second wrong when it is over.
//!
//! *Limits.* One mark at a time, without memory: what contradicts the clock or
//! the mark before is judged elsewhere.

use timebase::TimeMark;

use crate::refusal::Refusal;
use crate::utc::UtcNanos;

/// The greatest tAcc that passes. Good marks of real receivers have 16 ns to 4.4 µs;
/// a receiver that is still resolving its time has ms or none. \[ns\]
const MAX_T_ACC_NS: u32 = 100_000;

/// Dates are believed within 1024 weeks of the floor, after which a GPS week number begins
/// anew. \[ns\]
const WEEKS_1024_NS: i64 = 1_024 * 7 * 86_400 * 1_000_000_000;

/// Judges marks by what they say of themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gate {
    /// Demand `confirmedTime` as well. Off by default: timing receivers never
    /// set it.
    pub require_confirmed: bool,
    /// The earliest date that is believed.
    pub date_floor: UtcNanos,
}

impl Gate {
    /// The epoch of a mark that may be believed.
    ///
    /// # Errors
    /// The first rule that the mark breaks.
    #[inline]
    pub fn judge(&self, mark: &TimeMark) -> Result<UtcNanos, Refusal> {
        let claims = mark.validity;
        if !claims.date {
            return Err(Refusal::Date);
        }
        if !claims.time {
            return Err(Refusal::Time);
        }
        if !claims.fully_resolved {
            return Err(Refusal::Unresolved);
        }
        if self.require_confirmed && !claims.confirmed {
            return Err(Refusal::Unconfirmed);
        }
        if mark.t_acc_ns > MAX_T_ACC_NS {
            return Err(Refusal::Inaccurate);
        }
        let epoch = UtcNanos::from_civil(&mark.epoch).map_err(Refusal::Calendar)?;
        if !(0..WEEKS_1024_NS).contains(&epoch.since(self.date_floor)) {
            return Err(Refusal::TooOld);
        }
        if mark.epoch.second == 60 {
            return Err(Refusal::LeapSecond);
        }
        Ok(epoch)
    }
}

#[cfg(test)]
mod tests {
    use timebase::{CivilTime, Cycles, Validity};

    use super::*;
    use crate::calendar::CalendarError;
    use crate::settings::Settings;

    fn gate() -> Gate {
        Gate {
            require_confirmed: false,
            date_floor: Settings::DATE_FLOOR,
        }
    }

    fn good() -> TimeMark {
        TimeMark {
            arrival: Cycles(0),
            busy_us: 0,
            epoch: CivilTime {
                year: 2025,
                month: 1,
                day: 1,
                hour: 0,
                minute: 0,
                second: 0,
                nano: 0,
            },
            t_acc_ns: MAX_T_ACC_NS,
            validity: Validity {
                date: true,
                time: true,
                fully_resolved: true,
                confirmed: false,
                leap_seconds_known: false,
            },
        }
    }

    fn refusal(change: impl FnOnce(&mut TimeMark)) -> Option<Refusal> {
        let mut mark = good();
        change(&mut mark);
        gate().judge(&mark).err()
    }

    #[test]
    fn the_worst_mark_that_is_good_enough_passes() {
        assert_eq!(gate().judge(&good()), Ok(Settings::DATE_FLOOR));
    }

    #[test]
    fn each_rule_refuses_by_its_own_name() {
        assert_eq!(refusal(|m| m.validity.date = false), Some(Refusal::Date));
        assert_eq!(refusal(|m| m.validity.time = false), Some(Refusal::Time));
        assert_eq!(
            refusal(|m| m.validity.fully_resolved = false),
            Some(Refusal::Unresolved)
        );
        assert_eq!(
            refusal(|m| m.t_acc_ns = MAX_T_ACC_NS + 1),
            Some(Refusal::Inaccurate)
        );
        assert_eq!(
            refusal(|m| m.t_acc_ns = u32::MAX),
            Some(Refusal::Inaccurate)
        );
        assert_eq!(
            refusal(|m| m.epoch.month = 13),
            Some(Refusal::Calendar(CalendarError::Month(13)))
        );
        assert_eq!(refusal(|m| m.epoch.nano = -1), Some(Refusal::TooOld));
        assert_eq!(
            refusal(|m| {
                m.epoch = CivilTime {
                    year: 2028,
                    month: 12,
                    day: 31,
                    hour: 23,
                    minute: 59,
                    second: 60,
                    nano: 0,
                };
            }),
            Some(Refusal::LeapSecond)
        );
    }

    #[test]
    fn confirmation_is_demanded_only_on_request() {
        let strict = Gate {
            require_confirmed: true,
            ..gate()
        };
        assert_eq!(strict.judge(&good()), Err(Refusal::Unconfirmed));
        let mut confirmed = good();
        confirmed.validity.confirmed = true;
        assert!(strict.judge(&confirmed).is_ok());
    }
}
