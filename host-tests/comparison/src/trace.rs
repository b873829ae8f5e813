//! A trace of arrivals that a real board logged, through every clock.
//!
//! *Purpose.* What each would have published, and how far that strays from the best
//! [smooth line](crate::smooth).
//!
//! *Design.* A trace is CSV with the header [`HEADER`], a row a message. Clocks are
//! read every 100 ms of the board's own time, from the first arrival to the last.
//! What a clock is behind the line all the time is its latency, which equal boards
//! have in common: the spread is what is left when the median is taken off.
//!
//! *Limits.* The true time is not known. Messages count as handled when they
//! arrived. A trace from before the earliest date that our clock accepts is moved
//! forward by whole days.

use std::fmt;

use board_model::{Board, Invariants, OnViolation, good_mark};
use utc_clock::{ClockState, Settings, UtcNanos};

use crate::baselines;
use crate::smooth::Smooth;
use crate::spread::{Spread, quantile};

/// The first line of a trace: the board's own time of an arrival and the UTC since
/// 1970 that the message named. \[µs\]
pub const HEADER: &str = "local_us,gps_utc_us";

/// From reading to reading. \[ns\]
const READ_EVERY_NS: i64 = 100_000_000;
/// The board's time of the first arrival. \[ns\]
const BEGIN_NS: i64 = 1_000_000_000;
const DAY_NS: i64 = 86_400_000_000_000;
/// An old trace is moved forward by ten years, as often as needed. \[days\]
const LIFT_DAYS: i64 = 3_653;

/// GPS less UTC since 2017. [s]
const LEAP_COUNT: i8 = 18;

/// What is wrong with a trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TraceError {
    /// The first line is not [`HEADER`].
    Header,
    /// This line, counted from 1, is not two whole numbers of µs.
    Row(usize),
    /// In this line the board's time goes back.
    Back(usize),
    /// There are fewer than two rows.
    Short,
}

impl fmt::Display for TraceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Header => write!(f, "the first line is not `{HEADER}`"),
            Self::Row(line) => write!(f, "line {line} is not two whole numbers of us"),
            Self::Back(line) => write!(f, "local_us goes back in line {line}"),
            Self::Short => f.write_str("a trace has at least two rows"),
        }
    }
}

impl std::error::Error for TraceError {}

/// A message's arrival. \[ns\]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// By the board's own time, the first at 1 s.
    pub arrival: i64,
    /// The UTC that it named, since 1970.
    pub utc: i64,
}

/// A trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trace {
    /// The arrivals in their order.
    pub rows: Vec<Row>,
    /// By how much it was moved forward. \[days\]
    pub lifted_days: i64,
    /// The earliest date that our clock accepts.
    pub floor: UtcNanos,
}

impl Trace {
    /// Whether a file's content looks like a trace, good or bad.
    #[must_use]
    pub fn is_one(content: &[u8]) -> bool {
        content.starts_with(b"local_us,")
    }

    /// Reads one.
    ///
    /// # Errors
    ///
    /// What is wrong with it, and in which line.
    pub fn parse(text: &str) -> Result<Self, TraceError> {
        Self::parse_from(text, Settings::DATE_FLOOR)
    }

    /// Reads one for a clock that accepts dates from `floor` on.
    ///
    /// # Errors
    ///
    /// As [`Trace::parse`].
    pub fn parse_from(text: &str, floor: UtcNanos) -> Result<Self, TraceError> {
        let mut lines = text.lines();
        if lines.next().map(str::trim) != Some(HEADER) {
            return Err(TraceError::Header);
        }
        let mut rows: Vec<Row> = Vec::new();
        let mut first = None;
        for (number, line) in (2..).zip(lines) {
            let ns = |us: &str| us.trim().parse::<i64>().ok()?.checked_mul(1_000);
            let pair = line.split_once(',');
            let row = pair.and_then(|(local, utc)| Some((ns(local)?, ns(utc)?)));
            let (local, utc) = row.ok_or(TraceError::Row(number))?;
            let since = local.checked_sub(*first.get_or_insert(local));
            let arrival = since.and_then(|since| since.checked_add(BEGIN_NS));
            let arrival = arrival.ok_or(TraceError::Row(number))?;
            if rows.last().is_some_and(|last| arrival < last.arrival) {
                return Err(TraceError::Back(number));
            }
            rows.push(Row { arrival, utc });
        }
        if rows.len() < 2 {
            return Err(TraceError::Short);
        }
        let earliest = rows.iter().map(|row| row.utc).min().unwrap_or(floor.0);
        let lift = LIFT_DAYS * DAY_NS;
        let times = (floor.0.saturating_sub(earliest).max(0) as u64).div_ceil(lift as u64);
        let lifted_days = times as i64 * LIFT_DAYS;
        for row in &mut rows {
            row.utc += lifted_days * DAY_NS;
        }
        Ok(Self {
            rows,
            lifted_days,
            floor,
        })
    }

