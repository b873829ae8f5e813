//! `ping`: asks a node for its time.
//!
//! *Purpose.* One line an answer: the node's UTC, how long the answer took, and how
//! far the node's time is from this host's.
//!
//! *Design.* The node tells its time at the arrival of the request; the host's time
//! at that moment is taken as the middle between sending and receiving. Requests
//! follow each other; an answer counts when it carries the number of the request
//! that is waiting.
//!
//! *Limits.* The difference is as good as the two ways are equally long, half a
//! round trip at worst, and as this host's clock is right.

use std::fmt;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result};
use jiff::Timestamp;
use mavlink_node::client::{Client, EARLIEST_UTC_US, GROUND_STATION, Message, Received};
use mavlink_node::{Address as MavAddress, Version};
use serde_json::json;
use timebase::{Stamp, StampedByte};

use crate::link::{Address, Link};

/// What `ping` is asked to do.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Where the node is: tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE, or serial:DEVICE:BAUD
    #[arg(value_name = "ADDR")]
    address: Address,
    /// How many requests
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    count: u32,
    /// From one request to the next, in ms
    #[arg(long, value_name = "MS", default_value_t = 500, value_parser = clap::value_parser!(u64).range(1..=3_600_000))]
    interval: u64,
    /// How long an answer may take, in ms
    #[arg(long, value_name = "MS", default_value_t = 1_000, value_parser = clap::value_parser!(u64).range(1..=3_600_000))]
    timeout: u64,
    /// The version of MAVLink that is spoken, 1 or 2
    #[arg(long, value_name = "1|2", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    mavlink: u8,
    /// Print one JSON object at the end instead of lines
    #[arg(long)]
    json: bool,
}

