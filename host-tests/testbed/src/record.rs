//! The results of a test on one board.
//!
//! *Purpose.* [`Record`]: samples, and the [`Anomaly`]s that spoiled some of them.
//!
//! *Design.* A sample that falls into an anomaly is kept, marked, and not used. Answers
//! have whole µs; where the board's own log is at hand, its nanoseconds take their place.
//!
//! *Limits.* A log is held against the answers, not against the PINGs that had none.

use std::fmt;

use anyhow::Result;

use crate::own_log::OwnLog;

/// One answered PING.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The PING's number.
    pub sequence: u32,
    /// When it left the host, in ns since the test's start.
    pub sent_ns: i64,
    /// The board's time at its arrival, in ns: of UTC, or since boot.
    pub board_ns: i64,
    /// That time is out of the board's own log; the answer had whole µs.
    pub is_from_log: bool,
    /// From sending to the answer. \[ns\]
    pub round_trip_ns: i64,
    /// The board's time less UTC, in ns, where UTC is known.
    pub error_ns: Option<i64>,
    /// Whether it is used, or why not.
    pub verdict: Verdict,
}

/// Whether a sample is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is.
    Good,
    /// The board's clock was not set.
    NotSet,
    /// The board had no receiver.
    NoReceiver,
    /// The board had started anew.
    AfterReboot,
    /// Its round trip was too long to know when it arrived.
    Late,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Good => "good",
            Self::NotSet => "not set",
            Self::NoReceiver => "no receiver",
            Self::AfterReboot => "after a reboot",
            Self::Late => "late",
        })
    }
}

/// What went wrong on a board; moments in ns since the test's start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Anomaly {
    /// Its clock was never set.
    NeverSet,
    /// It never answered.
    NoAnswer,
    /// It started anew.
    Rebooted(i64),
    /// It lost its receiver.
    LostReceiver(i64),
    /// It sent nothing any more.
    FellSilent(i64),
    /// Its own log was not to be had, for this reason.
    NoLog(String),
    /// This many of its answers ought to be in its log and are not.
    NotInLog(usize),
}

impl fmt::Display for Anomaly {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = |ns: &i64| (*ns).max(0) as f64 / 1e9;
        match self {
            Self::NeverSet => f.write_str(
                "its clock was never set, so none of its samples is used; give its receiver \
                 a view of the sky and look whether it is plugged in",
            ),
            Self::NoAnswer => f.write_str("it answered no PING"),
            Self::Rebooted(at) => write!(
                f,
                "it rebooted {:.1} s into the test; its samples from before are used, those \
                 after are not",
                s(at)
            ),
            Self::LostReceiver(at) => write!(
                f,
                "it lost its receiver {:.1} s into the test; its samples without it are not used",
                s(at)
            ),
            Self::FellSilent(at) => write!(
                f,
                "it fell silent {:.1} s into the test; its samples from before are used",
                s(at)
            ),
            Self::NoLog(why) => write!(
                f,
                "its own log was not to be had ({why}); its samples are used, in whole µs"
            ),
            Self::NotInLog(count) => write!(
                f,
                "{count} of its answers are missing in its own log; they are used, in whole µs"
            ),
        }
    }
}

/// The results of a test on one board.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Where it is, or which one of the virtual ones.
    pub name: String,
    /// PINGs sent.
    pub asked: u32,
    /// Answers and other frames that the board itself counted as not sent because its line
    /// was full, where it was asked.
    pub line_full: Option<u32>,
    /// Ticks that the board lost during the test, where it was asked.
    pub lost_ticks: Option<u32>,
    /// Bytes that its lines lost since its power, where it was asked.
    pub overruns: Option<u32>,
    /// The PINGs that were answered, in the order of their numbers.
    pub samples: Vec<Sample>,
    /// What went wrong, in the order of time.
    pub anomalies: Vec<Anomaly>,
    /// How much later than planned each PING left; nothing where it leaves on
    /// the dot. \[ns\]
    pub send_delays_ns: Vec<i64>,
    /// The file of its own log.
    pub own_log: Option<Vec<u8>>,
}

