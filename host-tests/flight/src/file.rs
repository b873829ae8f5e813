//! Flights as files (`.ev`): one event a line, a header of lines with `#`.
//!
//! *Design.* A line that begins with `#` and one of the header's words is read
//! strictly, any other is a comment. Events may stand in any order and are sorted.
//! What is written is read as the same flight again; only the place of comments
//! among other lines is not kept.
//!
//! ```text
//! # ppm 20
//! # pulse 100ms high
//! # window 60 120 good
//! 75925.650,mark,1795309323000000000,25,37,0
//! 84605.650,tp,582,3724000,2446,0b,8680
//! 1000000.041,pulse
//! 1100000.073,fall
//! 1125428.395,ls,2,18,0,-2422924,0
//! ```
//!
//! *Limits.* Times from 60 s before the start to eleven days and a half, decimals beyond a ps are rounded.

use std::fmt;

use crate::columns::{Columns, parse_hex, parse_micros, parse_width, wrong};
use crate::error::{Error, Problem};
use crate::{
    Crystal, Event, EventKind, Header, Knot, LeapStep, PulseName, PulseShape, Window, WorldPicos,
};

/// No crystal is further off than 1 %, in ppm.
const MOST_PPM: f64 = 10_000.0;

/// A flight: what the board saw, and what is known about it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    /// What is known.
    pub header: Header,
    /// What the board saw, in the order of its time.
    pub events: Vec<Event>,
}

impl Flight {
    /// Whether a file's content looks like a flight, good or bad: its first line with
    /// anything in it is a `#` line, or a number, a comma and a word.
    #[must_use]
    pub fn is_one(content: &[u8]) -> bool {
        let head = &content[..content.len().min(1_000)];
        let line = head
            .split(|byte| *byte == b'\n')
            .map(<[u8]>::trim_ascii)
            .find(|line| !line.is_empty());
        let Some(line) = line.and_then(|line| str::from_utf8(line).ok()) else {
            return false;
        };
        line.starts_with('#')
            || line.split_once(',').is_some_and(|(at, rest)| {
                parse_micros(at.trim()).is_some()
                    && rest.trim_start().starts_with(char::is_alphabetic)
            })
    }

    /// Reads one.
    ///
    /// # Errors
    ///
    /// What is wrong with it, and in which line.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let mut header = HeaderLines::default();
        let mut events = Vec::new();
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.trim();
            let read = if let Some(line) = line.strip_prefix('#') {
                header.read(line.trim())
            } else if line.is_empty() {
                Ok(())
            } else {
                read_event(line).map(|event| events.push(event))
            };
            read.map_err(|problem| Error {
                line: number,
                problem,
            })?;
        }
        events.sort_by_key(|event| event.at);
        Ok(Self {
            header: header.finish(),
            events,
        })
    }

    /// When the last event comes; 0 without one.
    #[must_use]
    pub fn end(&self) -> WorldPicos {
        self.events
            .last()
            .map_or(WorldPicos::default(), |event| event.at)
    }
}