/// Asks, prints the answers and a summary. The exit code says whether anybody
/// answered.
///
/// # Errors
///
/// When the line cannot be opened or breaks before anybody has answered.
pub fn run(options: &Options) -> Result<ExitCode> {
    let stop = Arc::new(AtomicBool::new(false));
    let on_signal = Arc::clone(&stop);
    ctrlc::set_handler(move || on_signal.store(true, Ordering::Relaxed))
        .context("Ctrl-C cannot be caught")?;

    let mut round = Round::new(options, stop)?;
    let ended = round.all(options);
    if let Err(error) = ended {
        if round.answers.is_empty() {
            return Err(error);
        }
        eprintln!("{error:#}");
    }
    if options.json {
        println!("{:#}", round.to_json(options));
    } else {
        println!("{}", round.summary());
    }
    if round.answers.is_empty() {
        eprintln!("{}", round.why_nobody(options));
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// An answer of the node.
#[derive(Clone, Copy, Debug)]
struct Answer {
    seq: u32,
    /// The node's time: UTC, or since boot while its clock is not set.
    node_us: u64,
    round_trip: Duration,
    /// The host's UTC at which the request is taken to have arrived, in µs.
    host_us: i64,
}

impl Answer {
    /// Node minus host, in µs; none while the node's clock is not set.
    fn difference_us(&self) -> Option<i64> {
        let utc = i64::try_from(self.node_us).ok()?;
        (self.node_us >= EARLIEST_UTC_US).then(|| utc - self.host_us)
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "seq {:<4} ", self.seq)?;
        let utc = i64::try_from(self.node_us)
            .ok()
            .map(Timestamp::from_microsecond);
        match (self.difference_us(), utc) {
            (Some(_), Some(Ok(utc))) => write!(f, "{utc:.6}")?,
            _ => write!(
                f,
                "clock not set, {:.6} s since boot",
                self.node_us as f64 / 1e6
            )?,
        }
        write!(
            f,
            "  round trip {:.3} ms",
            self.round_trip.as_secs_f64() * 1e3
        )?;
        match self.difference_us() {
            Some(us) => write!(f, "  difference {}", signed(us)),
            None => Ok(()),
        }
    }
}

/// A difference in a unit that fits its size.
fn signed(us: i64) -> String {
    match us.unsigned_abs() {
        0..10_000_000 => format!("{:+.3} ms", us as f64 / 1e3),
        _ => format!("{:+.3} s", us as f64 / 1e6),
    }
}

/// The requests of one call and what came of them.
struct Round {
    link: Link,
    client: Client,
    stop: Arc<AtomicBool>,
    answers: Vec<Answer>,
    missing: Vec<u32>,
    /// Somebody is there who sends HEARTBEATs.
    somebody: Option<MavAddress>,
}

impl Round {
    fn new(options: &Options, stop: Arc<AtomicBool>) -> Result<Self> {
        let version = if options.mavlink == 1 {
            Version::V1
        } else {
            Version::V2
        };
        Ok(Self {
            link: Link::open(&options.address)?,
            client: Client::new(GROUND_STATION, version),
            stop,
            answers: Vec::new(),
            missing: Vec::new(),
            somebody: None,
        })
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// All requests, one after the other.
    fn all(&mut self, options: &Options) -> Result<()> {
        for seq in 1..=options.count {
            let next = Instant::now() + Duration::from_millis(options.interval);
            let answer = self.ask(seq, Duration::from_millis(options.timeout))?;
            match answer {
                Some(answer) => self.answers.push(answer),
                None if self.stopped() => break,
                None => self.missing.push(seq),
            }
            if !options.json {
                match answer {
                    Some(answer) => println!("{answer}"),
                    None => println!("seq {seq:<4} no answer within {} ms", options.timeout),
                }
            }
            while seq < options.count && Instant::now() < next && !self.stopped() {
                self.listen()?;
            }
            if self.stopped() {
                break;
            }
        }
        Ok(())
    }

    /// One request, and its answer if it comes in time.
    fn ask(&mut self, seq: u32, timeout: Duration) -> Result<Option<Answer>> {
        // What has come before is no answer to this.
        while !self.listen()?.is_empty() && !self.stopped() {}
        // In this order: a pause between the two lengthens the round trip, half of which is
        // what the request's arrival is known to.
        let sent = Instant::now();
        let host = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let request = self.client.ping(host.as_micros() as u64, seq);
        self.link.send(&request)?;
        while sent.elapsed() < timeout && !self.stopped() {
            let heard = self.listen()?;
            let round_trip = sent.elapsed();
            for heard in heard {
                if let Message::Ping {
                    time_usec,
                    seq: answered,
                    target: GROUND_STATION,
                } = heard.message
                    && answered == seq
                {
                    let middle = host + round_trip / 2;
                    return Ok(Some(Answer {
                        seq,
                        node_us: time_usec,
                        round_trip,
                        host_us: i64::try_from(middle.as_micros())?,
                    }));
                }
            }
        }
        Ok(None)
    }

    /// What the node says within a moment.
    fn listen(&mut self) -> Result<Vec<Received>> {
        let mut buffer = [0; 1_024];
        let bytes = self.link.receive(&mut buffer)?;
        // The client's own stamps are not used: it tells apart frames, not times.
        let stamp = Stamp(0);
        let heard: Vec<Received> = bytes
            .iter()
            .filter_map(|&byte| self.client.push(StampedByte { stamp, byte }))
            .collect();
        let heartbeat = heard
            .iter()
            .find(|heard| heard.message == Message::Heartbeat);
        self.somebody = heartbeat.map(|heard| heard.from).or(self.somebody);
        Ok(heard)
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

    fn round_trips_us(&self) -> Option<[u64; 3]> {
        let micros = |answer: &Answer| answer.round_trip.as_micros() as u64;
        Self::spread(self.answers.iter().map(micros).collect())
    }

    fn differences_us(&self) -> Option<[i64; 3]> {
        Self::spread(
            self.answers
                .iter()
                .filter_map(Answer::difference_us)
                .collect(),
        )
    }

    fn summary(&self) -> String {
        let sent = self.answers.len() + self.missing.len();
        let mut summary = format!("{sent} asked, {} answered", self.answers.len());
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

    fn to_json(&self, options: &Options) -> serde_json::Value {
        let spread = |[least, median, most]: [serde_json::Value; 3]| json!({ "least": least, "median": median, "greatest": most });
        let answers: Vec<_> = self
            .answers
            .iter()
            .map(|answer| {
                json!({
                    "seq": answer.seq,
                    "node_us": answer.node_us,
                    "clock_set": answer.difference_us().is_some(),
                    "round_trip_us": answer.round_trip.as_micros() as u64,
                    "difference_us": answer.difference_us(),
                })
            })
            .collect();
        json!({
            "address": options.address.to_string(),
            "mavlink": options.mavlink,
            "asked": self.answers.len() + self.missing.len(),
            "answered": self.answers.len(),
            "missing": self.missing,
            "round_trip_us": self.round_trips_us().map(|trips| spread(trips.map(Into::into))),
            "difference_us": self.differences_us().map(|us| spread(us.map(Into::into))),
            "answers": answers,
        })
    }

    fn why_nobody(&self, options: &Options) -> String {
        let address = &options.address;
        match self.somebody {
            _ if self.missing.is_empty() => format!("stopped before {address} could answer"),
            Some(MavAddress { system, component }) => format!(
                "nobody answered at {address}: {system}/{component} sends HEARTBEATs there, but \
                 no answer to a PING"
            ),
            None => {
                format!("nobody answered at {address}: nothing that is MAVLink came from there")
            }
        }
    }
}
