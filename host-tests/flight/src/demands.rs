//! What is demanded of a clock on a flight, and whether it was met.
//!
//! *Design.* A table of demands is CSV, `file,from_s,to_s,demand,bound_ns`. Each has a
//! [`Tally`] over its own span, so that nothing from outside counts.
//!
//! | demand | is met when |
//! |---|---|
//! | `right` | the clock is set in 99.9 % of the readings, each error is within the bound, no claim is wider than 5 µs where 250 ns are asked for and 250 ms elsewhere, and it does not mislead |
//! | `not misleading` | it is never beyond its claim for more than 1 s on end |

use std::fmt;

use world::WorldPicos;

use crate::judge::Tally;
use crate::{Reading, Window};

/// Readings of a thousand that have to be set for a span to be right.
const SET_PERMILLE: u64 = 999;
/// A bound up to here is one that only a proved pulse can keep, in ns.
const PULSE_BOUND_NS: u64 = 250;
/// The widest claim that counts as right under such a bound, in ns.
const PULSE_CLAIM_NS: u64 = 5_000;
/// The widest claim that counts as right elsewhere, in ns.
const MESSAGE_CLAIM_NS: u64 = 250_000_000;

/// What can be demanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// To be right within a number of ns.
    Right {
        /// How far off a reading may be, in ns.
        bound_ns: u64,
    },
    /// Not to mislead.
    NotMisleading,
}

/// A demand.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// The flight's file, without its folder.
    pub file: String,
    /// The span.
    pub span: Window,
    /// What is demanded over it.
    pub kind: Kind,
}

/// What is wrong with a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableError {
    /// The line, counted from 1.
    pub line: u64,
    /// What is wrong.
    pub problem: String,
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, problem } = self;
        write!(
            f,
            "line {line}: {problem}; allowed is file,from_s,to_s,demand,bound_ns with the demand \
             `right` and a bound in ns, or `not misleading` and none"
        )
    }
}

impl std::error::Error for TableError {}

/// Reads a table of demands.
///
/// # Errors
///
/// What is wrong with it, and in which line.
pub fn parse(table: &[u8]) -> Result<Vec<Demand>, TableError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(table);
    let mut demands = Vec::new();
    for row in reader.byte_records() {
        let row = row.map_err(|error| TableError {
            line: error.position().map_or(0, csv::Position::line),
            problem: error.to_string(),
        })?;
        let column = |index: usize| String::from_utf8_lossy(row.get(index).unwrap_or_default());
        let fail = |problem: String| TableError {
            line: row.position().map_or(0, csv::Position::line),
            problem,
        };
        let seconds = |index: usize| {
            let text = column(index);
            let number: Option<f64> = text.parse().ok().filter(|s: &f64| s.is_finite());
            number.ok_or_else(|| fail(format!("`{text}` is no number of s")))
        };
        let kind = match &*column(3) {
            "right" => {
                let bound = column(4);
                let bound_ns = bound
                    .parse()
                    .map_err(|_| fail(format!("`{bound}` is no bound")))?;
                Kind::Right { bound_ns }
            }
            "not misleading" => Kind::NotMisleading,
            other => return Err(fail(format!("`{other}` is no demand"))),
        };
        let span = Window {
            from_s: seconds(1)?,
            until_s: seconds(2)?,
            name: kind.to_string(),
        };
        let file = column(0).into_owned();
        demands.push(Demand { file, span, kind });
    }
    Ok(demands)
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Right { .. } => f.write_str("right"),
            Self::NotMisleading => f.write_str("not misleading"),
        }
    }
}

impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Window {
            from_s, until_s, ..
        } = self.span;
        match self.kind {
            Kind::NotMisleading => write!(f, "{from_s}-{until_s} s: {}", self.kind),
            Kind::Right { bound_ns } => write!(
                f,
                "{from_s}-{until_s} s: {} within {} ms",
                self.kind,
                bound_ns as f64 * 1e-6
            ),
        }
    }
}

/// Why a demand was not met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unmet {
    /// The flight has no reading in the span.
    NoReading,
    /// The clock was beyond its claim for so long.
    Misleading {
        /// The longest run.
        lasts: WorldPicos,
        /// The largest error in the span, in ns.
        worst_ns: u64,
    },
    /// It was set too seldom.
    Unset {
        /// The share of readings that were set.
        set_share: f64,
    },
    /// It was too far off.
    Off {
        /// The largest error, in ns.
        worst_ns: u64,
    },
    /// It claimed too little.
    Wide {
        /// The widest uncertainty, in ns.
        claim_ns: u64,
    },
}

impl fmt::Display for Unmet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |ns: u64| ns as f64 * 1e-6;
        match *self {
            Self::NoReading => f.write_str("no reading"),
            Self::Misleading { lasts, worst_ns } => write!(
                f,
                "misleading for {:.0} s, by up to {} ms",
                lasts.as_secs(),
                ms(worst_ns)
            ),
            Self::Unset { set_share } => write!(f, "set in {:.1} %", 100.0 * set_share),
            Self::Off { worst_ns } => write!(f, "off by {} ms", ms(worst_ns)),
            Self::Wide { claim_ns } => write!(f, "claims {} ms", ms(claim_ns)),
        }
    }
}

/// A demand while a flight is judged.
#[derive(Clone, Debug)]
pub struct Judged<'a> {
    /// What is demanded.
    pub demand: &'a Demand,
    tally: Tally,
}

