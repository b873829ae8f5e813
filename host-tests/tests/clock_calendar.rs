//! The calendar against an independent one, every day from 1980 to 2100.

use jiff::civil::{Date, date};
use jiff::tz::TimeZone;
use timebase::CivilTime;
use utc_clock::UtcNanos;

fn fields(day: Date, second_of_day: u32, nano: i32) -> CivilTime {
    CivilTime {
        year: u16::try_from(day.year()).expect("in range"),
        month: u8::try_from(day.month()).expect("in range"),
        day: u8::try_from(day.day()).expect("in range"),
        hour: u8::try_from(second_of_day / 3_600).expect("in range"),
        minute: u8::try_from(second_of_day / 60 % 60).expect("in range"),
        second: u8::try_from(second_of_day % 60).expect("in range"),
        nano,
    }
}

fn unix_ns(day: Date) -> i64 {
    let midnight = day.to_zoned(TimeZone::UTC).expect("in range").timestamp();
    i64::try_from(midnight.as_nanosecond()).expect("in range")
}

fn days() -> impl Iterator<Item = Date> {
    let mut next = Some(date(1980, 1, 1));
    std::iter::from_fn(move || {
        let today = next.filter(|day| day.year() <= 2100)?;
        next = today.tomorrow().ok();
        Some(today)
    })
}

#[test]
fn every_day_there_and_back() {
    let mut count = 0;
    for day in days() {
        count += 1;
        let midnight = unix_ns(day);
        // Another time of day on each day, all of them prime to each other.
        let second = count * 7_919 % 86_400;
        let nano = i32::try_from(u64::from(count) * 15_485_863 % 1_000_000_000).unwrap();
        for (second, nano) in [(0, 0), (86_399, 999_999_999), (second, nano)] {
            let civil = fields(day, second, nano);
            let utc = UtcNanos(midnight + i64::from(second) * 1_000_000_000 + i64::from(nano));
            assert_eq!(UtcNanos::from_civil(&civil), Ok(utc), "{civil:?}");
            assert_eq!(utc.to_civil(), Some(civil));
        }
        // Rounded up to midnight by the receiver, and a leap second at its end.
        let early = fields(day, 0, -5_000_000);
        assert_eq!(
            UtcNanos::from_civil(&early),
            Ok(UtcNanos(midnight - 5_000_000))
        );
        let leap = CivilTime {
            second: 60,
            ..fields(day, 86_399, 1)
        };
        let after = midnight + 86_400_000_000_001;
        assert_eq!(UtcNanos::from_civil(&leap), Ok(UtcNanos(after)));
    }
    assert_eq!(count, 121 * 365 + 30, "1980 to 2096 have 30 leap days");
}

#[test]
fn every_second_of_a_day_there_and_back() {
    let day = date(2024, 2, 29);
    for second in 0..86_400 {
        let civil = fields(day, second, 7);
        let utc = UtcNanos(unix_ns(day) + i64::from(second) * 1_000_000_000 + 7);
        assert_eq!(UtcNanos::from_civil(&civil), Ok(utc));
        assert_eq!(utc.to_civil(), Some(civil));
    }
}

#[test]
fn dates_are_refused_exactly_where_there_are_none() {
    for year in 1970..=2110_u16 {
        for month in 0..=14_u8 {
            for day in 0..=33_u8 {
                let exists = (1980..=2100).contains(&year)
                    && Date::new(
                        year.try_into().unwrap(),
                        month.try_into().unwrap(),
                        day.try_into().unwrap(),
                    )
                    .is_ok();
                let civil = CivilTime {
                    year,
                    month,
                    day,
                    ..fields(date(2000, 1, 1), 0, 0)
                };
                assert_eq!(UtcNanos::from_civil(&civil).is_ok(), exists, "{civil:?}");
            }
        }
    }
}
