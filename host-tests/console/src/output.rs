//! The screen on standard output.
//!
//! *Purpose.* Boards run in threads and [`Report`]; one thread prints.
//!
//! *Design.* With `--json` nothing is printed before the summary.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use crate::{Ending, Event, LogLine, Sample, Screen};

/// How often a screen looks for rows that have waited long enough.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// What a board has to say while it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Report {
    /// A line of its log.
    Log {
        /// When it came, after power-up.
        at: Duration,
        /// The line.
        line: LogLine,
    },
    /// Something that is not in its log.
    Event {
        /// When, after power-up.
        at: Duration,
        /// What.
        event: Event,
    },
    /// Its clock at a whole second.
    Sample {
        /// The second, after power-up.
        at_s: u64,
        /// The clock.
        sample: Sample,
    },
}

/// Prints what comes of the boards' `reports`, each with the board's index, until all senders are
/// gone. With `powered` (when the boards got power), a silent board keeps no row waiting.
pub fn show(
    screen: &mut Screen,
    reports: &Receiver<(usize, Report)>,
    powered: Option<Instant>,
    json: bool,
) {
    loop {
        print_lines(screen, json);
        match (reports.recv_timeout(LOOK_EVERY), powered) {
            (Ok((board, report)), _) => match report {
                Report::Log { at, line } => screen.handle_log(board, at, &line),
                Report::Event { at, event } => screen.handle_event(board, at, &event),
                Report::Sample { at_s, sample } => screen.handle_sample(board, at_s, sample),
            },
            (Err(RecvTimeoutError::Timeout), Some(powered)) => {
                screen.handle_timeout(powered.elapsed());
            }
            (Err(RecvTimeoutError::Timeout), None) => {}
            (Err(RecvTimeoutError::Disconnected), _) => break,
        }
    }
    screen.handle_end();
    print_lines(screen, json);
}

/// Prints the summary of a run that ended with `endings`, one a board.
pub fn print_summary(screen: &Screen, endings: &[Ending], json: bool) {
    if json {
        crate::print_line!("{}", screen.to_json(endings));
        return;
    }
    for line in screen.summary(endings) {
        crate::print_line!("{line}");
    }
}

fn print_lines(screen: &mut Screen, json: bool) {
    while let Some(line) = screen.poll_line() {
        if !json {
            crate::print_line!("{line}");
        }
    }
}
