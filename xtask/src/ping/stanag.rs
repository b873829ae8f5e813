//! The same over STANAG 4586, which has no ping of its own.
//!
//! *Design.* A node of ours is asked by #52000 and answers with #52001, to the ns and with its uncertainty:
//! offset = ((T2 − T1) + (T3 − T4)) / 2, delay = (T4 − T1) − (T3 − T2). Any other node acknowledges a
//! heartbeat with bit 15 by #17000, to the ms (`--plain`). Without an id it is asked who is there.
//!
//! *Limits.* The offset is as good as both ways are equally long, half the delay at worst, and as this
//! host's clock is right.

use std::fmt;
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Result, bail};
use console::units;
use serde_json::{Value, json};
use stanag_net::Group;
use stanag_net::station::{self, Report, TOOLS, What};
use stanag_wire::NodeId;

use super::options::Options;
use super::target::Target;
use crate::ctrl_c;

/// How long a read waits.
const PATIENCE: Duration = Duration::from_millis(5);
/// How long after a discovery answers are awaited.
const DISCOVERY: Duration = Duration::from_millis(1_500);
/// How far a Time Stamp of whole ms may be behind. \[ns\]
const MS: i64 = 1_000_000;

/// One answer, in ns.
struct Answer {
    sequence: u32,
    /// The node's clock less this host's; `None` while it is not set.
    offset_ns: Option<i64>,
    delay_ns: i64,
    /// How far the node says that it may be off.
    node_uncertainty_ns: u64,
    state: &'static str,
    plain: bool,
}

impl Answer {
    /// How far the offset may be off at most, this host's own clock aside.
    fn uncertainty_ns(&self) -> u64 {
        let floor = if self.plain { MS.unsigned_abs() } else { 0 };
        self.delay_ns.unsigned_abs() / 2 + self.node_uncertainty_ns + floor
    }

    fn to_json(&self) -> Value {
        json!({
            "seq": self.sequence,
            "offset_ns": self.offset_ns,
            "delay_ns": self.delay_ns,
            "node_uncertainty_ns": self.node_uncertainty_ns,
            "uncertainty_ns": self.uncertainty_ns(),
            "state": self.state,
        })
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let delay = units::magnitude(self.delay_ns.unsigned_abs());
        match self.offset_ns {
            Some(offset_ns) => write!(
                f,
                "seq={} offset {} ± {}, delay {delay}, node ± {} ({})",
                self.sequence,
                units::difference(offset_ns),
                units::magnitude(self.uncertainty_ns()),
                units::magnitude(self.node_uncertainty_ns),
                self.state,
            ),
            None => write!(f, "seq={} clock not set, delay {delay}", self.sequence),
        }
    }
}

/// Asks, prints, and says by its exit code whether each answered.
///
/// # Errors
///
/// When the group cannot be joined.
pub fn run(options: &Options, targets: &[Target]) -> Result<ExitCode> {
    let mut all = Vec::new();
    let mut code = ExitCode::SUCCESS;
    for target in targets {
        let mut group = Group::station(target.place)?;
        group.set_patience(Some(PATIENCE))?;
        let Some(id) = target.id else {
            if !discover(&mut group, target)? {
                code = ExitCode::FAILURE;
            }
            continue;
        };
        let mut answers = Vec::new();
        for sequence in 1..=options.count {
            if ctrl_c::is_pressed() {
                break;
            }
            let asked = Instant::now();
            match ask(&mut group, id, sequence, options)? {
                Some(answer) => {
                    if !options.json {
                        console::print_line!("{target}: {answer}");
                    }
                    answers.push(answer);
                }
                None if !options.json => console::print_line!("{target}: seq={sequence} no answer"),
                None => {}
            }
            if sequence < options.count {
                let pause = Duration::from_millis(options.interval);
                std::thread::sleep(pause.saturating_sub(asked.elapsed()));
            }
        }
        if answers.is_empty() {
            console::print_error!("{target} did not answer");
            code = ExitCode::FAILURE;
        }
        let answers: Vec<_> = answers.iter().map(Answer::to_json).collect();
        all.push(json!({"node": target.to_string(), "answers": answers}));
    }
    if options.json {
        console::print_line!("{:#}", json!(all));
    }
    Ok(code)
}

