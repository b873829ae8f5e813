//! What became of a test on one board.
//!
//! *Purpose.* [`Conversation`] notes what was asked and what was said; [`Record`] is
//! what is left of it: samples, and the [`Trouble`]s that spoiled some of them.
//!
//! *Design.* Without I/O and without a clock: who talks with the board hands over what
//! it said and when. The board's own words tell its troubles: a time since boot that
//! goes back (SYSTEM_TIME) is a reboot, an answer before 2016 is a clock that is not
//! set, GPS_RAW_INT without a receiver is a receiver that is lost, silence is silence.
//! A sample that falls into a trouble is kept, marked, and not used. Answers have whole µs;
//! where the board's own log is at hand, its nanoseconds take their place.
//!
//! *Limits.* SYSTEM_TIME and GPS_RAW_INT come once a second, and a lost receiver is
//! told after 2 s: samples of up to 3 s before it was noticed are set aside with it.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::Result;
use mavlink_node::client::{EARLIEST_UTC_US, What};

use crate::own_log::OwnLog;

/// How long a receiver has been lost at most when it is told, in ns.
const LOST_BEFORE_NS: i64 = 3_000_000_000;
/// GPS_FIX_TYPE_NO_GPS.
const NO_RECEIVER: u8 = 0;
/// How long a board says nothing before it is said to be silent, in ns: five of its
/// HEARTBEATs.
pub const SILENCE_NS: i64 = 5_000_000_000;

/// One answered PING.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The PING's number.
    pub sequence: u32,
    /// When it left the host, in ns since the test's start.
    pub sent_ns: i64,
    /// The board's time at its arrival, in ns: of UTC, or since boot.
    pub board_ns: i64,
    /// That time is out of the board's own log; what it was answered with are whole µs.
    pub is_from_log: bool,
    /// From sending to the answer, in ns.
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
    /// The board did not hear its receiver.
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
pub enum Trouble {
    /// Its clock was never set.
    NeverSet,
    /// It never answered.
    NoAnswer,
    /// It started anew.
    Rebooted(i64),
    /// It lost its receiver.
    LostReceiver(i64),
    /// It said nothing any more.
    FellSilent(i64),
    /// Its own log was not to be had, for this reason.
    NoLog(String),
    /// So many of its answers ought to be in its log and are not.
    NotInLog(usize),
}

impl fmt::Display for Trouble {
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

/// What is left of a test on one board.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Where it is, or which one of the virtual ones.
    pub name: String,
    /// PINGs sent.
    pub asked: u32,
    /// Answers and other frames that the board itself counted as not sent because its line
    /// was full, where it was asked.
    pub line_full: Option<u32>,
    /// The PINGs that were answered, in the order of their numbers.
    pub samples: Vec<Sample>,
    /// What went wrong, in the order of time.
    pub troubles: Vec<Trouble>,
    /// How much later than planned each PING left, in ns; nothing where it leaves on
    /// the dot.
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
                    self.troubles.push(Trouble::NotInLog(not_in_it));
                }
                self.own_log = Some(log.into_file());
            }
            Err(error) => self.troubles.push(Trouble::NoLog(format!("{error:#}"))),
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

/// A test on one board while it goes on.
#[derive(Debug)]
pub struct Conversation {
    name: String,
    /// When each PING was sent.
    sent: BTreeMap<u32, i64>,
    samples: BTreeMap<u32, Sample>,
    send_delays_ns: Vec<i64>,
    last_boot_ms: Option<u32>,
    last_heard_ns: Option<i64>,
    rebooted_ns: Option<i64>,
    fell_silent_ns: Option<i64>,
    /// From when to when it did not hear its receiver.
    deaf: Vec<(i64, i64)>,
    hears_receiver: bool,
}

