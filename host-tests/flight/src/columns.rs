//! The columns of a line, each read as what it has to be.

use std::str::FromStr;

use crate::WorldPicos;
use crate::error::Problem;

/// No event is earlier than 60 s before the flight's start: the board is on by then.
pub const EARLIEST: WorldPicos = WorldPicos::from_millis(-60_000);
/// No event is later than eleven days and a half.
pub const LATEST: WorldPicos = WorldPicos::from_millis(1_000_000_000);

/// The columns of a line that are still to be read.
pub(crate) struct Columns<'a> {
    pub(crate) rest: Option<&'a str>,
    separator: char,
}

impl<'a> Columns<'a> {
    /// The columns of `line`.
    pub(crate) const fn of(line: &'a str, separator: char) -> Self {
        Self {
            rest: Some(line),
            separator,
        }
    }

    /// The next one, without blanks around it; none where the line has ended or
    /// nothing stands.
    pub(crate) fn next(&mut self) -> Option<&'a str> {
        let rest = self.rest?;
        let rest = if self.separator == ' ' {
            rest.trim_start()
        } else {
            rest
        };
        let (column, rest) = match rest.split_once(self.separator) {
            Some((column, rest)) => (column, Some(rest)),
            None => (rest, None),
        };
        self.rest = rest;
        Some(column.trim()).filter(|column| !column.is_empty())
    }

    /// The next one, which has to be there.
    pub(crate) fn text(
        &mut self,
        column: &'static str,
        allowed: &'static str,
    ) -> Result<&'a str, Problem> {
        self.next().ok_or(Problem::Missing { column, allowed })
    }

    /// The next one as what `read` makes of it.
    pub(crate) fn value<T>(
        &mut self,
        column: &'static str,
        allowed: &'static str,
        read: impl FnOnce(&str) -> Option<T>,
    ) -> Result<T, Problem> {
        let found = self.text(column, allowed)?;
        read(found).ok_or_else(|| wrong(column, found, allowed))
    }

    /// A number of any type that has its own limits.
    pub(crate) fn number<T: FromStr>(
        &mut self,
        column: &'static str,
        allowed: &'static str,
    ) -> Result<T, Problem> {
        self.value(column, allowed, |found| found.parse().ok())
    }

    /// A decimal number within limits.
    pub(crate) fn decimal(
        &mut self,
        column: &'static str,
        allowed: &'static str,
        most: f64,
    ) -> Result<f64, Problem> {
        let within = |number: &f64| number.abs() <= most;
        self.value(column, allowed, |found| found.parse().ok().filter(within))
    }

    pub(crate) fn time(&mut self) -> Result<WorldPicos, Problem> {
        let allowed = "a decimal number of us, from -6e7 to 1e12";
        self.value("the time", allowed, parse_micros)
    }

    /// The last column of a message; rounded up, for it bounds something.
    pub(crate) fn busy_us(&mut self) -> Result<Option<u64>, Problem> {
        let Some(found) = self.next() else {
            return Ok(None);
        };
        let ps = parse_micros(found).filter(|time| time.0 >= 0);
        match ps {
            Some(time) => Ok(Some(time.0.unsigned_abs().div_ceil(1_000_000))),
            None => Err(wrong("busy_us", found, "a number of us, 0 to 1e12")),
        }
    }

    pub(crate) fn end(mut self) -> Result<(), Problem> {
        while self.rest.is_some() {
            if let Some(found) = self.next() {
                let found = found.to_owned();
                return Err(Problem::TooMany { found });
            }
        }
        Ok(())
    }
}

pub(crate) fn wrong(column: &'static str, found: &str, allowed: &'static str) -> Problem {
    // A line of noise can be long.
    let found = found.chars().take(40).collect();
    Problem::Value {
        column,
        found,
        allowed,
    }
}

/// A decimal number of µs between [`EARLIEST`] and [`LATEST`], exactly.
pub(crate) fn parse_micros(text: &str) -> Option<WorldPicos> {
    let (is_negative, digits) = match text.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() && part.is_empty() {
        return None;
    }
    let all_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if !all_digits(whole) || !all_digits(part) {
        return None;
    }
    let us: i64 = if whole.is_empty() {
        0
    } else {
        whole.parse().ok()?
    };
    let mut ps: i64 = 0;
    for place in 0..6 {
        let digit = part.as_bytes().get(place).map_or(0, |byte| byte - b'0');
        ps = ps * 10 + i64::from(digit);
    }
    let rounds_up = part.as_bytes().get(6).is_some_and(|byte| *byte >= b'5');
    let ps = us
        .checked_mul(1_000_000)?
        .checked_add(ps + i64::from(rounds_up))?;
    let at = WorldPicos(if is_negative { -ps } else { ps });
    (EARLIEST..=LATEST).contains(&at).then_some(at)
}

pub(crate) fn parse_hex(text: &str) -> Option<u8> {
    u8::from_str_radix(text.trim_start_matches("0x"), 16).ok()
}

/// A width of the pulse, in ns.
pub(crate) fn parse_width(text: &str) -> Option<u32> {
    let unit_at = text.find(char::is_alphabetic)?;
    let (number, unit) = text.split_at(unit_at);
    let ns = match unit {
        "s" => 1e9,
        "ms" => 1e6,
        "us" => 1e3,
        "ns" => 1.0,
        _ => return None,
    };
    let width_ns = (number.parse::<f64>().ok()? * ns).round();
    (0.0..=1e9).contains(&width_ns).then_some(width_ns as u32)
}