    /// Plays it on every clock.
    #[must_use]
    pub fn replay(&self) -> Replayed {
        let ahead = Ahead::of(&self.rows);
        // By its own time a board's crystal is right; how far off it was is not known.
        // A trace has no NAV-TIMELS: its leap count is configured.
        let settings = Settings {
            leap_seconds: Some(LEAP_COUNT),
            date_floor: self.floor,
            ..Settings::DEFAULT
        };
        let mut board = Board::new(settings, 0.0);
        board.read_every_ns = None;
        board.invariants = Invariants::new(OnViolation::Count);
        board.invariants.margin_ppb = f64::INFINITY;
        let mut baselines = baselines::all();
        let mut tracks = vec![Vec::new(); 1 + baselines.len()];
        let mut rows = self.rows.iter().peekable();
        let moments = self.rows[0].arrival..=self.rows[self.rows.len() - 1].arrival;
        let at: Vec<i64> = moments.step_by(READ_EVERY_NS as usize).collect();
        for &now in &at {
            while let Some(row) = rows.next_if(|row| row.arrival <= now) {
                board.pass_until(row.arrival);
                let arrival = board.cycles(row.arrival);
                if let Some(mark) = good_mark(arrival, UtcNanos(row.utc)) {
                    board.handle_mark(&mark);
                }
                for baseline in &mut baselines {
                    baseline.handle_mark(row.arrival, row.utc);
                }
            }
            board.pass_until(now);
            let reading = board.read();
            let is_set = reading.state != ClockState::Unset;
            tracks[0].push(is_set.then(|| ahead.ns(now, reading.utc.0)));
            for (baseline, track) in baselines.iter().zip(&mut tracks[1..]) {
                track.push(baseline.utc_ns(now).map(|utc| ahead.ns(now, utc)));
            }
        }
        let arrivals = self.rows.iter();
        let arrivals = arrivals.map(|row| (row.arrival, ahead.ns(row.arrival, row.utc)));
        Replayed {
            at,
            tracks: baselines::candidates()
                .zip(tracks)
                .map(|(name, ahead)| Track { name, ahead })
                .collect(),
            arrivals: arrivals.collect(),
            counters: board.clock.counters(),
            violation: board.invariants.violations().1.map(str::to_owned),
        }
    }
}

/// The best smooth line through a trace's arrivals. It counts from the first row, so that times
/// fit an `f64`.
struct Ahead {
    first: Row,
    smooth: Smooth,
}

impl Ahead {
    fn of(rows: &[Row]) -> Self {
        let mut ahead = Self {
            first: rows[0],
            smooth: Smooth::over(&[]),
        };
        let points = rows.iter().map(|row| {
            let offset = ahead.offset(row.arrival, row.utc);
            (ahead.seconds(row.arrival), offset as f64)
        });
        ahead.smooth = Smooth::over(&points.collect::<Vec<_>>());
        ahead
    }

    const fn offset(&self, local: i64, utc: i64) -> i64 {
        (utc - self.first.utc) - (local - self.first.arrival)
    }

    fn seconds(&self, local: i64) -> f64 {
        (local - self.first.arrival) as f64 * 1e-9
    }