impl<'a> Judged<'a> {
    /// Before the first reading.
    #[must_use]
    pub fn new(demand: &'a Demand) -> Self {
        let tally = Tally::default();
        Self { demand, tally }
    }

    /// Takes the next reading, beside true UTC in ns since 1970.
    pub fn push(&mut self, reading: &Reading, true_utc_ns: i64) {
        if self.demand.span.has(reading.at) {
            self.tally.push(reading, true_utc_ns);
        }
    }

    /// Whether it was met.
    ///
    /// # Errors
    ///
    /// Why not.
    pub fn verdict(&self) -> Result<(), Unmet> {
        let tally = &self.tally;
        let worst_ns = tally.worst_ns();
        if tally.readings == 0 {
            return Err(Unmet::NoReading);
        }
        if tally.is_misleading() {
            let lasts = tally.longest_beyond();
            return Err(Unmet::Misleading { lasts, worst_ns });
        }
        let Kind::Right { bound_ns } = self.demand.kind else {
            return Ok(());
        };
        if tally.set * 1_000 < tally.readings * SET_PERMILLE {
            let set_share = tally.set as f64 / tally.readings as f64;
            return Err(Unmet::Unset { set_share });
        }
        if worst_ns > bound_ns {
            return Err(Unmet::Off { worst_ns });
        }
        let claim_ns = tally.uncertainty_ns.map_or(0, |claim| claim.max);
        let allowed_ns = if bound_ns <= PULSE_BOUND_NS {
            PULSE_CLAIM_NS
        } else {
            MESSAGE_CLAIM_NS
        };
        if claim_ns > allowed_ns {
            return Err(Unmet::Wide { claim_ns });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::READ_EVERY;

    const TABLE: &str = "file,from_s,to_s,demand,bound_ns\n\
        a.ev,0,30,not misleading,\n\
        a.ev,30,100,right,250\n\
        b.ev,0.5,10,right,90000000\n";

    #[test]
    fn a_table_is_read_and_a_bad_one_says_where() {
        let demands = parse(TABLE.as_bytes()).unwrap();
        let printed: Vec<_> = demands.iter().map(Demand::to_string).collect();
        assert_eq!(
            printed,
            [
                "0-30 s: not misleading",
                "30-100 s: right within 0.00025 ms",
                "0.5-10 s: right within 90 ms"
            ]
        );
        for (row, problem) in [
            ("a.ev,x,1,right,1", "`x` is no number of s"),
            ("a.ev,0,1,right,", "`` is no bound"),
            ("a.ev,0,1,wrong,1", "`wrong` is no demand"),
            ("a.ev", "`` is no demand"),
        ] {
            let error = parse(format!("{TABLE}{row}\n").as_bytes()).unwrap_err();
            assert_eq!((error.line, &*error.problem), (5, problem));
        }
    }

    /// 1 000 readings from 0 on, the n-th as `claim` has it.
    fn verdict(kind: Kind, claim: impl Fn(i64) -> Option<(i64, u64)>) -> Result<(), Unmet> {
        let demand = Demand {
            file: String::new(),
            span: Window {
                from_s: 0.0,
                until_s: 1e6,
                name: String::new(),
            },
            kind,
        };
        let mut judged = Judged::new(&demand);
        for k in 0..1_000 {
            let at = WorldPicos(READ_EVERY.0 * k);
            let mut reading = Reading::unset(at, "nothing");
            if let Some((error_ns, uncertainty_ns)) = claim(k) {
                reading.utc_ns = Some(7 + error_ns);
                reading.uncertainty_ns = Some(uncertainty_ns);
                reading.state = "set";
            }
            judged.push(&reading, 7);
        }
        judged.verdict()
    }

    #[test]
    fn right_is_set_within_the_bound_and_claimed() {
        let right = |bound_ns| Kind::Right { bound_ns };
        assert_eq!(verdict(right(250), |_| Some((-250, 5_000))), Ok(()));
        assert_eq!(
            verdict(right(250), |_| Some((0, 5_001))),
            Err(Unmet::Wide { claim_ns: 5_001 })
        );
        assert_eq!(verdict(right(251), |_| Some((251, 250_000_000))), Ok(()));
        assert_eq!(
            verdict(right(251), |_| Some((0, 250_000_001))),
            Err(Unmet::Wide {
                claim_ns: 250_000_001
            })
        );
        assert_eq!(
            verdict(right(250), |k| Some((if k == 9 { 251 } else { 0 }, 5_000))),
            Err(Unmet::Off { worst_ns: 251 })
        );
        // One reading in a thousand may be unset, two may not.
        assert_eq!(verdict(right(250), |k| (k > 0).then_some((0, 9))), Ok(()));
        assert_eq!(
            verdict(right(250), |k| (k > 1).then_some((0, 9))),
            Err(Unmet::Unset { set_share: 0.998 })
        );
    }

    #[test]
    fn misleading_comes_before_all_other_reasons() {
        for kind in [Kind::NotMisleading, Kind::Right { bound_ns: 250 }] {
            let printed = verdict(kind, |k| (k > 100).then_some((1_000_000, 10)));
            assert!(matches!(
                printed,
                Err(Unmet::Misleading {
                    worst_ns: 1_000_000,
                    ..
                })
            ));
        }
        // Nothing is claimed, nobody is misled.
        assert_eq!(verdict(Kind::NotMisleading, |_| None), Ok(()));
        assert_eq!(
            verdict(Kind::Right { bound_ns: 250 }, |_| None),
            Err(Unmet::Unset { set_share: 0.0 })
        );
    }
}
