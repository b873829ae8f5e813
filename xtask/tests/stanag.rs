//! `cargo xtask ping stanag:` and `gateway` as a person calls them, against nodes with this host's clock.

use std::io::{ErrorKind, Read as _, Write as _};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use host_tests::mavlink_server::{Clock, serve};
use node_values::{NodeTime, Parameter, Parameters};
use serde_json::Value;
use serialport::{SerialPort as _, TTYPort};
use stanag_net::Group;
use stanag_net::station::{self, TOOLS};
use stanag_node::{Config, Node, Reading, State};
use stanag_wire::NodeId;
use timebase::{Cycles, StampedByte};

const ONE: NodeId = NodeId(0x0050_4301);
const OTHER: NodeId = NodeId(0x0050_4302);
const MS: i64 = 1_000_000;

struct NoParameters;

impl Parameters for NoParameters {
    fn parameter(&self, _: Parameter) -> f32 {
        0.0
    }
}

/// A board whose clock is this host's and `ahead_ns` more; without that it is not set.
struct Board {
    node: Node,
    boot: Instant,
    ahead_ns: Option<i64>,
}

impl Board {
    fn new(id: NodeId, ahead_ns: Option<i64>) -> Self {
        let config = Config {
            id,
            version: [0, 0, 0],
            git_hash: 0,
            board: 9,
        };
        Self {
            node: Node::new(config),
            boot: Instant::now(),
            ahead_ns,
        }
    }

    fn now(&self) -> Cycles {
        Cycles::from_nanos(
            u64::try_from(self.boot.elapsed().as_nanos()).expect("the test's own net works"),
        )
    }

    fn reading(&self) -> Reading {
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let host_ns = i64::try_from(since_1970.expect("the test's own net works").as_nanos())
            .expect("the test's own net works");
        Reading {
            time: NodeTime {
                boot: self.now(),
                utc_ns: self.ahead_ns.map(|ahead_ns| host_ns + ahead_ns),
            },
            uncertainty_ns: 40,
            state: match self.ahead_ns {
                Some(_) => State::Pulse,
                None => State::NotSet,
            },
        }
    }

    /// The frames that answer a datagram.
    fn answer(&mut self, datagram: &[u8]) -> Vec<Vec<u8>> {
        let at_arrival = self.reading();
        let arrival = self.now();
        let Ok(requests) = self.node.handle(datagram, arrival) else {
            return Vec::new();
        };
        let requests: Vec<_> = requests.collect();
        let mut sent = Vec::new();
        for request in requests {
            let clock = (&at_arrival, &self.reading());
            let send = &mut |frame: &[u8]| sent.push(frame.to_vec());
            self.node.answer(&request, clock, &NoParameters, send);
        }
        sent
    }

    /// Lives in the group as long as the test.
    fn join(mut self, place: &str) {
        let mut group = Group::node(place.parse().expect("the test's own net works"))
            .expect("the test's own net works");
        thread::spawn(move || {
            let mut buffer = [0; 2_048];
            loop {
                let received = group
                    .receive(&mut buffer)
                    .expect("the test's own net works")
                    .map(<[u8]>::to_vec);
                for frame in received.map(|it| self.answer(&it)).unwrap_or_default() {
                    group.send(&frame);
                }
            }
        });
    }

    /// Lives at the other end of a serial line as long as the test.
    fn on_line(mut self, mut line: TTYPort) {
        line.set_timeout(Duration::from_millis(20))
            .expect("the test's own net works");
        thread::spawn(move || {
            let mut buffer = [0; 256];
            loop {
                let length = match line.read(&mut buffer) {
                    Ok(length) => length,
                    Err(error) => {
                        // Nothing came, or nobody has the other end open yet.
                        if error.kind() != ErrorKind::TimedOut {
                            thread::sleep(Duration::from_millis(20));
                        }
                        continue;
                    }
                };
                let (at_arrival, now) = (self.reading(), self.now());
                for &byte in &buffer[..length] {
                    let stamp = now.stamp();
                    let Some(request) = self.node.push(StampedByte { stamp, byte }, now) else {
                        continue;
                    };
                    let clock = (&at_arrival, &self.reading());
                    let send = &mut |frame: &[u8]| {
                        line.write_all(frame).expect("the test's own net works");
                    };
                    self.node.answer(&request, clock, &NoParameters, send);
                }
            }
        });
    }
}

fn xtask(arguments: &[&str]) -> Command {
    let mut xtask = Command::new(env!("CARGO_BIN_EXE_xtask"));
    xtask.args(arguments);
    xtask
}