    /// How far `utc` at `local` of the board's time is ahead of the line. \[ns\]
    fn ns(&self, local: i64, utc: i64) -> i64 {
        let line = self.smooth.at(self.seconds(local));
        (self.offset(local, utc) as f64 - line).round() as i64
    }
}

/// What a clock published.
#[derive(Clone, Debug)]
pub struct Track {
    /// The clock.
    pub name: &'static str,
    /// How far ahead of the smooth line it was at each moment; none while it was
    /// unset. \[ns\]
    pub ahead: Vec<Option<i64>>,
}

impl Track {
    /// The median of how far it was ahead, and how it spread about that; none if it
    /// was never set. \[ns\]
    #[must_use]
    pub fn spread(&self) -> Option<(i64, Spread)> {
        let mut ahead: Vec<i64> = self.ahead.iter().flatten().copied().collect();
        ahead.sort_unstable();
        let median = quantile(&ahead, 0.5)?;
        let about = ahead.iter().map(|ahead| {
            let size = ahead.abs_diff(median);
            u32::try_from(size).unwrap_or(u32::MAX)
        });
        Some((median, Spread::of(about.collect())?))
    }
}

/// The outcome of a trace.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// The moments at which the clocks were read: the board's own time. \[ns\]
    pub at: Vec<i64>,
    /// Ours first, then the baselines.
    pub tracks: Vec<Track>,
    /// Each arrival and how far ahead of the line its message was. \[ns\]
    pub arrivals: Vec<(i64, i64)>,
    /// What ours counted.
    pub counters: utc_clock::Counters,
    /// What the first reading of ours that violates an invariant did.
    pub violation: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(rows: &str) -> Result<Trace, TraceError> {
        Trace::parse(&format!("{HEADER}\n{rows}"))
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        assert_eq!(Trace::parse(""), Err(TraceError::Header));
        assert_eq!(
            Trace::parse("local_us,remote_us\n1,2"),
            Err(TraceError::Header)
        );
        assert_eq!(parse(""), Err(TraceError::Short));
        assert_eq!(parse("1,2"), Err(TraceError::Short));
        assert_eq!(parse("1,2\n2,x"), Err(TraceError::Row(3)));
        assert_eq!(parse("1,2\n2"), Err(TraceError::Row(3)));
        assert_eq!(parse("9223372036854775807,2\n2,3"), Err(TraceError::Row(2)));
        assert_eq!(parse("2,2\n1,3"), Err(TraceError::Back(3)));
    }

    #[test]
    fn an_old_trace_is_lifted_by_whole_days_and_a_new_one_left_alone() {
        let new = parse("7,1739195789199802\n8,1739195789399802").unwrap();
        assert_eq!(new.lifted_days, 0);
        assert_eq!(new.rows[1].arrival - new.rows[0].arrival, 1_000);
        let old = parse("7,1448149465400000\n8,1448149465600000").unwrap();
        assert_eq!(old.lifted_days, 3_653);
        let lifted = old.rows[0].utc - 1_448_149_465_400_000_000;
        assert_eq!(lifted, 3_653 * DAY_NS);
        assert!(old.rows[0].utc >= Settings::DATE_FLOOR.0);
        // Not where the floor is older.
        let text = format!("{HEADER}\n7,1448149465400000\n8,1448149465600000");
        let floor = UtcNanos(1_420_070_400_000_000_000);
        assert_eq!(Trace::parse_from(&text, floor).unwrap().lifted_days, 0);
    }

    #[test]
    fn steady_arrivals_leave_every_clock_on_the_line() {
        let rows: Vec<_> = (0..1_000_u64)
            .map(|i| format!("{},{}", i * 200_000, 1_800_000_000_000_000 + i * 200_000))
            .collect();
        let replayed = parse(&rows.join("\n")).unwrap().replay();
        assert_eq!(replayed.violation, None);
        for track in &replayed.tracks {
            let (ahead, spread) = track.spread().unwrap();
            // PX4's leaks 20 us from message to message.
            assert!(ahead.abs() <= 20_000 && spread.max <= 20_000, "{track:?}");
        }
    }
}
