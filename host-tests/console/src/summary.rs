//! The summary at the end of a run.
//!
//! *Purpose.* The whole run in ten lines, or as one JSON object.
//!
//! *Design.* A line for each figure, a column for each board. Means and largest values are of the
//! samples that were shown: one a second since the clock was first set.
//!
//! *Limits.* A figure that was not measured, as QEMU's CPU load, has no line.

use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::board::Board;
use crate::event::refusals;
use crate::row::{BOLD, styled, uncertainty};
use crate::sample::Sizes;
use crate::{Screen, Status, units};

/// How the emulator fared with one board.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ending {
    /// The board's MAVLink port.
    pub mavlink_port: u16,
    /// How long the board ran.
    pub ran: Duration,
    /// The share of cycles that the core was not asleep, in 10⁻⁶.
    pub cpu_load_ppm: Option<u64>,
    /// The most that it was behind this host's clock.
    pub behind: Option<Duration>,
    /// Frames of the log that could not be decoded.
    pub damaged_log_frames: u64,
    /// Where the firmware went beyond the emulator's models.
    pub gaps: Option<String>,
}

/// The width of the first column, and of each board's.
const NAME: usize = 24;
const COLUMN: usize = 20;

impl Screen {
    /// The summary for people, a line each; one of `endings` a board.
    #[must_use]
    pub fn summary(&self, endings: &[Ending]) -> Vec<String> {
        let ran = endings.iter().map(|ending| ending.ran).max();
        let title = format!("after {:.1} s", ran.unwrap_or_default().as_secs_f64());
        let numbers = (1..=self.boards.len()).map(|board| format!("board {board}"));
        let mut lines = vec![String::new(), styled(BOLD, &line(&title, numbers))];
        let boards = || self.boards.iter();
        lines.push(line("first set after", boards().map(first_set)));
        if self.contents.errors {
            let mean = boards().map(|board| size(board.errors.mean_ns()));
            lines.push(line("error, mean", mean));
            let largest = boards().map(|board| largest(&board.errors));
            lines.push(line("error, largest", largest));
        }
        let last = boards().map(|board| last(board, self.contents.errors));
        lines.push(line("at the end", last));
        let load = |ending: &Ending| Some(format!("{:.2} %", ending.cpu_load_ppm? as f64 / 1e4));
        lines.extend(measured("CPU load", endings.iter().map(load)));
        let behind = |ending: &Ending| Some(units::magnitude(nanos(ending.behind?)));
        lines.extend(measured(
            "behind this host, most",
            endings.iter().map(behind),
        ));
        if self.boards.len() > 1 {
            let mut apart = size(self.apart.mean_ns());
            if self.apart.count > 0 {
                apart = format!(
                    "mean {apart}, largest {}, last {} ({} readings)",
                    largest(&self.apart),
                    units::magnitude(self.apart.last_ns),
                    self.apart.count,
                );
            }
            lines.push(format!("{:<NAME$}{apart}", "apart"));
        }
        lines.push(format!("{:<NAME$}{}", "refused", self.refused()));
        for (board, ending) in (1..).zip(endings) {
            if ending.damaged_log_frames > 0 {
                let count = ending.damaged_log_frames;
                lines.push(format!(
                    "board {board}: {count} frames of its log are damaged"
                ));
            }
            if let Some(gaps) = &ending.gaps {
                lines.push(format!(
                    "board {board}: the emulator has no model for what the firmware did here: {gaps}"
                ));
            }
        }
        lines
    }

    /// The summary for programs.
    #[must_use]
    pub fn to_json(&self, endings: &[Ending]) -> Value {
        let boards: Vec<_> = self
            .boards
            .iter()
            .zip(endings)
            .map(|(board, ending)| self.board_to_json(board, ending))
            .collect();
        let mut object = json!({ "boards": boards });
        if self.boards.len() > 1 {
            object["apart_ns"] = sizes_to_json(&self.apart);
        }
        object
    }

