//! What can be wrong with a file of a flight.

use std::fmt;

/// What is wrong with a file, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong.
    pub problem: Problem,
}

/// What can be wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    /// A value that is not one.
    Value {
        /// Which column, or which part of the header's line.
        column: &'static str,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// The line ends before this column.
    Missing {
        /// Which.
        column: &'static str,
        /// What may stand there.
        allowed: &'static str,
    },
    /// More stands behind the last column.
    TooMany {
        /// What.
        found: String,
    },
    /// Knots of the crystal have to be in the order of their time.
    Unordered,
    /// `ppm` and `crystal` in one file, or `ppm` twice.
    TwoCrystals,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: ", self.line)?;
        match &self.problem {
            Problem::Value {
                column,
                found,
                allowed,
            } => write!(f, "{column} is `{found}`, allowed is {allowed}"),
            Problem::Missing { column, allowed } => {
                write!(f, "{column} is missing, allowed is {allowed}")
            }
            Problem::TooMany { found } => write!(f, "`{found}` stands behind the last column"),
            Problem::Unordered => {
                f.write_str("this crystal line is earlier than the one before; allowed is order")
            }
            Problem::TwoCrystals => {
                f.write_str("a second crystal; allowed is one ppm line, or crystal lines alone")
            }
        }
    }
}

impl std::error::Error for Error {}
