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
mod options;
mod pair;
mod stanag;
mod target;

use std::process::ExitCode;
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
use options::NodePlace;
pub use options::Options;
use pair::{Apart, Pair};

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
        console::print_error!("{error:#}");
    }
    if options.json {
        console::print_line!("{:#}", round.to_json());
    } else {
        round.print_summary();
    }
    for node in &mut round.nodes {
        // A line that is gone has been reported.
        let _ = node.look_around();
    }
    let mut code = ExitCode::SUCCESS;
    for node in round.nodes.iter().filter(|node| node.answers.is_empty()) {
        console::print_error!("{}", node.why_none());
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
            console::print_line!("{name}{}", node.summary());
        }
        for (first, second, pair) in &self.pairs {
            console::print_line!("{} less {}: {pair}", first + 1, second + 1);
        }
        if self.nodes.len() > 1 {
            let own_time = if self.nodes.iter().all(Node::has_rate) {
                "less the bytes' own time"
            } else {
                "with the bytes' own time in it where no rate is known (--line-baud)"
            };
            console::print_line!("proved: half the sum of the round trips, {own_time}");
            console::print_line!(
                "assumed: half their difference, if requests take the same share of both"
            );
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
            console::print_line!("seq {seq:<4} {line}");
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