fn ping(arguments: &[&str]) -> Output {
    xtask(&["ping"])
        .args(arguments)
        .output()
        .expect("xtask runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn target(place: &str, id: NodeId) -> String {
    format!("stanag:{place}/{id}")
}

/// The answers to some requests at `interval` ms.
fn answers(target: &str, options: &[&str]) -> Vec<Value> {
    let arguments = [
        &[target, "--json", "--count", "4", "--interval", "30"],
        options,
    ]
    .concat();
    let output = ping(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let nodes: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let answers = nodes[0]["answers"].as_array().expect("answers").clone();
    assert_eq!(answers.len(), 4, "{nodes}");
    answers
}

/// Each answer has the node's clock within its own uncertainty.
fn assert_ahead(answers: &[Value], ahead_ns: i64) {
    for answer in answers {
        let offset_ns = answer["offset_ns"].as_i64().expect("a set clock");
        let uncertainty_ns = answer["uncertainty_ns"].as_u64().expect("an uncertainty");
        let error_ns = offset_ns.abs_diff(ahead_ns);
        assert!(error_ns <= uncertainty_ns, "{error_ns} ns in {answer}");
    }
}

#[test]
fn nodes_of_one_group_are_told_apart_by_their_ids() {
    const PLACE: &str = "239.255.45.86:51021";
    Board::new(ONE, Some(0)).join(PLACE);
    Board::new(OTHER, Some(-700 * MS)).join(PLACE);
    let listed = ping(&[&format!("stanag:{PLACE}")]);
    let mut listed: Vec<String> = text(&listed.stdout).lines().map(str::to_owned).collect();
    listed.sort();
    assert_eq!(listed, [target(PLACE, ONE), target(PLACE, OTHER)]);
    assert_ahead(&answers(&target(PLACE, ONE), &[]), 0);
    assert_ahead(&answers(&target(PLACE, OTHER), &[]), -700 * MS);
    assert_ahead(&answers(&target(PLACE, OTHER), &["--plain"]), -700 * MS);
    let nobody = ping(&[&target(PLACE, NodeId(0x0050_4303)), "--count", "1"]);
    assert_eq!(nobody.status.code(), Some(1));
    assert!(
        text(&nobody.stderr).contains("did not answer"),
        "{nobody:?}"
    );
}

#[test]
fn a_place_of_one_node_is_unicast() {
    const PLACE: &str = "127.0.0.1:51022";
    Board::new(ONE, Some(3_000 * MS)).join(PLACE);
    assert_ahead(&answers(&target(PLACE, ONE), &[]), 3_000 * MS);
    assert_ahead(&answers(&target(PLACE, ONE), &["--plain"]), 3_000 * MS);
    let listed = ping(&[&format!("stanag:{PLACE}")]);
    assert_eq!(text(&listed.stdout).trim(), target(PLACE, ONE));
}

#[test]
fn a_clock_that_is_not_set_has_no_offset() {
    const PLACE: &str = "127.0.0.1:51023";
    Board::new(ONE, None).join(PLACE);
    for options in [&[][..], &["--plain"]] {
        for answer in answers(&target(PLACE, ONE), options) {
            assert!(answer["offset_ns"].is_null(), "{answer}");
        }
    }
    let said = text(&ping(&[&target(PLACE, ONE), "--count", "1"]).stdout);
    assert!(said.contains("clock not set"), "{said}");
}

#[test]
fn both_languages_agree_on_one_clock() {
    const PLACE: &str = "127.0.0.1:51024";
    const AHEAD_NS: i64 = 1_500_000_000;
    Board::new(ONE, Some(AHEAD_NS)).join(PLACE);
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || serve(&listener, Clock::HostPlus(AHEAD_NS)));
    let output = ping(&[&address, "--json", "--count", "4", "--interval", "30"]);
    let mavlink: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let mavlink = mavlink["answers"].as_array().expect("answers").clone();
    let stanag = answers(&target(PLACE, ONE), &[]);
    assert_eq!(mavlink.len(), stanag.len());
    for (one, other) in mavlink.iter().zip(&stanag) {
        let mavlink_ns = one["difference_us"].as_i64().unwrap() * 1_000;
        // A PING has whole µs, at both of its ends.
        let mavlink_half_ns = one["round_trip_us"].as_u64().unwrap() * 500 + 2_000;
        let apart_ns = mavlink_ns.abs_diff(other["offset_ns"].as_i64().unwrap());
        let uncertain_ns = mavlink_half_ns + other["uncertainty_ns"].as_u64().unwrap();
        assert!(
            apart_ns <= uncertain_ns,
            "{apart_ns} ns apart: {one}, {other}"
        );
    }
}

/// A program that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_gateway_makes_a_board_on_a_line_appear_in_a_group() {
    const PLACE: &str = "239.255.45.86:51025";
    let (master, slave) = TTYPort::pair().unwrap();
    let line = format!("serial:{}", slave.name().unwrap());
    // The gateway wants it for itself.
    drop(slave);
    Board::new(ONE, Some(-20 * MS)).on_line(master);
    let mut gateway = xtask(&["gateway", &line, PLACE]);
    let _gateway = Running(gateway.stdout(Stdio::null()).spawn().unwrap());
    // It is there once somebody answers.
    let begun = Instant::now();
    while !ping(&[&format!("stanag:{PLACE}")]).status.success() {
        assert!(begun.elapsed() < Duration::from_secs(30), "no gateway");
    }
    assert_ahead(&answers(&target(PLACE, ONE), &[]), -20 * MS);
    assert_ahead(&answers(&target(PLACE, ONE), &["--plain"]), -20 * MS);
    // What is no frame stays out of the line, and what follows it is answered.
    let group = Group::station(PLACE.parse().unwrap()).unwrap();
    let request = station::clock_request(TOOLS, ONE, 0, 1);
    group.send(&request[..20]);
    group.send(&[0x55; 300]);
    assert_ahead(&answers(&target(PLACE, ONE), &[]), -20 * MS);
}