impl Conversation {
    /// One with the board `name`, in which nothing has been said.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            sent: BTreeMap::new(),
            samples: BTreeMap::new(),
            send_delays_ns: Vec::new(),
            last_boot_ms: None,
            last_heard_ns: None,
            rebooted_ns: None,
            fell_silent_ns: None,
            deaf: Vec::new(),
            hears_receiver: true,
        }
    }

    /// A PING left at `sent_ns`, `delay_ns` later than planned.
    pub fn asked(&mut self, sequence: u32, sent_ns: i64, delay_ns: Option<i64>) {
        self.sent.insert(sequence, sent_ns);
        self.send_delays_ns.extend(delay_ns);
    }

    /// The board said `what` at `now_ns`.
    pub fn heard(&mut self, now_ns: i64, what: &What) {
        self.last_heard_ns = Some(now_ns);
        match *what {
            What::SystemTime { time_boot_ms, .. } => {
                if self.last_boot_ms.is_some_and(|last| time_boot_ms < last)
                    && self.rebooted_ns.is_none()
                {
                    self.rebooted_ns = Some(now_ns - i64::from(time_boot_ms) * 1_000_000);
                }
                self.last_boot_ms = Some(time_boot_ms);
            }
            What::Ping { time_usec, seq, .. } => {
                let Some(&sent_ns) = self.sent.get(&seq) else {
                    return;
                };
                self.samples.entry(seq).or_insert(Sample {
                    sequence: seq,
                    sent_ns,
                    board_ns: i64::try_from(time_usec).unwrap_or(0).saturating_mul(1_000),
                    is_from_log: false,
                    round_trip_ns: now_ns - sent_ns,
                    error_ns: None,
                    verdict: Verdict::Good,
                });
            }
            What::Fix { fix_type } => self.heard_of_receiver(now_ns, fix_type != NO_RECEIVER),
            _ => {}
        }
    }

    fn heard_of_receiver(&mut self, now_ns: i64, hears: bool) {
        match (self.hears_receiver, hears) {
            (true, false) => self.deaf.push((now_ns - LOST_BEFORE_NS, i64::MAX)),
            (false, true) => {
                if let Some(last) = self.deaf.last_mut() {
                    last.1 = now_ns;
                }
            }
            _ => {}
        }
        self.hears_receiver = hears;
    }

    /// Whether, at `now_ns`, it has been silent for too long; or has rebooted.
    pub fn is_over(&mut self, now_ns: i64) -> bool {
        let since = self.last_heard_ns.unwrap_or(0);
        if now_ns - since > SILENCE_NS {
            self.fell_silent_ns.get_or_insert(since);
        }
        self.fell_silent_ns.is_some() || self.rebooted_ns.is_some()
    }

    /// The line to the board is gone.
    pub fn line_is_gone(&mut self, now_ns: i64) {
        self.fell_silent_ns.get_or_insert(now_ns);
    }

    /// What is left of it; `utc_ns` tells UTC at the arrival of a PING that was sent at
    /// a moment, where that is known.
    #[must_use]
    pub fn end(self, utc_ns: Option<&dyn Fn(i64) -> i64>) -> Record {
        let mut samples: Vec<Sample> = self.samples.into_values().collect();
        let is_deaf = |at: i64| self.deaf.iter().any(|&(from, to)| (from..to).contains(&at));
        for sample in &mut samples {
            let is_set = sample.board_ns / 1_000 >= EARLIEST_UTC_US.cast_signed();
            if let Some(utc_ns) = utc_ns.filter(|_| is_set) {
                sample.error_ns = Some(sample.board_ns - utc_ns(sample.sent_ns));
            }
            sample.verdict = if self.rebooted_ns.is_some_and(|at| sample.sent_ns >= at) {
                Verdict::AfterReboot
            } else if !is_set {
                Verdict::NotSet
            } else if is_deaf(sample.sent_ns) {
                Verdict::NoReceiver
            } else {
                Verdict::Good
            };
        }
        let mut troubles = Vec::new();
        if samples.is_empty() && !self.sent.is_empty() {
            troubles.push(Trouble::NoAnswer);
        } else if samples
            .iter()
            .all(|sample| sample.verdict == Verdict::NotSet)
        {
            troubles.push(Trouble::NeverSet);
        }
        // A receiver that was found before the test began is no trouble.
        let deaf = self.deaf.iter().filter(|&&(_, to)| to > 0);
        troubles.extend(deaf.map(|&(from, _)| Trouble::LostReceiver(from)));
        troubles.extend(self.rebooted_ns.map(Trouble::Rebooted));
        let is_silent = self.fell_silent_ns.filter(|_| self.rebooted_ns.is_none());
        troubles.extend(
            is_silent
                .filter(|_| !samples.is_empty())
                .map(Trouble::FellSilent),
        );
        Record {
            name: self.name,
            asked: self.sent.len() as u32,
            line_full: None,
            samples,
            troubles,
            send_delays_ns: self.send_delays_ns,
            own_log: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mavlink_node::Address;

    const MS: i64 = 1_000_000;
    const SECOND: i64 = 1_000 * MS;
    const UTC_US: u64 = 1_795_320_000_000_000;

    fn answer(conversation: &mut Conversation, sequence: u32, board_us: u64) {
        let at = i64::from(sequence) * 100 * MS;
        conversation.asked(sequence, at, None);
        let target = Address {
            system: 255,
            component: 190,
        };
        let what = What::Ping {
            time_usec: board_us,
            seq: sequence,
            target,
        };
        conversation.heard(at + 5 * MS, &what);
    }

    fn system_time(conversation: &mut Conversation, now_ns: i64, time_boot_ms: u32) {
        let what = What::SystemTime {
            time_unix_usec: 0,
            time_boot_ms,
        };
        conversation.heard(now_ns, &what);
    }

    fn verdicts(record: &Record) -> Vec<Verdict> {
        record.samples.iter().map(|sample| sample.verdict).collect()
    }

    #[test]
    fn samples_have_their_round_trip_and_their_error_and_lost_ones_are_counted() {
        let mut conversation = Conversation::new("one");
        conversation.asked(0, 0, None);
        answer(&mut conversation, 1, UTC_US + 100_007);
        let utc = |at: i64| UTC_US.cast_signed() * 1_000 + at;
        let record = conversation.end(Some(&utc));
        assert_eq!((record.asked, record.samples.len()), (2, 1));
        assert_eq!(record.samples[0].round_trip_ns, 5 * MS);
        assert_eq!(record.samples[0].error_ns, Some(7_000));
        assert_eq!(record.troubles, []);
    }

    #[test]
    fn a_reboot_is_seen_by_the_time_since_boot_and_what_was_before_is_kept() {
        let mut conversation = Conversation::new("one");
        system_time(&mut conversation, 0, 60_000);
        answer(&mut conversation, 1, UTC_US);
        system_time(&mut conversation, SECOND, 61_000);
        answer(&mut conversation, 15, UTC_US + 1);
        assert!(!conversation.is_over(2 * SECOND));
        // Set anew, within a second.
        answer(&mut conversation, 18, UTC_US + 2);
        system_time(&mut conversation, 2 * SECOND, 300);
        assert!(conversation.is_over(2 * SECOND));
        let record = conversation.end(None);
        let expected = [Verdict::Good, Verdict::Good, Verdict::AfterReboot];
        assert_eq!(verdicts(&record), expected);
        assert_eq!(record.troubles, [Trouble::Rebooted(1_700 * MS)]);
        assert!(record.troubles[0].to_string().contains("rebooted 1.7 s"));
    }

    #[test]
    fn a_lost_receiver_spoils_what_was_said_without_it() {
        let mut conversation = Conversation::new("one");
        for sequence in 0..120 {
            answer(&mut conversation, sequence, UTC_US);
        }
        // Found before the test began.
        conversation.heard(-9 * SECOND, &What::Fix { fix_type: 0 });
        conversation.heard(-8 * SECOND, &What::Fix { fix_type: 3 });
        conversation.heard(2 * SECOND, &What::Fix { fix_type: 3 });
        conversation.heard(5 * SECOND, &What::Fix { fix_type: 0 });
        conversation.heard(8 * SECOND, &What::Fix { fix_type: 0 });
        conversation.heard(10 * SECOND, &What::Fix { fix_type: 2 });
        let record = conversation.end(None);
        assert_eq!(record.good().count(), 20 + 20);
        assert_eq!(record.troubles, [Trouble::LostReceiver(2 * SECOND)]);
    }

    #[test]
    fn a_clock_that_was_never_set_and_a_board_that_never_answers() {
        let mut conversation = Conversation::new("one");
        answer(&mut conversation, 0, 2_000_000);
        let record = conversation.end(None);
        assert_eq!(verdicts(&record), [Verdict::NotSet]);
        assert_eq!(record.troubles, [Trouble::NeverSet]);

        let mut conversation = Conversation::new("one");
        conversation.asked(0, 0, None);
        assert!(conversation.is_over(SILENCE_NS + 1));
        assert_eq!(conversation.end(None).troubles, [Trouble::NoAnswer]);
    }

    #[test]
    fn silence_is_said_from_where_it_began() {
        let mut conversation = Conversation::new("one");
        answer(&mut conversation, 10, UTC_US);
        assert!(!conversation.is_over(SECOND + SILENCE_NS));
        assert!(conversation.is_over(SECOND + 6 * MS + SILENCE_NS));
        let record = conversation.end(None);
        assert_eq!(record.troubles, [Trouble::FellSilent(SECOND + 5 * MS)]);
        assert_eq!(record.good().count(), 1);
    }

    #[test]
    fn an_answer_to_nothing_and_one_that_comes_twice_count_for_nothing() {
        let mut conversation = Conversation::new("one");
        answer(&mut conversation, 3, UTC_US);
        answer(&mut conversation, 3, UTC_US + 9);
        let target = Address {
            system: 255,
            component: 190,
        };
        let what = What::Ping {
            time_usec: UTC_US,
            seq: 99,
            target,
        };
        conversation.heard(SECOND, &what);
        let record = conversation.end(None);
        assert_eq!(record.samples.len(), 1);
        assert_eq!(record.samples[0].board_ns, UTC_US.cast_signed() * 1_000);
    }

    #[test]
    fn the_boards_own_log_adds_the_nanoseconds_and_what_it_lacks_is_told() {
        let told = |in_log: &[u32], missed: u32| {
            let mut conversation = Conversation::new("one");
            for sequence in 0..4 {
                answer(&mut conversation, sequence, UTC_US + u64::from(sequence));
            }
            let mut record = conversation.end(Some(&|_| UTC_US.cast_signed() * 1_000));
            let mut file = "sequence,board_time_ns\r\n".to_owned();
            for n in in_log {
                file += &format!("{n},{}\r\n", (UTC_US + u64::from(*n)) * 1_000 + 77);
            }
            record.take_log(OwnLog::read(file.into(), missed));
            record
        };
        let record = told(&[0, 1, 2, 3], 0);
        assert!(record.samples.iter().all(|sample| sample.is_from_log));
        assert_eq!(record.samples[3].error_ns, Some(3_077));
        assert_eq!(record.troubles, []);
        // A full log ends before the test does.
        let record = told(&[0, 1], 2);
        assert_eq!(record.samples[1].error_ns, Some(1_077));
        assert_eq!(record.samples[2].error_ns, Some(2_000));
        assert_eq!(record.troubles, []);
        // But has no gap; and one that is not full has everything.
        assert_eq!(told(&[1, 3], 2).troubles, [Trouble::NotInLog(2)]);
        assert_eq!(told(&[0, 1], 0).troubles, [Trouble::NotInLog(2)]);
        assert_eq!(told(&[], 0).troubles, [Trouble::NotInLog(4)]);
    }

    #[test]
    fn a_log_that_is_not_to_be_had_spoils_no_sample() {
        let mut conversation = Conversation::new("one");
        answer(&mut conversation, 0, UTC_US);
        let mut record = conversation.end(None);
        record.take_log(Err(anyhow::anyhow!("no card")));
        assert_eq!(record.troubles, [Trouble::NoLog("no card".to_owned())]);
        assert_eq!(record.good().count(), 1);
    }
}
