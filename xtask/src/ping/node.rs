//! A node at the end of a line, and all that it answered.
//!
//! *Purpose.* [`Node::ask`] sends one request and waits for its answer.
//!
//! *Design.* Requests follow each other; an answer counts when it carries the number of the request
//! that is waiting. Before a request all that has come is read, so that an answer that was too late
//! is none to the next.

use std::sync::Barrier;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context as _, Result};
use mavlink_node::client::{Client, GROUND_STATION, Message, Received};
use mavlink_node::{Address as MavAddress, Version};
use serde_json::{Value, json};
use timebase::{Stamp, StampedByte};

use super::answer::{Answer, Bytes, signed};
use crate::ctrl_c;
use crate::link::{Address, Link};

/// A HEARTBEAT comes each second.
const LOOK_AROUND: Duration = Duration::from_millis(1_200);

/// How often the host's two clocks are compared before the best is taken.
const COMPARISONS: usize = 8;

/// A node, the line to it, and what came of the requests.
pub struct Node {
    /// Where it is.
    pub address: Address,
    link: Link,
    client: Client,
    version: Version,
    baud: Option<u32>,
    /// What it answered.
    pub answers: Vec<Answer>,
    /// The requests that it did not answer in time.
    pub missing: Vec<u32>,
    /// Who sends HEARTBEATs on its line.
    sends_heartbeats: Option<MavAddress>,
    /// It has answered a request, in time or not.
    has_answered: bool,
}

/// This host's UTC at an instant of its steady clock.
#[derive(Clone, Copy, Debug)]
pub struct HostTime {
    instant: Instant,
    utc_ns: i64,
}

impl HostTime {
    /// Compares the two clocks.
    ///
    /// # Errors
    ///
    /// When the host's clock is before 1970.
    pub fn now() -> Result<Self> {
        let compare = || {
            let before = Instant::now();
            let utc = SystemTime::now();
            (before.elapsed(), before, utc)
        };
        // The one that took the least time had the shortest pause between the two clocks.
        let best = (0..COMPARISONS)
            .map(|_| compare())
            .min_by_key(|&(took, ..)| took);
        let (_, instant, utc) = best.context("the clocks were compared")?;
        let utc_ns = i64::try_from(utc.duration_since(UNIX_EPOCH)?.as_nanos())?;
        Ok(Self { instant, utc_ns })
    }

    /// UTC at `instant`, in ns since 1970.
    fn utc_ns(self, instant: Instant) -> i64 {
        let since = instant.saturating_duration_since(self.instant);
        self.utc_ns + i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
    }
}

impl Node {
    /// Opens the line to `address`. `baud` is the rate of the line behind it, if it is known.
    ///
    /// # Errors
    ///
    /// When the line cannot be opened.
    pub fn new(address: &Address, version: Version, baud: Option<u32>) -> Result<Self> {
        Ok(Self {
            address: address.clone(),
            link: Link::open(address)?,
            client: Client::new(GROUND_STATION, version),
            version,
            baud,
            answers: Vec::new(),
            missing: Vec::new(),
            sends_heartbeats: None,
            has_answered: false,
        })
    }

