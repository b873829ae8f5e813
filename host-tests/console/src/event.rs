//! What happens on a board, in words.
//!
//! *Purpose.* An [`Event`] is a line that a person reads between two rows of figures.
//!
//! *Design.* Most of it are sentences of the firmware's log, which are recognised here. What the
//! firmware only counts (refusals) shows where two status lines differ: [`News`] compares
//! them.
//!
//! *Limits.* A sentence that is not recognised is shown as it is, if it is at least a warning.

use std::fmt;

use crate::{Level, LogLine, Status, units};

/// Something that a person wants to know at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// The clock was set for the first time since the board's start.
    Set,
    /// The clock was corrected at once.
    Stepped {
        /// What was added to it, in ns.
        by_ns: i64,
    },
    /// The time pulse steers the clock from now on.
    PulseFollowed,
    /// The time pulse does not steer it any more.
    PulseLost,
    /// Date and second are proved.
    SecondProved,
    /// The second is not proved, or not any more.
    SecondUnproved,
    /// Marks name another second than the clock.
    SecondContradicted,
    /// No mark for a while: the clock runs on by itself.
    Holdover,
    /// Marks are back after a holdover.
    MarksAgain,
    /// Marks or pulses were not believed.
    Refused {
        /// The counter's key in the status line, as in `mark_outlier`.
        kind: String,
        /// How many more than in the status line before.
        count: u64,
    },
    /// A program has connected to the board's MAVLink port.
    ClientConnected,
    /// A program has left the board's MAVLink port.
    ClientLeft,
    /// A line of the log that asks for attention.
    Logged(LogLine),
}

impl Event {
    /// The event that a line of the log is; `None` if it is none.
    #[must_use]
    pub fn of(line: &LogLine) -> Option<Self> {
        const STEP: (&str, &str) = ("the clock steps by ", " ns");
        match line.text.as_str() {
            "the clock is set" => return Some(Self::Set),
            "the pulse steers the clock" => return Some(Self::PulseFollowed),
            "the pulse does not steer the clock any more" => return Some(Self::PulseLost),
            "the second is proved" => return Some(Self::SecondProved),
            "the second is not proved" => return Some(Self::SecondUnproved),
            "the receiver contradicts the second" => return Some(Self::SecondContradicted),
            "no receiver steers the clock any more" => return Some(Self::Holdover),
            "a receiver steers the clock again" => return Some(Self::MarksAgain),
            _ => {}
        }
        let step = line.text.strip_prefix(STEP.0);
        if let Some(Ok(by_ns)) = step.and_then(|rest| Some(rest.strip_suffix(STEP.1)?.parse())) {
            return Some(Self::Stepped { by_ns });
        }
        let is_urgent = line.level.is_some_and(|level| level >= Level::Warn);
        is_urgent.then(|| Self::Logged(line.clone()))
    }

    /// Whether something is not as it should be.
    #[must_use]
    pub const fn is_trouble(&self) -> bool {
        matches!(
            self,
            Self::PulseLost
                | Self::Holdover
                | Self::SecondUnproved
                | Self::SecondContradicted
                | Self::Refused { .. }
                | Self::Logged(_)
        )
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Set => f.write_str("the clock is set"),
            Self::Stepped { by_ns } => {
                write!(f, "the clock steps by {}", units::difference(*by_ns))
            }
            Self::PulseFollowed => f.write_str("the clock follows the time pulse"),
            Self::PulseLost => f.write_str("the clock does not follow the time pulse any more"),
            Self::SecondProved => f.write_str("date and second are proved"),
            Self::SecondUnproved => f.write_str("the second is not proved: it may be off by more"),
            Self::SecondContradicted => f.write_str("the receiver names another second"),
            Self::Holdover => f.write_str("no mark any more: the clock runs on by itself"),
            Self::MarksAgain => f.write_str("marks are back: the clock is steered again"),
            Self::Refused { kind, count } => write!(f, "refused: {}", refusals(kind, *count)),
            Self::ClientConnected => f.write_str("a client connects"),
            Self::ClientLeft => f.write_str("a client leaves"),
            Self::Logged(line) => line.fmt(f),
        }
    }
}

