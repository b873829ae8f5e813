//! What is printed while boards run.
//!
//! *Purpose.* A row of figures a second, and between the rows what happens, in words.
//!
//! *Design.* What boards send goes in by `handle_*`, whole lines come out of
//! [`Screen::poll_line`]; printing them, and with colours or without, is the caller's. A row waits
//! until every board has a sample of its second, or has been waited for long enough; an event waits
//! for the row of its second, so that lines come in the order of their times although boards run
//! side by side.
//!
//! *Limits.* Everything is kept in memory until its row is printed, and there are no more than
//! [`PATIENCE`] s of that.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use crate::board::Board;
use crate::row::{CAUTION, Columns, styled};
use crate::sample::{Cell, Sizes, apart_ns};
use crate::{Event, LogLine, Sample, Status};

/// How long a row waits for a silent board. \[s\]
const PATIENCE: u64 = 2;

/// What a screen shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contents {
    /// How many boards there are.
    pub boards: usize,
    /// Samples have a reference that is worth comparing with.
    pub errors: bool,
    /// Every status line, with all its counters.
    pub verbose: bool,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Each clock was set at least once.
    ClockSet,
    /// At least one never was.
    NeverSet,
}

/// Everything that is shown of the boards of a run.
#[derive(Clone, Debug)]
pub struct Screen {
    pub(crate) contents: Contents,
    pub(crate) boards: Vec<Board>,
    pub(crate) apart: Sizes,
    /// Rows that wait for a board, by their second.
    rows: BTreeMap<u64, Vec<Option<Cell>>>,
    /// Lines that wait for their row, by their time.
    waiting: BTreeMap<Duration, Vec<String>>,
    lines: VecDeque<String>,
}

impl Screen {
    /// A screen with nothing on it but the heading.
    #[must_use]
    pub fn new(contents: Contents) -> Self {
        Self {
            contents,
            boards: vec![Board::default(); contents.boards],
            apart: Sizes::default(),
            rows: BTreeMap::new(),
            waiting: BTreeMap::new(),
            lines: VecDeque::from([Self::columns(contents).heading()]),
        }
    }

    /// Takes a line of the log of `board`, counted from 0, which came `at` after power-up.
    pub fn handle_log(&mut self, board: usize, at: Duration, line: &LogLine) {
        let Some(state) = self.boards.get_mut(board) else {
            return;
        };
        state.count(line);
        if let Some(status) = Status::parse(&line.text) {
            let (events, pairs) = state.push_status(status);
            if self.contents.verbose {
                self.wait(board, at, &pairs);
            }
            for event in events {
                self.handle_event(board, at, &event);
            }
        } else if let Some(event) = Event::of(line) {
            self.handle_event(board, at, &event);
        }
    }

    /// Takes what happened on `board` at `at` after power-up.
    pub fn handle_event(&mut self, board: usize, at: Duration, event: &Event) {
        if let Some(state) = self.boards.get_mut(board) {
            state.push_event(at, event);
        }
        let text = event.to_string();
        let text = if event.is_trouble() {
            styled(CAUTION, &text)
        } else {
            text
        };
        self.wait(board, at, &text);
    }

    /// Takes what the clock of `board` showed `at_s` seconds after power-up.
    pub fn handle_sample(&mut self, board: usize, at_s: u64, sample: Sample) {
        let boards = self.contents.boards;
        let row = self.rows.entry(at_s).or_insert_with(|| vec![None; boards]);
        if let (Some(cell), Some(state)) = (row.get_mut(board), self.boards.get(board)) {
            let follows_pulse = state.follows_pulse;
            *cell = Some(Cell {
                sample,
                follows_pulse,
            });
        }
        while let Some(entry) = self.rows.first_entry() {
            if !entry.get().iter().all(Option::is_some) {
                return;
            }
            let (at_s, cells) = entry.remove_entry();
            self.show(at_s, &cells);
        }
    }

    /// Gives up what has been waited for too long at `now`, after power-up.
    pub fn handle_timeout(&mut self, now: Duration) {
        let Some(due) = now.as_secs().checked_sub(PATIENCE) else {
            return;
        };
        while let Some(entry) = self.rows.first_entry()
            && *entry.key() <= due
        {
            let (at_s, cells) = entry.remove_entry();
            self.show(at_s, &cells);
        }
        self.release(Duration::from_secs(due));
    }

    /// Shows all that still waits: nothing more will come.
    pub fn handle_end(&mut self) {
        while let Some((at_s, cells)) = self.rows.pop_first() {
            self.show(at_s, &cells);
        }
        self.release(Duration::MAX);
    }

    /// The next line to print, with escape sequences for colours.
    pub fn poll_line(&mut self) -> Option<String> {
        self.lines.pop_front()
    }