    /// Sends request `seq` when all have come to `together`, and waits for the answer for
    /// `timeout`; `None` if there is none.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn ask(
        &mut self,
        seq: u32,
        timeout: Duration,
        host: HostTime,
        together: &Barrier,
    ) -> Result<Option<Answer>> {
        let drained = self.drain();
        // Also on a line that is gone: the others wait.
        together.wait();
        drained?;
        let sent = Instant::now();
        let sent_utc_ns = host.utc_ns(sent);
        let request = self.client.ping((sent_utc_ns / 1_000).unsigned_abs(), seq);
        self.link.send(&request)?;
        while sent.elapsed() < timeout && !ctrl_c::is_pressed() {
            let received = self.listen()?;
            let round_trip = sent.elapsed();
            let answer = received.iter().find_map(|received| match received.message {
                Message::Ping {
                    time_usec,
                    seq: answered,
                    target: GROUND_STATION,
                } if answered == seq => Some((time_usec, received.version)),
                _ => None,
            });
            if let Some((node_us, version)) = answer {
                let answer = Answer {
                    seq,
                    node_us,
                    round_trip,
                    sent_utc_ns,
                    bytes: Bytes {
                        request: request.len(),
                        answer: version,
                        baud: self.baud,
                    },
                };
                self.answers.push(answer);
                return Ok(Some(answer));
            }
        }
        if !ctrl_c::is_pressed() {
            self.missing.push(seq);
        }
        Ok(None)
    }

    /// Where no answer came in time: listens for a while who is there at all.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn look_around(&mut self) -> Result<()> {
        if self.answers.is_empty() && !self.missing.is_empty() {
            self.wait(Instant::now() + LOOK_AROUND)?;
        }
        Ok(())
    }

    /// Reads what comes until `until`, so that the node never waits for a full line.
    ///
    /// # Errors
    ///
    /// When the line is gone.
    pub fn wait(&mut self, until: Instant) -> Result<()> {
        while Instant::now() < until && !ctrl_c::is_pressed() {
            self.listen()?;
        }
        Ok(())
    }

    /// The rate of its line is known.
    pub const fn has_rate(&self) -> bool {
        self.baud.is_some()
    }

    /// Requests that were sent.
    fn asked(&self) -> usize {
        self.answers.len() + self.missing.len()
    }

    fn drain(&mut self) -> Result<()> {
        while !self.listen()?.is_empty() && !ctrl_c::is_pressed() {}
        Ok(())
    }

    /// What comes from the node within a moment.
    fn listen(&mut self) -> Result<Vec<Received>> {
        let mut buffer = [0; 1_024];
        let bytes = self.link.receive(&mut buffer)?;
        // The client only finds the frames; the times here are the host's.
        let stamp = Stamp(0);
        let received: Vec<Received> = bytes
            .iter()
            .filter_map(|&byte| self.client.push(StampedByte { stamp, byte }))
            .collect();
        self.has_answered |= received.iter().any(|it| {
            matches!(
                it.message,
                Message::Ping {
                    target: GROUND_STATION,
                    ..
                }
            )
        });
        let mut heartbeats = received
            .iter()
            .filter(|it| it.message == Message::Heartbeat);
        self.sends_heartbeats = heartbeats
            .next()
            .map(|it| it.from)
            .or(self.sends_heartbeats);
        Ok(received)
    }

    fn round_trips_us(&self) -> Option<[u64; 3]> {
        let micros = |answer: &Answer| answer.round_trip.as_micros() as u64;
        spread(self.answers.iter().map(micros).collect())
    }

    fn differences_us(&self) -> Option<[i64; 3]> {
        spread(
            self.answers
                .iter()
                .filter_map(Answer::difference_us)
                .collect(),
        )
    }

    /// The summary for people.
    pub fn summary(&self) -> String {
        let mut summary = format!("{} asked, {} answered", self.asked(), self.answers.len());
        if let Some(trips) = self.round_trips_us() {
            let [least, median, most] = trips.map(|us| us as f64 / 1e3);
            summary += &format!("; round trip {least:.3} / {median:.3} / {most:.3} ms");
        }
        if let Some(differences) = self.differences_us() {
            let [least, median, most] = differences.map(signed);
            summary += &format!("; difference {least} / {median} / {most}");
        }
        summary
    }

    /// The summary for programs.
    pub fn to_json(&self) -> Value {
        let spread = |[least, median, most]: [Value; 3]| json!({ "least": least, "median": median, "greatest": most });
        let answer = |answer: &Answer| {
            json!({
                "seq": answer.seq,
                "node_us": answer.node_us,
                "clock_set": answer.difference_us().is_some(),
                "round_trip_us": answer.round_trip.as_micros() as u64,
                "difference_us": answer.difference_us(),
            })
        };
        json!({
            "address": self.address.to_string(),
            "mavlink": match self.version { Version::V1 => 1, Version::V2 => 2 },
            "asked": self.asked(),
            "answered": self.answers.len(),
            "missing": self.missing,
            "round_trip_us": self.round_trips_us().map(|trips| spread(trips.map(Into::into))),
            "difference_us": self.differences_us().map(|us| spread(us.map(Into::into))),
            "answers": self.answers.iter().map(answer).collect::<Vec<_>>(),
        })
    }

    /// Why there is no answer.
    pub fn why_none(&self) -> String {
        let address = &self.address;
        match self.sends_heartbeats {
            _ if self.missing.is_empty() => format!("stopped before {address} could answer"),
            _ if self.has_answered => format!(
                "no answer from {address} in time: it answers, but takes longer than --timeout"
            ),
            Some(MavAddress { system, component }) => format!(
                "no answer from {address}: {system}/{component} sends HEARTBEATs there, but no \
                 answer to a PING"
            ),
            None => format!("no answer from {address}: nothing that is MAVLink came from there"),
        }
    }
}

/// Least, median and greatest of a list.
fn spread<T: Copy + Ord>(mut values: Vec<T>) -> Option<[T; 3]> {
    values.sort_unstable();
    Some([
        *values.first()?,
        *values.get(values.len() / 2)?,
        *values.last()?,
    ])
}
