//! What is printed while a board runs, and what is said at the end.
//!
//! *Purpose.* A status line a second, the log lines that ask for attention, and
//! a summary with a verdict.
//!
//! *Design.* One [`Screen`] a board, fed with log lines. Fields keep the widest
//! width they had, so that the lines stand in columns. With `--json` nothing is
//! printed before the summary.
//!
//! *Limits.* It prints to standard output and knows nothing of terminals: no
//! colours, no cursor.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use crate::{Level, LogLine, Options, Status};

/// What is kept of one board's log, and how it is shown.
#[derive(Clone, Debug)]
pub struct Screen {
    /// What each line begins with: which board it is, if there are several.
    label: String,
    quiet: bool,
    widths: BTreeMap<String, usize>,
    last: Option<Status>,
    was_set: bool,
    statuses: u64,
    by_level: BTreeMap<&'static str, u64>,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The clock was set at least once.
    ClockSet,
    /// It never was.
    NeverSet,
}

impl Screen {
    /// The screen of board `index`, counted from 0, of a run with `options`.
    #[must_use]
    pub fn new(options: &Options, index: u16) -> Self {
        Self {
            label: if options.boards > 1 {
                format!("board {} ", options.mavlink_port_of(index))
            } else {
                String::new()
            },
            quiet: options.json,
            widths: BTreeMap::new(),
            last: None,
            was_set: false,
            statuses: 0,
            by_level: BTreeMap::new(),
        }
    }

    /// Takes the next line of the log, which came `elapsed` after power-up, and
    /// prints it if it is a status line or at least a warning.
    pub fn show(&mut self, elapsed: Duration, line: &LogLine) {
        let name = line.level.map_or("print", Level::as_str);
        *self.by_level.entry(name).or_default() += 1;
        let shown = if let Some(status) = Status::parse(&line.text) {
            let shown = self.columns(&status);
            self.statuses += 1;
            self.was_set |= status.is_set();
            self.last = Some(status);
            shown
        } else if line.level.is_some_and(|level| level >= Level::Warn) {
            line.to_string()
        } else {
            return;
        };
        if !self.quiet {
            println!("{}{:5} s  {shown}", self.label, elapsed.as_secs());
        }
    }

    /// The pairs of `status`, each as wide as its key ever was.
    fn columns(&mut self, status: &Status) -> String {
        let mut line = String::new();
        for (key, value) in status.pairs() {
            let pair = format!("{key}={value}");
            let width = self.widths.entry(key.to_owned()).or_default();
            *width = (*width).max(pair.len());
            line.push_str(&format!("{pair:width$}  ", width = *width));
        }
        line.trim_end().to_owned()
    }

    /// Whether the clock was set in this run.
    #[must_use]
    pub const fn verdict(&self) -> Verdict {
        if self.was_set {
            Verdict::ClockSet
        } else {
            Verdict::NeverSet
        }
    }

    /// What the board did, as one JSON object.
    #[must_use]
    pub fn summary(&self) -> Value {
        json!({
            "clock_was_set": self.was_set,
            "status_lines": self.statuses,
            "last_status": self.last.as_ref().map(Status::to_json),
            "log_lines": self.by_level,
        })
    }

    /// What the board did, as a line for people.
    #[must_use]
    pub fn closing_line(&self) -> String {
        let counts: Vec<_> = self
            .by_level
            .iter()
            .map(|(level, count)| format!("{count} {level}"))
            .collect();
        let verdict = match self.verdict() {
            Verdict::ClockSet => "the clock was set",
            Verdict::NeverSet => "the clock was never set",
        };
        format!("{}{verdict}; log lines: {}", self.label, counts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Program {
        #[command(flatten)]
        options: Options,
    }

    fn screen() -> Screen {
        Screen::new(&Program::parse_from(["sim", "--json"]).options, 0)
    }

    fn line(level: Level, text: &str) -> LogLine {
        LogLine {
            level: Some(level),
            timestamp: None,
            text: text.to_owned(),
        }
    }

    #[test]
    fn a_clock_that_was_set_once_was_set_even_if_it_is_in_holdover_at_the_end() {
        let mut screen = screen();
        assert_eq!(screen.verdict(), Verdict::NeverSet);
        for state in ["unset", "set", "holdover"] {
            screen.show(
                Duration::ZERO,
                &line(Level::Info, &format!("status state={state} marks=1")),
            );
        }
        assert_eq!(screen.verdict(), Verdict::ClockSet);
        let summary = screen.summary();
        assert_eq!(summary["last_status"]["state"], "holdover");
        assert_eq!(summary["status_lines"], 3);
    }

    #[test]
    fn lines_are_counted_by_level_whether_they_are_shown_or_not() {
        let mut screen = screen();
        for (level, text) in [(Level::Debug, "a"), (Level::Warn, "b"), (Level::Warn, "c")] {
            screen.show(Duration::ZERO, &line(level, text));
        }
        assert_eq!(
            screen.summary()["log_lines"],
            json!({"debug": 1, "warn": 2})
        );
    }

    #[test]
    fn columns_stay_where_the_widest_value_put_them() {
        let mut screen = screen();
        let wide = screen.columns(&Status::parse("status marks=1000 refused=0").unwrap());
        let narrow = screen.columns(&Status::parse("status marks=7 refused=0").unwrap());
        assert_eq!(wide.find("refused"), narrow.find("refused"));
    }
}