    /// Whether the clocks were set in this run.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.boards.iter().all(Board::was_set) {
            Verdict::ClockSet
        } else {
            Verdict::NeverSet
        }
    }

    const fn columns(Contents { boards, errors, .. }: Contents) -> Columns {
        Columns { boards, errors }
    }

    /// Has `text` of `board` wait for the row after it.
    fn wait(&mut self, board: usize, at: Duration, text: &str) {
        let whose = if self.contents.boards > 1 {
            format!("board {}: ", board + 1)
        } else {
            String::new()
        };
        let line = format!("{:>6.1} s  {whose}{text}", at.as_secs_f64());
        self.waiting.entry(at).or_default().push(line);
    }

    /// A row, after the events before it.
    fn show(&mut self, at_s: u64, cells: &[Option<Cell>]) {
        for (board, cell) in self.boards.iter_mut().zip(cells) {
            let sample = cell.map(|cell| cell.sample);
            if let Some(ns) = sample.and_then(|sample| sample.offset_ns) {
                board.errors.push(at_s, ns.unsigned_abs());
            }
            board.last = sample.or(board.last);
        }
        if let Some(ns) = apart_ns(cells) {
            self.apart.push(at_s, ns);
        }
        self.release(Duration::from_secs(at_s));
        let row = Self::columns(self.contents).row(at_s, cells);
        self.lines.push_back(row);
    }

    /// Lines of up to `until` wait no longer.
    fn release(&mut self, until: Duration) {
        while let Some(entry) = self.waiting.first_entry()
            && *entry.key() <= until
        {
            self.lines.extend(entry.remove());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Level;
    use anstream::adapter::strip_str;
    use timebase::ClockState;

    fn screen(boards: usize, verbose: bool) -> Screen {
        Screen::new(Contents {
            boards,
            errors: true,
            verbose,
        })
    }

    fn info(text: &str) -> LogLine {
        LogLine {
            level: Some(Level::Info),
            timestamp: None,
            text: text.to_owned(),
        }
    }

    fn set(offset_ns: i64) -> Sample {
        Sample {
            state: ClockState::Set,
            offset_ns: Some(offset_ns),
            uncertainty_ns: 100_000_000,
        }
    }

    fn lines(screen: &mut Screen) -> Vec<String> {
        std::iter::from_fn(|| screen.poll_line())
            .map(|line| strip_str(&line).to_string())
            .collect()
    }

    /// The first four words of each line.
    fn outline(screen: &mut Screen) -> Vec<String> {
        let lines = lines(screen).into_iter();
        lines
            .map(|line| {
                line.split_whitespace()
                    .take(4)
                    .collect::<Vec<_>>()
                    .join(" ")
            })
            .collect()
    }

    #[test]
    fn a_row_waits_for_every_board_and_an_event_for_its_row() {
        let mut screen = screen(2, false);
        assert_eq!(outline(&mut screen), ["t board 1 board"]);
        let after = |ms| Duration::from_millis(ms);
        screen.handle_sample(0, 1, set(7));
        screen.handle_event(0, after(1_100), &Event::ClientConnected);
        screen.handle_log(1, after(900), &info("the clock is set"));
        assert_eq!(lines(&mut screen).len(), 0);
        screen.handle_sample(1, 1, set(5));
        assert_eq!(outline(&mut screen), ["0.9 s board 2:", "1 s set by"]);
        screen.handle_end();
        assert_eq!(outline(&mut screen), ["1.1 s board 1:"]);
    }

    #[test]
    fn what_steers_a_clock_shows_from_the_event_on() {
        let mut screen = screen(1, false);
        lines(&mut screen);
        let events = [Event::Set, Event::PulseFollowed, Event::PulseLost];
        for (at_s, event) in (1..).zip(events) {
            let before = Duration::from_millis(at_s * 1_000 - 10);
            screen.handle_event(0, before, &event);
            screen.handle_sample(0, at_s, set(7));
        }
        let rows = lines(&mut screen);
        let steered: Vec<_> = rows
            .iter()
            .filter_map(|row| row.split("  set ").nth(1)?.get(..6))
            .collect();
        assert_eq!(steered, ["by mes", "by pul", "by mes"], "{rows:?}");
    }

    #[test]
    fn a_silent_board_is_waited_for_two_seconds() {
        let mut screen = screen(2, false);
        lines(&mut screen);
        screen.handle_sample(0, 1, set(7));
        screen.handle_timeout(Duration::from_millis(2_999));
        assert_eq!(lines(&mut screen).len(), 0);
        screen.handle_timeout(Duration::from_secs(3));
        let shown = lines(&mut screen);
        assert!(shown[0].starts_with("     1 s  set by"), "{shown:?}");
        assert!(shown[0].ends_with('–'), "{shown:?}");
    }

    #[test]
    fn counters_are_shown_when_asked_for_and_refusals_always() {
        for verbose in [false, true] {
            let mut screen = screen(1, verbose);
            lines(&mut screen);
            let status = info("status state=set mark_late=2");
            screen.handle_log(0, Duration::from_secs(1), &status);
            screen.handle_end();
            let shown = lines(&mut screen);
            let (counters, refusal) = (
                "   1.0 s  state=set  mark_late=2",
                "   1.0 s  refused: 2 marks (late)",
            );
            if verbose {
                assert_eq!(shown, [counters, refusal]);
            } else {
                assert_eq!(shown, [refusal]);
            }
        }
    }

    #[test]
    fn the_verdict_is_about_every_board() {
        let mut screen = screen(2, false);
        for board in [0, 1] {
            assert_eq!(screen.verdict(), Verdict::NeverSet);
            // It was set, although it is in holdover now.
            for state in ["unset", "set", "holdover"] {
                let status = info(&format!("status state={state}"));
                screen.handle_log(board, Duration::ZERO, &status);
            }
        }
        assert_eq!(screen.verdict(), Verdict::ClockSet);
    }
}
