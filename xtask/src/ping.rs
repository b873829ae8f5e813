//! `ping`: asks nodes for their time.
//!
//! *Purpose.* One line an answer: the node's UTC, how long the answer took, and how far the node's
//! time is from this host's. With several nodes, a line a pair: how far they are [apart](pair).
//!
//! *Design.* A node answers with its time at the arrival of the request; the host's time at that
//! moment is taken as the middle between sending and receiving. All nodes are asked at once, each
//! by a thread of its own. Requests follow each other.
//!
//! *Limits.* The difference to this host is as good as the two ways are equally long, half a round
//! trip at worst, and as this host's clock is right. Of two nodes' difference the host's clock is no
//! part.

mod answer;
mod node;
mod pair;
mod stanag;

use std::process::ExitCode;
use std::str::FromStr;
use std::sync::Barrier;
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use mavlink_node::Version;
use serde_json::{Value, json};

use crate::ctrl_c;
use crate::link::Address;
use answer::Answer;
use node::{HostTime, Node};
use pair::{Apart, Pair};

/// What `ping` is asked to do.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Where the nodes are: tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE, or serial:DEVICE:BAUD; or all of them
    /// stanag:GROUP:PORT/ID, where without an id it is listed who is there
    #[arg(value_name = "ADDR", required = true)]
    places: Vec<NodePlace>,
    /// Over STANAG 4586: by heartbeats that are acknowledged, to the ms, as any node of it can
    #[arg(long)]
    plain: bool,
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
    /// The rate of the serial line behind a TCP or UDP address, in Bd: the bytes' own time at this
    /// rate is taken off what is uncertain. An emulator keeps no rate in this host's time
    #[arg(long, value_name = "BD", value_parser = clap::value_parser!(u32).range(1..))]
    line_baud: Option<u32>,
    /// Print one JSON object at the end instead of lines
    #[arg(long)]
    json: bool,
}

/// Where a node is, and so what it speaks.
#[derive(Clone, Debug)]
enum NodePlace {
    Mavlink(Address),
    Stanag(stanag::Target),
}

impl FromStr for NodePlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("stanag:") {
            Some(target) => target.parse().map(Self::Stanag),
            None => text.parse().map(Self::Mavlink),
        }
    }
}

/// Asks, prints the answers and a summary. The exit code says whether each node answered.
///
/// # Errors
///
/// When a line cannot be opened, or breaks before its node has answered.
pub fn run(options: &Options) -> Result<ExitCode> {
    ctrl_c::catch()?;
    let places = || options.places.iter();
    let targets = places().filter_map(|place| match place {
        NodePlace::Stanag(target) => Some(*target),
        NodePlace::Mavlink(_) => None,
    });
    let targets: Vec<_> = targets.collect();
    if !targets.is_empty() {
        ensure!(
            targets.len() == options.places.len(),
            "nodes of MAVLink and of STANAG 4586 are asked by two calls"
        );
        return stanag::run(options, &targets);
    }
    let mut round = Rounds::new(options)?;
    if let Err(error) = round.all(options) {
        if round.nodes.iter().any(|node| node.answers.is_empty()) {
            return Err(error);
        }
        eprintln!("{error:#}");
    }
    if options.json {
        println!("{:#}", round.to_json());
    } else {
        round.print_summary();
    }
    for node in &mut round.nodes {
        // A line that is gone has been reported.
        let _ = node.look_around();
    }
    let mut code = ExitCode::SUCCESS;
    for node in round.nodes.iter().filter(|node| node.answers.is_empty()) {
        eprintln!("{}", node.why_none());
        code = ExitCode::FAILURE;
    }
    Ok(code)
}

/// The nodes, and what is known of each pair.
struct Rounds {
    nodes: Vec<Node>,
    /// Each with the indices of its nodes.
    pairs: Vec<(usize, usize, Pair)>,
}

impl Rounds {
    fn new(options: &Options) -> Result<Self> {
        let version = match options.mavlink {
            1 => Version::V1,
            _ => Version::V2,
        };
        let addresses = options.places.iter().filter_map(|place| match place {
            NodePlace::Mavlink(address) => Some(address),
            NodePlace::Stanag(_) => None,
        });
        let nodes = addresses.map(|address| {
            let baud = match address {
                Address::Serial(_, baud) => Some(*baud),
                Address::Tcp(_) | Address::Udp(_) => options.line_baud,
            };
            Node::new(address, version, baud)
        });
        let nodes = nodes.collect::<Result<Vec<_>>>()?;
        let pairs = (0..nodes.len())
            .flat_map(|first| (first + 1..nodes.len()).map(move |second| (first, second)));
        Ok(Self {
            pairs: pairs
                .map(|(one, other)| (one, other, Pair::default()))
                .collect(),
            nodes,
        })
    }

