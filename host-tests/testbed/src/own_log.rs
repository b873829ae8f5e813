//! A board's own log of a test.
//!
//! *Purpose.* The file of a board's log, off its card or over its line. Its lines are the
//! same samples as the answers to the PINGs, with the nanoseconds that those have no room
//! for.
//!
//! *Design.* A line belongs to an answer when number and whole µs are the same, so that
//! the PINGs of another client on the line do no harm. The file is kept byte for byte.
//!
//! *Limits.* A log that is full has the first samples of a test, 8 192 on a Pixhawk, and
//! counts how many more there were (`PC_LOG_MISSED`).

use std::collections::BTreeMap;

use anyhow::{Context as _, Result};

/// The columns of the file that are read here.
const NUMBER: &str = "sequence";
const BOARD_TIME: &str = "board_time_ns";

/// The file of a board's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnLog {
    file: Vec<u8>,
    is_full: bool,
    /// The board's time in ns, by a PING's number and that time's whole µs.
    times: BTreeMap<(u32, i64), i64>,
}

impl OwnLog {
    /// Reads the file of a log that had no room for `missed` samples.
    ///
    /// # Errors
    ///
    /// When it is no log, with the line that is none.
    pub fn read(file: Vec<u8>, missed: u32) -> Result<Self> {
        let mut table = csv::Reader::from_reader(file.as_slice());
        let columns = table.headers()?.clone();
        let place = |wanted: &str| {
            let place = columns.iter().position(|name| name == wanted);
            place.with_context(|| format!("it has no column {wanted}"))
        };
        let (number, time) = (place(NUMBER)?, place(BOARD_TIME)?);
        let mut times = BTreeMap::new();
        for (line, row) in (2..).zip(table.records()) {
            let row = row?;
            let wrong = || format!("line {line} is no line of a log");
            let sequence = row.get(number).unwrap_or_default().parse();
            let ns: i64 = row
                .get(time)
                .unwrap_or_default()
                .parse()
                .with_context(wrong)?;
            times.insert((sequence.with_context(wrong)?, ns / 1_000), ns);
        }
        Ok(Self {
            file,
            is_full: missed > 0,
            times,
        })
    }

    /// Whether it ended before the test did.
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.is_full
    }

    /// The file, as it was.
    #[must_use]
    pub fn into_file(self) -> Vec<u8> {
        self.file
    }

    /// The board's time in ns at the PING `sequence`, which was answered with these whole
    /// µs.
    #[must_use]
    pub fn time_ns(&self, sequence: u32, whole_us: i64) -> Option<i64> {
        self.times.get(&(sequence, whole_us)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "sequence,ping_time_us,board_time_ns,clock_state,uncertainty_in_ns\r\n\
                        0000000007,0000000000000000,0001795320000000123,set,0000000450\r\n\
                        0000000008,0000000000100000,0001795320100000999,set,0000000450\r\n";

    #[test]
    fn a_line_is_found_by_its_number_and_its_whole_us() {
        let log = OwnLog::read(FILE.into(), 0).unwrap();
        assert_eq!(
            log.time_ns(7, 1_795_320_000_000),
            Some(1_795_320_000_000_123)
        );
        assert_eq!(
            log.time_ns(8, 1_795_320_100_000),
            Some(1_795_320_100_000_999)
        );
        assert_eq!(log.time_ns(7, 1_795_320_100_000), None);
        assert_eq!(log.time_ns(9, 1_795_320_000_000), None);
        assert!(!log.is_full());
        assert_eq!(log.into_file(), FILE.as_bytes());
        assert!(OwnLog::read(FILE.into(), 1).unwrap().is_full());
    }

    #[test]
    fn what_is_no_log_is_refused_with_its_line() {
        let cut = FILE.replace("0001795320100000999", "0001795320100Z");
        let error = format!("{:#}", OwnLog::read(cut.into(), 0).unwrap_err());
        assert!(error.contains("line 3 is no line"), "{error}");
        let error = format!(
            "{:#}",
            OwnLog::read(b"a,b\r\n1,2\r\n".to_vec(), 0).unwrap_err()
        );
        assert!(error.contains("no column sequence"), "{error}");
        let error = format!("{:#}", OwnLog::read(Vec::new(), 0).unwrap_err());
        assert!(error.contains("no column"), "{error}");
        assert!(OwnLog::read(FILE[..150].into(), 0).is_err());
    }
}