/// Lists who answers; whether anybody does.
fn discover(group: &mut Group, target: &Target) -> Result<bool> {
    group.send(&station::discovery(TOOLS));
    let asked = Instant::now();
    let mut found: Vec<NodeId> = Vec::new();
    let mut buffer = [0; 2_048];
    while asked.elapsed() < DISCOVERY {
        let Some(datagram) = group.receive(&mut buffer)? else {
            continue;
        };
        for said in station::read(datagram, TOOLS, host_utc_ns()?) {
            if said.what == What::Identity && !found.contains(&said.from) {
                console::print_line!("{}/{}", target, said.from);
                found.push(said.from);
            }
        }
    }
    if found.is_empty() {
        console::print_error!("nobody answers at {target} (`cargo xtask sim --stanag` starts one)");
    }
    Ok(!found.is_empty())
}

fn ask(group: &mut Group, id: NodeId, sequence: u32, options: &Options) -> Result<Option<Answer>> {
    let asked = Instant::now();
    let t1 = host_utc_ns()?;
    let request = if options.plain {
        station::heartbeat(TOOLS, id, t1)
    } else {
        station::clock_request(TOOLS, id, t1, sequence)
    };
    group.send(&request);
    let mut buffer = [0; 2_048];
    while asked.elapsed() < Duration::from_millis(options.timeout) {
        let Some(datagram) = group.receive(&mut buffer)? else {
            continue;
        };
        // On this host's steady clock, so that a step of its UTC changes no delay.
        let round_trip_ns = i64::try_from(asked.elapsed().as_nanos())?;
        let t4 = t1 + round_trip_ns;
        for said in station::read(datagram, TOOLS, t4) {
            if said.from != id {
                continue;
            }
            match said.what {
                What::Clock(report) if report.sequence == Some(sequence.into()) => {
                    return Ok(Some(of_report(sequence, &report, t1, t4)));
                }
                What::Acknowledged {
                    time_ns,
                    original_ms,
                } if options.plain => {
                    let ours = stanag_wire::TimeStamp::from_unix_ns(t1).ms;
                    if original_ms == Some(ours) {
                        return Ok(Some(Answer {
                            sequence,
                            // Rounded down to the ms: in the middle of it.
                            offset_ns: time_ns.map(|it| it + MS / 2 - (t1 + t4) / 2),
                            delay_ns: round_trip_ns,
                            node_uncertainty_ns: 0,
                            state: "to the ms",
                            plain: true,
                        }));
                    }
                }
                _ => {}
            }
        }
    }
    Ok(None)
}

fn of_report(sequence: u32, report: &Report, t1: i64, t4: i64) -> Answer {
    let times = report.arrival_ns.zip(report.sent_ns);
    Answer {
        sequence,
        offset_ns: times.map(|(t2, t3)| ((t2 - t1) + (t3 - t4)) / 2),
        delay_ns: times.map_or(t4 - t1, |(t2, t3)| (t4 - t1) - (t3 - t2)),
        node_uncertainty_ns: report.uncertainty_ns.unwrap_or(0),
        state: match report.state {
            Some(0) => "not set",
            Some(1) => "messages",
            Some(2) => "pulse",
            Some(3) => "holdover",
            Some(4) => "second not proved",
            _ => "state not known",
        },
        plain: false,
    }
}

fn host_utc_ns() -> Result<i64> {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
    match i64::try_from(since_1970.as_nanos()) {
        Ok(ns) => Ok(ns),
        Err(_) => bail!("this host's clock is beyond 2262"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets() {
        let with_id: Target = "239.255.45.86:51017/00:50:43:01".parse().unwrap();
        assert_eq!(
            with_id.to_string(),
            "stanag:239.255.45.86:51017/00:50:43:01"
        );
        let all: Target = "127.0.0.1:51017".parse().unwrap();
        assert_eq!(all.id, None);
        assert!("10.0.0.1:5".parse::<Target>().is_err());
        assert!("127.0.0.1:51017/12".parse::<Target>().is_err());
    }

    #[test]
    fn an_offset_is_the_middle_of_both_ways() {
        let report = Report {
            sequence: Some(1),
            arrival_ns: Some(1_000_500),
            sent_ns: Some(1_000_700),
            uncertainty_ns: Some(40),
            state: Some(2),
            uptime_ns: None,
        };
        // 100 there, 300 back, the node's clock ahead by 1 000 000.
        let answer = of_report(1, &report, 400, 1_000);
        assert_eq!(answer.delay_ns, 400);
        assert_eq!(answer.offset_ns, Some(999_900));
        assert_eq!(answer.uncertainty_ns(), 240);
    }
}