    fn board_to_json(&self, board: &Board, ending: &Ending) -> Value {
        let status = board.status.as_ref();
        let refused: Map<_, _> = status
            .into_iter()
            .flat_map(Status::refusals)
            .map(|(kind, count)| (kind.to_owned(), count.into()))
            .collect();
        let mut object = json!({
            "clock_was_set": board.was_set(),
            "first_set_s": board.first_set.map(|at| at.as_secs_f64()),
            "status_lines": board.statuses,
            "last_status": status.map(Status::to_json),
            "log_lines": board.by_level,
            "refused": refused,
            "mavlink_port": ending.mavlink_port,
            "seconds": ending.ran.as_secs_f64(),
            "damaged_log_frames": ending.damaged_log_frames,
            "emulator_gaps": ending.gaps.is_some(),
        });
        if self.contents.errors {
            object["error_ns"] = sizes_to_json(&board.errors);
        }
        if let Some(load) = ending.cpu_load_ppm {
            object["cpu_load_ppm"] = load.into();
        }
        if let Some(behind) = ending.behind {
            object["behind_ms"] = (behind.as_secs_f64() * 1e3).into();
        }
        object
    }

    /// What was not believed, on all boards.
    fn refused(&self) -> String {
        let mut parts = Vec::new();
        for (number, board) in (1..).zip(&self.boards) {
            let kinds = board.status.iter().flat_map(Status::refusals);
            let kinds: Vec<_> = kinds.map(|(kind, count)| refusals(kind, count)).collect();
            if !kinds.is_empty() && self.boards.len() > 1 {
                parts.push(format!("board {number}: {}", kinds.join(", ")));
            } else {
                parts.extend(kinds);
            }
        }
        if parts.is_empty() {
            return "nothing".to_owned();
        }
        parts.join("; ")
    }
}

/// A line of the summary.
fn line(name: &str, columns: impl Iterator<Item = String>) -> String {
    let mut line = format!("{name:<NAME$}");
    for column in columns {
        line += &format!("{column:<COLUMN$}");
    }
    line.trim_end().to_owned()
}

/// A line of the summary, if anything in it was measured.
fn measured(name: &str, columns: impl Iterator<Item = Option<String>>) -> Option<String> {
    let columns: Vec<_> = columns.collect();
    let is_measured = columns.iter().any(Option::is_some);
    let shown = columns
        .into_iter()
        .map(|column| column.unwrap_or_else(|| "–".to_owned()));
    is_measured.then(|| line(name, shown))
}

fn first_set(board: &Board) -> String {
    match board.first_set {
        Some(at) => format!("{:.2} s", at.as_secs_f64()),
        None if board.was_set() => "–".to_owned(),
        None => "never".to_owned(),
    }
}

/// The last sample.
fn last(board: &Board, errors: bool) -> String {
    let Some(sample) = board.last else {
        return "–".to_owned();
    };
    let uncertainty = format!("±{}", uncertainty(sample.uncertainty_ns));
    match sample.offset_ns {
        Some(ns) if errors => format!("{} {uncertainty}", units::difference(ns)),
        Some(_) => uncertainty,
        None => "not set".to_owned(),
    }
}

fn size(ns: Option<u64>) -> String {
    ns.map_or("–".to_owned(), units::magnitude)
}