impl Record {
    /// Takes the board's own log, or why there is none, and from it the nanoseconds of the
    /// samples that are in it.
    pub fn take_log(&mut self, log: Result<OwnLog>) {
        match log {
            Ok(log) => {
                let not_in_it = self.refine(&log);
                if not_in_it > 0 {
                    self.anomalies.push(Anomaly::NotInLog(not_in_it));
                }
                self.own_log = Some(log.into_file());
            }
            Err(error) => self.anomalies.push(Anomaly::NoLog(format!("{error:#}"))),
        }
    }

    /// How many samples `log` ought to have and has not. A full log need not have those
    /// behind its last one.
    fn refine(&mut self, log: &OwnLog) -> usize {
        let mut not_in_it = 0;
        let mut of_them_before_the_last = 0;
        for sample in &mut self.samples {
            let Some(ns) = log.time_ns(sample.sequence, sample.board_ns / 1_000) else {
                not_in_it += 1;
                continue;
            };
            of_them_before_the_last = not_in_it;
            if let Some(error_ns) = &mut sample.error_ns {
                *error_ns += ns - sample.board_ns;
            }
            sample.board_ns = ns;
            sample.is_from_log = true;
        }
        if log.is_full() {
            of_them_before_the_last
        } else {
            not_in_it
        }
    }

    /// The samples that are used.
    pub fn good(&self) -> impl Iterator<Item = &Sample> {
        let is_good = |sample: &&Sample| sample.verdict == Verdict::Good;
        self.samples.iter().filter(is_good)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTC_NS: i64 = 1_795_320_000_000_000_000;

    /// A board's answers to four PINGs.
    fn record() -> Record {
        let sample = |sequence: u32| Sample {
            sequence,
            sent_ns: 0,
            board_ns: UTC_NS + i64::from(sequence) * 1_000,
            is_from_log: false,
            round_trip_ns: 5_000_000,
            error_ns: Some(i64::from(sequence) * 1_000),
            verdict: Verdict::Good,
        };
        Record {
            samples: (0..4).map(sample).collect(),
            ..Record::default()
        }
    }

    /// The same with a log of these PINGs, which missed some.
    fn with_log(in_log: &[u32], missed: u32) -> Record {
        let mut file = "sequence,board_time_ns\r\n".to_owned();
        for n in in_log {
            file += &format!("{n},{}\r\n", UTC_NS + i64::from(*n) * 1_000 + 77);
        }
        let mut record = record();
        record.take_log(OwnLog::read(file.into(), missed));
        record
    }

    #[test]
    fn the_boards_own_log_adds_the_nanoseconds_and_its_gaps_are_reported() {
        let record = with_log(&[0, 1, 2, 3], 0);
        assert!(record.samples.iter().all(|sample| sample.is_from_log));
        assert_eq!(record.samples[3].error_ns, Some(3_077));
        assert_eq!(record.anomalies, []);
        // A full log ends before the test does.
        let record = with_log(&[0, 1], 2);
        assert_eq!(record.samples[1].error_ns, Some(1_077));
        assert_eq!(record.samples[2].error_ns, Some(2_000));
        assert_eq!(record.anomalies, []);
        // But has no gap; and one that is not full has everything.
        assert_eq!(with_log(&[1, 3], 2).anomalies, [Anomaly::NotInLog(2)]);
        assert_eq!(with_log(&[0, 1], 0).anomalies, [Anomaly::NotInLog(2)]);
        assert_eq!(with_log(&[], 0).anomalies, [Anomaly::NotInLog(4)]);
    }

    #[test]
    fn a_log_that_is_not_to_be_had_spoils_no_sample() {
        let mut record = record();
        record.take_log(Err(anyhow::anyhow!("no card")));
        assert_eq!(record.anomalies, [Anomaly::NoLog("no card".to_owned())]);
        assert_eq!(record.good().count(), 4);
    }
}
