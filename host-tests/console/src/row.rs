//! A row of figures: one second, all boards.
//!
//! *Purpose.* Columns that stay where they are, whatever stands in them.
//!
//! *Design.* A cell shows how the clock is steered, how far off it is, and how far off it may be by
//! its own claim. Colours are escape sequences in the text; printing to anything but a terminal
//! strips them.
//!
//! *Limits.* Four boards are wider than most terminals.

use anstyle::{AnsiColor, Style};
use timebase::ClockState;

use crate::sample::{Cell, apart_ns};
use crate::units;

/// All is well.
const GOOD: Style = AnsiColor::Green.on_default();
/// Something is not as it should be.
pub(crate) const CAUTION: Style = AnsiColor::Yellow.on_default();
/// A promise is broken.
const BROKEN: Style = AnsiColor::Red.on_default().bold();
/// Nothing to see yet.
const FAINT: Style = Style::new().dimmed();
/// What the whole table is about.
pub(crate) const BOLD: Style = Style::new().bold();

/// Widths: of the seconds with their unit, of how a clock is steered, of a difference before and
/// after the blank, of an uncertainty.
const SECONDS: usize = 6;
const STEERED: usize = 15;
const VALUE: usize = 6;
const UNIT: usize = 2;
const UNCERTAINTY: usize = 8;
/// Between two columns.
const GAP: &str = "  ";

/// How a row is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Columns {
    /// How many boards.
    pub(crate) boards: usize,
    /// The reference is worth comparing with: there is a column of errors.
    pub(crate) errors: bool,
}

impl Columns {
    /// The line above the rows.
    pub(crate) fn heading(self) -> String {
        let mut line = format!("{:>SECONDS$}  ", "t");
        for board in 1..=self.boards {
            line += GAP;
            line += &format!("{:<1$}", format!("board {board}"), self.cell_width());
        }
        if self.boards > 1 {
            line += GAP;
            line += "apart";
        }
        styled(BOLD, line.trim_end())
    }

    /// The row of second `at_s`; a silent board has a dash.
    pub(crate) fn row(self, at_s: u64, cells: &[Option<Cell>]) -> String {
        let mut line = time(at_s);
        for cell in cells {
            line += GAP;
            line += &match cell {
                Some(cell) => self.cell(cell),
                None => padded(FAINT, "–", self.cell_width()),
            };
        }
        if self.boards > 1 {
            line += GAP;
            line += &match apart_ns(cells) {
                Some(ns) => styled(BOLD, &units::magnitude(ns)),
                None => styled(FAINT, "–"),
            };
        }
        line.trim_end().to_owned()
    }

    fn cell_width(self) -> usize {
        let error = GAP.len() + VALUE + 1 + UNIT;
        STEERED + if self.errors { error } else { 0 } + 1 + UNCERTAINTY
    }

    fn cell(self, cell: &Cell) -> String {
        let sample = &cell.sample;
        let (steered, style) = match (sample.state, cell.follows_pulse) {
            (ClockState::Unset, _) => {
                return padded(FAINT, "not set", self.cell_width());
            }
            (ClockState::Unproved, _) => ("second unproved", CAUTION),
            (ClockState::Holdover, _) => ("holdover", CAUTION),
            (ClockState::Set, true) => ("set by pulse", GOOD),
            (ClockState::Set, false) => ("set by messages", GOOD),
        };
        let mut text = padded(style, steered, STEERED);
        if self.errors {
            let error = sample.offset_ns.map(units::difference).unwrap_or_default();
            let (value, unit) = error.split_once(' ').unwrap_or_default();
            let error = format!("{value:>VALUE$} {unit:<UNIT$}");
            let style = if sample.is_misleading() {
                BROKEN
            } else {
                Style::new()
            };
            text += GAP;
            text += &styled(style, &error);
        }
        let uncertainty = format!("±{}", uncertainty(sample.uncertainty_ns));
        text + &format!(" {uncertainty:<UNCERTAINTY$}")
    }
}

/// An uncertainty with its unit, which is days where seconds have no room in their column.
pub(crate) fn uncertainty(ns: u64) -> String {
    const DAY_NS: u64 = 86_400_000_000_000;
    if ns < DAY_NS {
        units::magnitude(ns)
    } else {
        format!("{} d", ns.div_ceil(DAY_NS))
    }
}