impl fmt::Display for Flight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.header)?;
        for event in &self.events {
            write!(f, "{},", event.at)?;
            match event.kind {
                EventKind::Mark {
                    utc_ns,
                    t_acc_ns,
                    valid,
                    ..
                } => write!(f, "mark,{utc_ns},{t_acc_ns},{valid:02x}")?,
                EventKind::Mark60 { nano, .. } => write!(f, "mark60,{nano}")?,
                EventKind::Rise => write!(f, "pulse")?,
                EventKind::Fall => write!(f, "fall")?,
                EventKind::TimTp { late_ps, names, .. } => {
                    write!(f, "tp,{late_ps}")?;
                    match names {
                        Some(PulseName {
                            tow_ms,
                            week,
                            flags,
                        }) => write!(f, ",{tow_ms},{week},{flags:02x}")?,
                        // Empty columns, so that the last one keeps its place.
                        None if event.kind.busy_us().is_some() => write!(f, ",,,")?,
                        None => {}
                    }
                }
                EventKind::TimeLs {
                    source,
                    count,
                    change,
                    to_event_s,
                    ..
                } => write!(f, "ls,{source},{count},{change},{to_event_s}")?,
            }
            if let Some(busy_us) = event.kind.busy_us() {
                write!(f, ",{busy_us}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

fn read_event(line: &str) -> Result<Event, Problem> {
    let mut columns = Columns::of(line, ',');
    let at = columns.time()?;
    let allowed = "mark, mark60, pulse, fall, tp or ls";
    let kind = match columns.text("the event", allowed)? {
        "mark" => EventKind::Mark {
            utc_ns: columns.number("utc_ns", "a whole number of ns since 1970, 64 bits")?,
            t_acc_ns: columns.number("tacc_ns", "a whole number of ns, 0 to 4294967295")?,
            valid: columns.value("valid_hex", "one byte in hex, 00 to ff", parse_hex)?,
            busy_us: columns.busy_us()?,
        },
        "mark60" => EventKind::Mark60 {
            nano: columns.number("nano", "a whole number of ns, 32 bits")?,
            busy_us: columns.busy_us()?,
        },
        "pulse" => EventKind::Rise,
        "fall" => EventKind::Fall,
        "tp" => {
            let late_ps = columns.number("late_ps", "a whole number of ps, 32 bits")?;
            EventKind::TimTp {
                late_ps,
                names: read_name(&mut columns)?,
                busy_us: columns.busy_us()?,
            }
        }
        "ls" => EventKind::TimeLs {
            source: columns.number("src", "a whole number, 0 to 255")?,
            count: columns.number("count", "a whole number of s, -128 to 127")?,
            change: columns.number("change", "a whole number of s, -128 to 127")?,
            to_event_s: columns.number("to_event", "a whole number of s, 32 bits")?,
            busy_us: columns.busy_us()?,
        },
        found => return Err(wrong("the event", found, allowed)),
    };
    columns.end()?;
    Ok(Event { at, kind })
}

/// The three columns of TIM-TP that are there together, or not.
fn read_name(columns: &mut Columns<'_>) -> Result<Option<PulseName>, Problem> {
    let allowed = "a whole number of ms, 0 to 4294967295";
    let Some(found) = columns.next() else {
        let rest = columns.rest.unwrap_or_default();
        if rest
            .split(',')
            .take(2)
            .all(|column| column.trim().is_empty())
        {
            columns.next();
            columns.next();
            return Ok(None);
        }
        return Err(Problem::Missing {
            column: "tow_ms",
            allowed,
        });
    };
    Ok(Some(PulseName {
        tow_ms: found.parse().map_err(|_| wrong("tow_ms", found, allowed))?,
        week: columns.number("week", "a whole number, 0 to 65535")?,
        flags: columns.value("flags_hex", "one byte in hex, 00 to ff", parse_hex)?,
    }))
}

/// The header while its lines are read.
#[derive(Default)]
struct HeaderLines {
    header: Header,
    ppm: Option<f64>,
    knots: Vec<Knot>,
}

impl HeaderLines {
    /// Reads a line, without its `#`.
    fn read(&mut self, line: &str) -> Result<(), Problem> {
        let mut columns = Columns::of(line, ' ');
        let seconds = "a decimal number of s, within 1e9";
        let ppm = "a decimal number of ppm, within 10000";
        match columns.next().unwrap_or_default() {
            "ppm" => {
                let read = columns.decimal("ppm", ppm, MOST_PPM)?;
                if self.ppm.replace(read).is_some() || !self.knots.is_empty() {
                    return Err(Problem::TwoCrystals);
                }
            }
            "crystal" => {
                let knot = Knot {
                    at_s: columns.decimal("the knot's time", seconds, 1e9)?,
                    ppm: columns.decimal("the knot's frequency", ppm, MOST_PPM)?,
                };
                if self.ppm.is_some() {
                    return Err(Problem::TwoCrystals);
                }
                if self.knots.last().is_some_and(|last| knot.at_s < last.at_s) {
                    return Err(Problem::Unordered);
                }
                self.knots.push(knot);
            }
            "start_ns" => {
                self.header.start_utc_ns =
                    columns.number("start_ns", "a whole number of ns since 1970, 64 bits")?;
            }
            "leap" => self.header.leaps.push(LeapStep {
                at: columns.time()?,
                by_ns: columns.number("the leap", "a whole number of ns, 64 bits")?,
            }),
            "latency_us" => {
                self.header.latency_us =
                    columns.number("latency_us", "a whole number of us, 0 to 4294967295")?;
            }
            "pulse" => {
                let width = "a number of ms, us or ns up to 1 s, as 100ms";
                self.header.pulse = Some(PulseShape {
                    width_ns: columns.value("the pulse's width", width, parse_width)?,
                    is_high: columns.value("the pulse's polarity", "high or low", |found| {
                        match found {
                            "high" => Some(true),
                            "low" => Some(false),
                            _ => None,
                        }
                    })?,
                });
            }
            "bare" => self.header.is_bare = true,
            "window" => {
                let (from_s, until_s) = (
                    columns.decimal("the window's begin", seconds, 1e9)?,
                    columns.decimal("the window's end", seconds, 1e9)?,
                );
                let name = columns.rest.take().unwrap_or_default().trim().to_owned();
                self.header.windows.push(Window {
                    from_s,
                    until_s,
                    name,
                });
            }
            _ => {
                columns.rest = None;
                self.header.comments.push(line.to_owned());
            }
        }
        columns.end()
    }

    fn finish(mut self) -> Header {
        self.header.crystal = match self.ppm {
            Some(ppm) => Crystal::constant(ppm),
            None => Crystal::new(self.knots),
        };
        self.header
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVERYTHING: &str = "\
# made up
# crystal 0 20
# crystal 60 -21.5
# start_ns 1798761400000000000
# leap 201000000.000 -1000000000
# latency_us 70000
# pulse 100ms high
# bare
# window 100 200.5 in between
-12.500,pulse
75925.650,mark,1798761400000000000,25,37,0
80000.000,mark,1798761400000000000,4294967295,f7
434605.650,tp,-1219,431801000,2451,0b,8680
434605.651,tp,582
434605.652,tp,582,,,,12
999999.9790001,pulse
1099999.908,fall
1138551.309,ls,2,18,1,-199,0
1200000.000,mark60,200000000,5
";

    #[test]
    fn every_kind_of_line_is_read_and_written() {
        let flight = Flight::parse(EVERYTHING).unwrap();
        assert_eq!(flight.events.len(), 10);
        let written = flight.to_string();
        assert_eq!(
            written,
            EVERYTHING.replace("999999.9790001", "999999.979"),
            "decimals beyond a ps are rounded"
        );
        assert_eq!(Flight::parse(&written).unwrap(), flight);
        assert!(Flight::is_one(EVERYTHING.as_bytes()));
        assert!(Flight::is_one(b"\n75925.650, mark,1,25,37"));
    }

    #[test]
    fn other_files_are_no_flights() {
        for other in [
            &b"local_us,gps_utc_us\n1,2\n"[..],
            b"\xb5\x62\x01\x07",
            b"$GNRMC,",
            b"1,2,3",
            b"",
        ] {
            assert!(!Flight::is_one(other));
        }
    }

    #[test]
    fn an_error_says_the_line_what_was_wrong_and_what_is_allowed() {
        for (line, printed) in [
            (
                "x,pulse",
                "the time is `x`, allowed is a decimal number of us, from -6e7 to 1e12",
            ),
            (
                "1e3,pulse",
                "the time is `1e3`, allowed is a decimal number of us, from -6e7 to 1e12",
            ),
            (
                "1,knock",
                "the event is `knock`, allowed is mark, mark60, pulse, fall, tp or ls",
            ),
            (
                "1",
                "the event is missing, allowed is mark, mark60, pulse, fall, tp or ls",
            ),
            (
                "1,mark,5,-1,37",
                "tacc_ns is `-1`, allowed is a whole number of ns, 0 to 4294967295",
            ),
            (
                "1,mark,5,25,3g",
                "valid_hex is `3g`, allowed is one byte in hex, 00 to ff",
            ),
            (
                "1,mark,5,25",
                "valid_hex is missing, allowed is one byte in hex, 00 to ff",
            ),
            (
                "1,mark,5,25,37,-1",
                "busy_us is `-1`, allowed is a number of us, 0 to 1e12",
            ),
            ("1,pulse,7", "`7` stands behind the last column"),
            (
                "1,tp,5,,2446,0b",
                "tow_ms is missing, allowed is a whole number of ms, 0 to 4294967295",
            ),
            (
                "1,tp,5,7",
                "week is missing, allowed is a whole number, 0 to 65535",
            ),
            (
                "1,ls,256,18,0,0",
                "src is `256`, allowed is a whole number, 0 to 255",
            ),
            (
                "# ppm 1e5",
                "ppm is `1e5`, allowed is a decimal number of ppm, within 10000",
            ),
            (
                "# ppm NaN",
                "ppm is `NaN`, allowed is a decimal number of ppm, within 10000",
            ),
            (
                "# pulse 100ms up",
                "the pulse's polarity is `up`, allowed is high or low",
            ),
            (
                "# crystal -1 2",
                "this crystal line is earlier than the one before; allowed is order",
            ),
            (
                "# ppm 20",
                "a second crystal; allowed is one ppm line, or crystal lines alone",
            ),
        ] {
            let text = if line.starts_with("# ppm 20") || line.starts_with("# crystal") {
                format!("# crystal 0 0\n{line}\n")
            } else {
                format!("# a comment\n{line}\n")
            };
            let error = Flight::parse(&text).unwrap_err();
            assert_eq!(error.to_string(), format!("line 2: {printed}"), "{line}");
        }
    }

    #[test]
    fn events_are_put_in_the_order_of_their_time() {
        let flight = Flight::parse("2,fall\n1,pulse\n2,pulse\n").unwrap();
        let kinds: Vec<_> = flight.events.iter().map(|event| event.kind).collect();
        assert_eq!(kinds, [EventKind::Rise, EventKind::Fall, EventKind::Rise]);
        assert_eq!(flight.end(), WorldPicos(2_000_000));
    }
}
