//! A test on one board while it goes on.
//!
//! *Purpose.* [`Conversation`] takes each PING that was sent and each message of the
//! board, and becomes a [`Record`].
//!
//! *Design.* Without I/O and without a clock: the caller passes messages and their times.
//! Anomalies follow from the board's own messages: a time since boot that goes back
//! (SYSTEM_TIME) is a reboot, an answer before 2016 is a clock that is not set,
//! GPS_RAW_INT without a receiver is a receiver that is lost, silence is silence.
//!
//! *Limits.* SYSTEM_TIME and GPS_RAW_INT come once a second, and the board reports a lost
//! receiver after 2 s: samples of up to 3 s before the report are discarded with it.

use std::collections::BTreeMap;

use mavlink_node::client::{self, Message};

use crate::record::{Anomaly, Record, Sample, Verdict};

/// How long a receiver has been lost at most when the board reports it. \[ns\]
const LOST_BEFORE_NS: i64 = 3_000_000_000;
/// GPS_FIX_TYPE_NO_GPS.
const NO_RECEIVER: u8 = 0;
/// A board without a message for this long is silent: five of its HEARTBEATs. \[ns\]
pub const SILENCE_NS: i64 = 5_000_000_000;

/// A test on one board while it goes on.
#[derive(Debug)]
pub struct Conversation {
    name: String,
    /// When each PING was sent.
    sent: BTreeMap<u32, i64>,
    samples: BTreeMap<u32, Sample>,
    send_delays_ns: Vec<i64>,
    last_boot_ms: Option<u32>,
    last_message_ns: Option<i64>,
    rebooted_ns: Option<i64>,
    fell_silent_ns: Option<i64>,
    /// From when to when it had no receiver.
    without_receiver: Vec<(i64, i64)>,
    has_receiver: bool,
}