/// A count of refusals in words: `mark_off_line` and 3 are `3 marks (off line)`.
pub(crate) fn refusals(kind: &str, count: u64) -> String {
    let (what, why) = kind.split_once('_').unwrap_or((kind, ""));
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural} ({})", why.replace('_', " "))
}

/// What is new in each status line of one board.
#[derive(Clone, Debug, Default)]
pub struct News {
    last: Option<Status>,
}

impl News {
    /// The events between the status line before and `status`, which is kept.
    pub fn push(&mut self, status: &Status) -> Vec<Event> {
        let last = self.last.replace(status.clone()).unwrap_or_default();
        let mut events = Vec::new();
        for (kind, count) in status.refusals() {
            let before = last.refusals().find(|(other, _)| *other == kind);
            let count = count - before.map_or(0, |(_, before)| before).min(count);
            if count > 0 {
                let kind = kind.to_owned();
                events.push(Event::Refused { kind, count });
            }
        }
        events
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(level: Level, text: &str) -> LogLine {
        LogLine {
            level: Some(level),
            timestamp: None,
            text: text.to_owned(),
        }
    }

    #[test]
    fn what_the_firmware_says_becomes_an_event() {
        for (text, event) in [
            ("the clock is set", Event::Set),
            ("the pulse steers the clock", Event::PulseFollowed),
            (
                "the pulse does not steer the clock any more",
                Event::PulseLost,
            ),
            ("the second is proved", Event::SecondProved),
            ("the second is not proved", Event::SecondUnproved),
            (
                "the receiver contradicts the second",
                Event::SecondContradicted,
            ),
            ("no receiver steers the clock any more", Event::Holdover),
            ("a receiver steers the clock again", Event::MarksAgain),
            (
                "the clock steps by -113797 ns",
                Event::Stepped { by_ns: -113_797 },
            ),
        ] {
            assert_eq!(Event::of(&line(Level::Info, text)), Some(event), "{text}");
        }
        let step = Event::Stepped { by_ns: -113_797 };
        assert_eq!(step.to_string(), "the clock steps by −113.8 µs");
    }

    #[test]
    fn any_other_line_is_an_event_from_a_warning_up() {
        let text = "the clock steps by a lot";
        assert_eq!(Event::of(&line(Level::Info, text)), None);
        let warning = line(Level::Warn, text);
        assert_eq!(Event::of(&warning), Some(Event::Logged(warning)));
    }

    #[test]
    fn what_is_only_counted_shows_where_status_lines_differ() {
        let mut news = News::default();
        let mut push = |text: &str| news.push(&Status::parse(text).unwrap());
        assert_eq!(
            push("status state=set mark_late=2 pulse_locks=1"),
            [refused("mark_late", 2)]
        );
        assert_eq!(push("status state=set mark_late=2 pulse_locks=2"), []);
        assert_eq!(
            push("status state=holdover mark_late=5 pulse_off_line=1"),
            [refused("mark_late", 3), refused("pulse_off_line", 1)]
        );
        assert_eq!(push("status state=set mark_late=5 pulse_off_line=1"), []);
    }

    #[test]
    fn refusals_are_put_into_words() {
        assert_eq!(
            refused("mark_late", 3).to_string(),
            "refused: 3 marks (late)"
        );
        assert_eq!(
            refused("pulse_off_line", 1).to_string(),
            "refused: 1 pulse (off line)"
        );
    }

    #[test]
    fn a_board_that_starts_anew_counts_from_0() {
        let mut news = News::default();
        news.push(&Status::parse("status state=set mark_late=9").unwrap());
        let after = news.push(&Status::parse("status state=unset mark_late=1").unwrap());
        assert_eq!(after, []);
        let later = news.push(&Status::parse("status state=unset mark_late=3").unwrap());
        assert_eq!(later, [refused("mark_late", 2)]);
    }

    fn refused(kind: &str, count: u64) -> Event {
        Event::Refused {
            kind: kind.to_owned(),
            count,
        }
    }
}