/// The first column: whole seconds since power-up.
fn time(at_s: u64) -> String {
    format!("{at_s:>SECONDS$} s")
}

/// `text` with the escape sequences of `style` around it.
pub(crate) fn styled(style: Style, text: &str) -> String {
    format!("{style}{text}{style:#}")
}

/// The same, and blanks up to `width`.
fn padded(style: Style, text: &str, width: usize) -> String {
    let blanks = width.saturating_sub(text.chars().count());
    styled(style, text) + &" ".repeat(blanks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sample;
    use anstream::adapter::strip_str;

    const TWO: Columns = Columns {
        boards: 2,
        errors: true,
    };

    fn cell(offset_ns: i64, uncertainty_ns: u64) -> Option<Cell> {
        Some(Cell {
            sample: Sample {
                state: ClockState::Set,
                offset_ns: Some(offset_ns),
                uncertainty_ns,
            },
            follows_pulse: uncertainty_ns < 1_000_000,
        })
    }

    const UNSET: Option<Cell> = Some(Cell {
        sample: Sample::UNSET,
        follows_pulse: false,
    });

    fn plain(text: &str) -> String {
        strip_str(text).to_string()
    }

    #[test]
    fn a_row_is_read_without_a_manual() {
        let cells = [
            cell(-61_030_000, 121_000_000),
            cell(-60_984_000, 121_400_000),
        ];
        assert_eq!(
            plain(&TWO.row(20, &cells)),
            "    20 s  set by messages  −61.03 ms ±121 ms   set by messages  −60.98 ms ±121 ms   46.0 µs"
        );
        let cells = [cell(28, 410), cell(-9, 1_230)];
        assert_eq!(
            plain(&TWO.row(1_234, &cells)),
            "  1234 s  set by pulse        +28 ns ±410 ns   set by pulse         −9 ns ±1.23 µs  37 ns"
        );
    }

    #[test]
    fn columns_stay_where_the_heading_puts_them() {
        let column = |line: &str, what: &str| {
            let at = line.find(what).expect(what);
            line[..at].chars().count()
        };
        let heading = plain(&TWO.heading());
        let rows = [
            [
                cell(-61_030_000, 121_000_000),
                cell(5, 1_024 * 7 * 86_400_000_000_000),
            ],
            [cell(3_000_000_000, 18_000_000_410), cell(5, 1 << 60)],
            [cell(12, 45), cell(-999_900_000, 1_230_000)],
            [UNSET, cell(-1, 1)],
            [None, cell(-1, 1)],
        ];
        for cells in rows {
            let row = plain(&TWO.row(3, &cells));
            let second = row.rfind("set by").expect("the second board is set");
            assert_eq!(
                row[..second].chars().count(),
                column(&heading, "board 2"),
                "{row}"
            );
        }
        let row = plain(&TWO.row(3, &[UNSET, None]));
        assert_eq!(column(&row, "not set"), column(&heading, "board 1"));
        assert_eq!(row.chars().last(), Some('–'));
        let apart = row.chars().count() - 1;
        assert_eq!(apart, column(&heading, "apart"));
    }

    #[test]
    fn without_a_truth_there_is_no_column_of_errors() {
        let one = Columns {
            boards: 1,
            errors: false,
        };
        let row = one.row(7, &[cell(-61_030_000, 121_000_000)]);
        assert_eq!(plain(&row), "     7 s  set by messages ±121 ms");
        assert_eq!(plain(&one.heading()), "     t    board 1");
        assert_eq!(plain(&one.row(7, &[UNSET])), "     7 s  not set");
    }

    #[test]
    fn what_is_not_proved_is_said() {
        let mut unproved = cell(-3_000_000_000, 18_000_000_410);
        if let Some(cell) = &mut unproved {
            cell.sample.state = ClockState::Unproved;
        }
        assert_eq!(
            plain(&TWO.row(5, &[unproved, None])),
            "     5 s  second unproved  −3.000 s  ±18.0 s   –                                    –"
        );
        // A clock that claims nothing has no interval to be outside of.
        assert!(!format!("{:?}", TWO.row(5, &[UNSET, None])).contains('±'));
    }

    #[test]
    fn an_error_beyond_its_claim_stands_out() {
        let broken = format!("{BROKEN}");
        assert!(!TWO.row(1, &[cell(-100, 100), None]).contains(&broken));
        assert!(TWO.row(1, &[cell(-101, 100), None]).contains(&broken));
    }
}