fn largest(sizes: &Sizes) -> String {
    if sizes.count == 0 {
        return "–".to_owned();
    }
    format!(
        "{} at {} s",
        units::magnitude(sizes.largest_ns),
        sizes.largest_at_s
    )
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn sizes_to_json(sizes: &Sizes) -> Value {
    if sizes.count == 0 {
        return Value::Null;
    }
    json!({
        "mean": sizes.mean_ns(),
        "largest": sizes.largest_ns,
        "largest_at_s": sizes.largest_at_s,
        "last": sizes.last_ns,
        "readings": sizes.count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Contents, Event, Level, LogLine, Sample};
    use anstream::adapter::strip_str;
    use timebase::ClockState;

    fn two_boards(errors: bool) -> (Screen, [Ending; 2]) {
        let mut screen = Screen::new(Contents {
            boards: 2,
            errors,
            verbose: false,
        });
        for board in [0, 1] {
            screen.handle_event(board, Duration::from_millis(986), &Event::Set);
        }
        for (at_s, offsets) in [
            (1, [-60_000_000, -61_000_000]),
            (2, [-61_030_000, -60_984_000]),
        ] {
            for (board, ns) in offsets.into_iter().enumerate() {
                let sample = Sample {
                    state: ClockState::Set,
                    offset_ns: Some(ns),
                    uncertainty_ns: 121_000_000,
                };
                screen.handle_sample(board, at_s, sample);
            }
        }
        let status = LogLine {
            level: Some(Level::Info),
            timestamp: None,
            text: "status state=set mark_late=1 mark_outlier=12".to_owned(),
        };
        screen.handle_log(1, Duration::from_secs(2), &status);
        let ending = |mavlink_port| Ending {
            mavlink_port,
            ran: Duration::from_secs(2),
            cpu_load_ppm: Some(4_412),
            behind: Some(Duration::from_millis(928)),
            ..Ending::default()
        };
        (screen, [ending(5_760), ending(5_761)])
    }

    fn plain(screen: &Screen, endings: &[Ending]) -> Vec<String> {
        let lines = screen.summary(endings).into_iter();
        lines.map(|line| strip_str(&line).to_string()).collect()
    }

    #[test]
    fn the_summary_has_a_line_a_figure_and_a_column_a_board() {
        let (screen, endings) = two_boards(true);
        assert_eq!(
            plain(&screen, &endings),
            [
                "",
                "after 2.0 s             board 1             board 2",
                "first set after         0.99 s              0.99 s",
                "error, mean             60.5 ms             61.0 ms",
                "error, largest          61.0 ms at 2 s      61.0 ms at 1 s",
                "at the end              −61.03 ms ±121 ms   −60.98 ms ±121 ms",
                "CPU load                0.44 %              0.44 %",
                "behind this host, most  928 ms              928 ms",
                "apart                   mean 523 µs, largest 1.00 ms at 1 s, last 46.0 µs (2 readings)",
                "refused                 board 2: 1 mark (late), 12 marks (outlier)",
            ]
        );
    }

    #[test]
    fn what_was_not_measured_has_no_line() {
        let (screen, endings) = two_boards(false);
        let endings = endings.map(|ending| Ending {
            cpu_load_ppm: None,
            behind: None,
            ..ending
        });
        let lines = plain(&screen, &endings).join("\n");
        assert!(!lines.contains("error") && !lines.contains("CPU") && !lines.contains("behind"));
        assert!(lines.contains("apart"), "{lines}");
    }

    #[test]
    fn a_run_without_a_set_clock_says_so() {
        let contents = Contents {
            boards: 1,
            errors: true,
            verbose: false,
        };
        let lines = plain(&Screen::new(contents), &[Ending::default()]).join("\n");
        assert!(lines.contains("first set after         never"), "{lines}");
        assert!(lines.contains("refused                 nothing"), "{lines}");
        assert!(!lines.contains("apart"), "{lines}");
    }

    #[test]
    fn json_has_every_counter_of_every_board() {
        let (screen, endings) = two_boards(true);
        let json = screen.to_json(&endings);
        let second = &json["boards"][1];
        assert_eq!(second["last_status"]["mark_outlier"], 12);
        assert_eq!(
            second["refused"],
            json!({"mark_late": 1, "mark_outlier": 12})
        );
        assert_eq!(second["log_lines"], json!({"info": 1}));
        assert_eq!(second["mavlink_port"], 5_761);
        assert_eq!(second["cpu_load_ppm"], 4_412);
        assert_eq!(second["error_ns"]["largest"], 61_000_000);
        assert_eq!(second["clock_was_set"], true);
        assert_eq!(json["apart_ns"]["last"], 46_000);
        assert_eq!(json["apart_ns"]["readings"], 2);
    }
}
