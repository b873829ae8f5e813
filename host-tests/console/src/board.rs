//! What is kept of one board in a run.
//!
//! *Purpose.* All that the summary and the status lines need.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::event::News;
use crate::sample::Sizes;
use crate::{Event, Level, LogLine, Sample, Status};

/// One board's log and samples so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Board {
    news: News,
    /// The widest that each key of the status line has been, so that columns stay.
    widths: BTreeMap<String, usize>,
    pub(crate) status: Option<Status>,
    pub(crate) statuses: u64,
    pub(crate) by_level: BTreeMap<&'static str, u64>,
    /// When the clock was first set, after power-up.
    pub(crate) first_set: Option<Duration>,
    /// A status line had a clock that is set.
    seen_set: bool,
    /// The time pulse steers the clock.
    pub(crate) follows_pulse: bool,
    pub(crate) last: Option<Sample>,
    pub(crate) errors: Sizes,
}

impl Board {
    /// Counts a line of the log.
    pub(crate) fn count(&mut self, line: &LogLine) {
        let name = line.level.map_or("print", Level::as_str);
        *self.by_level.entry(name).or_default() += 1;
    }

    /// Takes what happened at `at`, after power-up.
    pub(crate) fn push_event(&mut self, at: Duration, event: &Event) {
        match event {
            Event::Set => {
                self.first_set.get_or_insert(at);
            }
            Event::PulseFollowed => self.follows_pulse = true,
            Event::PulseLost => self.follows_pulse = false,
            _ => {}
        }
    }

    /// Takes a status line: what is new in it, and its pairs in columns.
    pub(crate) fn push_status(&mut self, status: Status) -> (Vec<Event>, String) {
        let events = self.news.push(&status);
        let pairs = self.pairs(&status);
        self.statuses += 1;
        self.seen_set |= status.is_set();
        self.status = Some(status);
        (events, pairs)
    }

    /// The clock was set at least once.
    pub(crate) const fn was_set(&self) -> bool {
        self.seen_set || self.first_set.is_some()
    }

    /// The pairs of `status`, each as wide as its key ever was.
    fn pairs(&mut self, status: &Status) -> String {
        let mut line = String::new();
        for (key, value) in status.pairs() {
            let pair = format!("{key}={value}");
            let width = self.widths.entry(key.to_owned()).or_default();
            *width = (*width).max(pair.len());
            line.push_str(&format!("{pair:width$}  ", width = *width));
        }
        line.trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stay_where_the_widest_value_put_them() {
        let mut board = Board::default();
        let mut pairs = |text: &str| board.push_status(Status::parse(text).unwrap()).1;
        let wide = pairs("status marks=1000 refused=0");
        let narrow = pairs("status marks=7 refused=0");
        assert_eq!(wide.find("refused"), narrow.find("refused"));
    }

    #[test]
    fn lines_are_counted_by_level() {
        let mut board = Board::default();
        for level in [Level::Debug, Level::Warn, Level::Warn] {
            board.count(&LogLine {
                level: Some(level),
                timestamp: None,
                text: String::new(),
            });
        }
        assert_eq!(board.by_level, BTreeMap::from([("debug", 1), ("warn", 2)]));
    }
}