    /// All requests, one round after the other.
    fn all(&mut self, options: &Options) -> Result<()> {
        for seq in 1..=options.count {
            if ctrl_c::is_pressed() {
                break;
            }
            let mut next = Instant::now();
            if seq < options.count {
                next += Duration::from_millis(options.interval);
            }
            self.round(seq, next, options)?;
        }
        Ok(())
    }

    /// Request `seq` to every node, what comes of it, and the time until the `next`.
    fn round(&mut self, seq: u32, next: Instant, options: &Options) -> Result<()> {
        let timeout = Duration::from_millis(options.timeout);
        let together = Barrier::new(self.nodes.len());
        let host = HostTime::now()?;
        let names = self.names();
        let (sender, answers) = channel();
        thread::scope(|scope| {
            let nodes: Vec<_> = (0..)
                .zip(&mut self.nodes)
                .map(|(index, node)| {
                    let (sender, together) = (sender.clone(), &together);
                    scope.spawn(move || {
                        let answer = node.ask(seq, timeout, host, together)?;
                        // The receiver waits for as many as there are nodes.
                        let _ = sender.send((index, answer));
                        node.wait(next)
                    })
                })
                .collect();
            // A node whose line is gone answers nothing: then there is an end of answers.
            drop(sender);
            let mut answers: Vec<(usize, Option<Answer>)> =
                answers.iter().take(nodes.len()).collect();
            answers.sort_unstable_by_key(|&(index, _)| index);
            report(seq, &answers, &names, &mut self.pairs, options);
            let ended = nodes.into_iter().map(|node| {
                let ended = node.join();
                ended.unwrap_or_else(|_| anyhow::bail!("a node's thread panicked"))
            });
            ended.collect()
        })
    }

    /// What each line of a node begins with: nothing, if there is only one.
    fn names(&self) -> Vec<String> {
        if self.nodes.len() == 1 {
            return vec![String::new()];
        }
        let addresses = (1..).zip(&self.nodes);
        let names = addresses.map(|(number, node)| format!("{number} {}  ", node.address));
        names.collect()
    }

    fn print_summary(&self) {
        for (name, node) in self.names().iter().zip(&self.nodes) {
            println!("{name}{}", node.summary());
        }
        for (first, second, pair) in &self.pairs {
            println!("{} less {}: {pair}", first + 1, second + 1);
        }
        if self.nodes.len() > 1 {
            let own_time = if self.nodes.iter().all(Node::has_rate) {
                "less the bytes' own time"
            } else {
                "with the bytes' own time in it where no rate is known (--line-baud)"
            };
            println!("proved: half the sum of the round trips, {own_time}");
            println!("assumed: half their difference, if requests take the same share of both");
        }
    }

    /// One node is an object; several are a list of such, and a list of pairs.
    fn to_json(&self) -> Value {
        if let [node] = self.nodes.as_slice() {
            return node.to_json();
        }
        let pairs = self.pairs.iter().map(|(first, second, pair)| {
            let mut object = pair.to_json();
            object["first"] = self.nodes[*first].address.to_string().into();
            object["second"] = self.nodes[*second].address.to_string().into();
            object
        });
        json!({
            "nodes": self.nodes.iter().map(Node::to_json).collect::<Vec<_>>(),
            "pairs": pairs.collect::<Vec<_>>(),
        })
    }
}

/// Prints the answers of a round and what they say of each pair, and adds that to `pairs`.
fn report(
    seq: u32,
    answers: &[(usize, Option<Answer>)],
    names: &[String],
    pairs: &mut [(usize, usize, Pair)],
    options: &Options,
) {
    let say = |line: String| {
        if !options.json {
            println!("seq {seq:<4} {line}");
        }
    };
    for &(index, answer) in answers {
        let name = &names[index];
        match answer {
            Some(answer) => say(format!("{name}{answer}")),
            None if ctrl_c::is_pressed() => {}
            None => say(format!("{name}no answer within {} ms", options.timeout)),
        }
    }
    let of = |node| answers.iter().find(|&&(index, _)| index == node)?.1;
    for (first, second, pair) in pairs {
        let answered = of(*first).zip(of(*second));
        if let Some(apart) = answered.and_then(|(one, other)| Apart::of(&one, &other)) {
            say(format!("{} less {}: {apart}", *first + 1, *second + 1));
            pair.push(apart);
        }
    }
}