impl Conversation {
    /// One with the board `name`, without any message yet.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            sent: BTreeMap::new(),
            samples: BTreeMap::new(),
            send_delays_ns: Vec::new(),
            last_boot_ms: None,
            last_message_ns: None,
            rebooted_ns: None,
            fell_silent_ns: None,
            without_receiver: Vec::new(),
            has_receiver: true,
        }
    }

    /// A PING left at `sent_ns`, `delay_ns` later than planned.
    pub fn handle_sent(&mut self, sequence: u32, sent_ns: i64, delay_ns: Option<i64>) {
        self.sent.insert(sequence, sent_ns);
        self.send_delays_ns.extend(delay_ns);
    }

    /// The message `message` of the board came at `now_ns`.
    pub fn handle_message(&mut self, now_ns: i64, message: &Message) {
        self.last_message_ns = Some(now_ns);
        match *message {
            Message::SystemTime { time_boot_ms, .. } => {
                if self.last_boot_ms.is_some_and(|last| time_boot_ms < last)
                    && self.rebooted_ns.is_none()
                {
                    self.rebooted_ns = Some(now_ns - i64::from(time_boot_ms) * 1_000_000);
                }
                self.last_boot_ms = Some(time_boot_ms);
            }
            Message::Ping { time_usec, seq, .. } => {
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
            Message::Fix { fix_type } => self.handle_receiver(now_ns, fix_type != NO_RECEIVER),
            _ => {}
        }
    }

    fn handle_receiver(&mut self, now_ns: i64, has_receiver: bool) {
        match (self.has_receiver, has_receiver) {
            (true, false) => self
                .without_receiver
                .push((now_ns - LOST_BEFORE_NS, i64::MAX)),
            (false, true) => {
                if let Some(last) = self.without_receiver.last_mut() {
                    last.1 = now_ns;
                }
            }
            _ => {}
        }
        self.has_receiver = has_receiver;
    }

    /// Whether, at `now_ns`, it has been silent for too long; or has rebooted.
    pub fn is_over(&mut self, now_ns: i64) -> bool {
        let since = self.last_message_ns.unwrap_or(0);
        if now_ns - since > SILENCE_NS {
            self.fell_silent_ns.get_or_insert(since);
        }
        self.fell_silent_ns.is_some() || self.rebooted_ns.is_some()
    }

    /// The line to the board is gone.
    pub fn handle_line_lost(&mut self, now_ns: i64) {
        self.fell_silent_ns.get_or_insert(now_ns);
    }

    /// Its record; `utc_ns` is UTC at the arrival of a PING that was sent at a moment, where
    /// that is known.
    #[must_use]
    pub fn end(self, utc_ns: Option<&dyn Fn(i64) -> i64>) -> Record {
        let mut samples: Vec<Sample> = self.samples.into_values().collect();
        let has_none = |at: i64| {
            self.without_receiver
                .iter()
                .any(|&(from, to)| (from..to).contains(&at))
        };
        for sample in &mut samples {
            let is_set = u64::try_from(sample.board_ns / 1_000).is_ok_and(client::is_utc);
            if let Some(utc_ns) = utc_ns.filter(|_| is_set) {
                sample.error_ns = Some(sample.board_ns - utc_ns(sample.sent_ns));
            }
            sample.verdict = if self.rebooted_ns.is_some_and(|at| sample.sent_ns >= at) {
                Verdict::AfterReboot
            } else if !is_set {
                Verdict::NotSet
            } else if has_none(sample.sent_ns) {
                Verdict::NoReceiver
            } else {
                Verdict::Good
            };
        }
        let mut anomalies = Vec::new();
        if samples.is_empty() && !self.sent.is_empty() {
            anomalies.push(Anomaly::NoAnswer);
        } else if samples
            .iter()
            .all(|sample| sample.verdict == Verdict::NotSet)
        {
            anomalies.push(Anomaly::NeverSet);
        }
        // A receiver that was found before the test began is no anomaly.
        let lost = self.without_receiver.iter().filter(|&&(_, to)| to > 0);
        anomalies.extend(lost.map(|&(from, _)| Anomaly::LostReceiver(from)));
        anomalies.extend(self.rebooted_ns.map(Anomaly::Rebooted));
        let is_silent = self.fell_silent_ns.filter(|_| self.rebooted_ns.is_none());
        anomalies.extend(
            is_silent
                .filter(|_| !samples.is_empty())
                .map(Anomaly::FellSilent),
        );
        Record {
            name: self.name,
            asked: self.sent.len() as u32,
            line_full: None,
            lost_ticks: None,
            overruns: None,
            samples,
            anomalies,
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
        conversation.handle_sent(sequence, at, None);
        let target = Address {
            system: 255,
            component: 190,
        };
        let message = Message::Ping {
            time_usec: board_us,
            seq: sequence,
            target,
        };
        conversation.handle_message(at + 5 * MS, &message);
    }

    fn system_time(conversation: &mut Conversation, now_ns: i64, time_boot_ms: u32) {
        let message = Message::SystemTime {
            time_unix_usec: 0,
            time_boot_ms,
        };
        conversation.handle_message(now_ns, &message);
    }

    fn verdicts(record: &Record) -> Vec<Verdict> {
        record.samples.iter().map(|sample| sample.verdict).collect()
    }

    #[test]
    fn samples_have_their_round_trip_and_their_error_and_lost_ones_are_counted() {
        let mut conversation = Conversation::new("one");
        conversation.handle_sent(0, 0, None);
        answer(&mut conversation, 1, UTC_US + 100_007);
        let utc = |at: i64| UTC_US.cast_signed() * 1_000 + at;
        let record = conversation.end(Some(&utc));
        assert_eq!((record.asked, record.samples.len()), (2, 1));
        assert_eq!(record.samples[0].round_trip_ns, 5 * MS);
        assert_eq!(record.samples[0].error_ns, Some(7_000));
        assert_eq!(record.anomalies, []);
    }

    #[test]
    fn a_reboot_shows_in_the_time_since_boot_and_samples_before_it_are_kept() {
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
        assert_eq!(record.anomalies, [Anomaly::Rebooted(1_700 * MS)]);
        assert!(record.anomalies[0].to_string().contains("rebooted 1.7 s"));
    }

    #[test]
    fn samples_without_a_receiver_are_not_used() {
        let mut conversation = Conversation::new("one");
        for sequence in 0..120 {
            answer(&mut conversation, sequence, UTC_US);
        }
        // Found before the test began.
        conversation.handle_message(-9 * SECOND, &Message::Fix { fix_type: 0 });
        conversation.handle_message(-8 * SECOND, &Message::Fix { fix_type: 3 });
        conversation.handle_message(2 * SECOND, &Message::Fix { fix_type: 3 });
        conversation.handle_message(5 * SECOND, &Message::Fix { fix_type: 0 });
        conversation.handle_message(8 * SECOND, &Message::Fix { fix_type: 0 });
        conversation.handle_message(10 * SECOND, &Message::Fix { fix_type: 2 });
        let record = conversation.end(None);
        assert_eq!(record.good().count(), 20 + 20);
        assert_eq!(record.anomalies, [Anomaly::LostReceiver(2 * SECOND)]);
    }

    #[test]
    fn a_clock_that_was_never_set_and_a_board_that_never_answers() {
        let mut conversation = Conversation::new("one");
        answer(&mut conversation, 0, 2_000_000);
        let record = conversation.end(None);
        assert_eq!(verdicts(&record), [Verdict::NotSet]);
        assert_eq!(record.anomalies, [Anomaly::NeverSet]);

        let mut conversation = Conversation::new("one");
        conversation.handle_sent(0, 0, None);
        assert!(conversation.is_over(SILENCE_NS + 1));
        assert_eq!(conversation.end(None).anomalies, [Anomaly::NoAnswer]);
    }

    #[test]
    fn silence_counts_from_its_beginning() {
        let mut conversation = Conversation::new("one");
        answer(&mut conversation, 10, UTC_US);
        assert!(!conversation.is_over(SECOND + SILENCE_NS));
        assert!(conversation.is_over(SECOND + 6 * MS + SILENCE_NS));
        let record = conversation.end(None);
        assert_eq!(record.anomalies, [Anomaly::FellSilent(SECOND + 5 * MS)]);
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
        let message = Message::Ping {
            time_usec: UTC_US,
            seq: 99,
            target,
        };
        conversation.handle_message(SECOND, &message);
        let record = conversation.end(None);
        assert_eq!(record.samples.len(), 1);
        assert_eq!(record.samples[0].board_ns, UTC_US.cast_signed() * 1_000);
    }
}
