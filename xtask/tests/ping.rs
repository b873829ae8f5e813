//! `cargo xtask ping` as a person calls it, against a node on a TCP port.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::process::{Command, Output};
use std::thread;
use std::time::{Duration, Instant};

use host_tests::mavlink_server::{Clock, serve};
use serde_json::Value;

fn ping(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_xtask"))
        .arg("ping")
        .args(arguments)
        .output()
        .expect("xtask runs")
}

/// A node that lives as long as the test; its address.
fn node(clock: Clock) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address");
    thread::spawn(move || serve(&listener, clock));
    format!("tcp:{address}")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn prints_a_line_an_answer_in_both_versions() {
    let address = node(Clock::HostPlus(0));
    for version in ["1", "2"] {
        let arguments = [
            &address,
            "--count",
            "3",
            "--interval",
            "20",
            "--mavlink",
            version,
        ];
        let output = ping(&arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let printed = text(&output.stdout);
        let lines: Vec<&str> = printed.lines().collect();
        assert_eq!(lines.len(), 4, "{printed}");
        for (seq, line) in (1..=3).zip(&lines) {
            assert!(line.starts_with(&format!("seq {seq} ")), "{line}");
            for word in ["T", "Z", "round trip", "ms", "difference"] {
                assert!(line.contains(word), "{word} in {line}");
            }
        }
        assert!(lines[3].starts_with("3 asked, 3 answered"), "{printed}");
    }
}

#[test]
fn measures_the_difference_to_this_host() {
    for offset_us in [0_i64, 1_500_000, -250_000] {
        let address = node(Clock::HostPlus(offset_us * 1_000));
        let output = ping(&[&address, "--count", "5", "--interval", "5", "--json"]);
        let printed: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(printed["answered"], 5);
        for answer in printed["answers"].as_array().expect("answers") {
            // The request arrived within the round trip, whose middle is taken; each of the
            // two times has whole µs.
            let error = answer["difference_us"].as_i64().expect("set") - offset_us;
            let half_trip = answer["round_trip_us"].as_i64().expect("a time") / 2;
            assert!(error.abs() <= half_trip + 2, "{error} µs in {answer}");
        }
    }
}

#[test]
fn says_when_the_clock_is_not_set() {
    let output = ping(&[&node(Clock::Unset), "--count", "1"]);
    assert_eq!(output.status.code(), Some(0));
    let printed = text(&output.stdout);
    assert!(printed.contains("clock not set, 0.0"), "{printed}");
    assert!(!printed.contains("difference"), "{printed}");
}

#[test]
fn says_when_there_is_no_answer() {
    // A port with something that is no node, and one with nothing at all.
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("tcp:{}", listener.local_addr().expect("its address"));
    thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let _ = stream.write_all(b"220 some other service\r\n");
            let _ = stream.read_to_end(&mut Vec::new());
        }
    });
    let output = ping(&[
        &address,
        "--count",
        "2",
        "--timeout",
        "50",
        "--interval",
        "1",
    ]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stdout).contains("seq 2    no answer within 50 ms"));
    assert!(text(&output.stderr).contains("no answer from tcp:127.0.0.1"));

    let silent = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let address = format!("udp:{}", silent.local_addr().expect("its address"));
    let output = ping(&[&address, "--count", "1", "--timeout", "50"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no answer from udp:"));

    let output = ping(&["tcp:127.0.0.1:1"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no node at tcp:127.0.0.1:1"));
}

/// A line to `address` on which what comes back takes 60 ms more; its address.
fn late(address: &str) -> String {
    let address = address.trim_start_matches("tcp:").to_owned();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let own = listener.local_addr().expect("its address");
    thread::spawn(move || {
        let (client, _) = listener.accept().expect("a client");
        let node = TcpStream::connect(address).expect("the node");
        let ways = [
            (client.try_clone(), node.try_clone(), 0),
            (Ok(node), Ok(client), 60),
        ];
        let ways = ways.map(|(from, to, late_ms)| {
            let (mut from, mut to) = (from.expect("a socket"), to.expect("a socket"));
            thread::spawn(move || {
                let mut bytes = [0; 1_024];
                while let Ok(count @ 1..) = from.read(&mut bytes) {
                    thread::sleep(Duration::from_millis(late_ms));
                    if to.write_all(&bytes[..count]).is_err() {
                        break;
                    }
                }
            })
        });
        // One way ends with the other.
        for way in ways {
            drop(way.join());
        }
    });
    format!("tcp:{own}")
}

#[test]
fn an_answer_that_comes_too_late_is_told_from_none() {
    let address = late(&node(Clock::HostPlus(0)));
    let output = ping(&[&address, "--count", "1", "--timeout", "1"]);
    assert_eq!(output.status.code(), Some(1));
    let errors = text(&output.stderr);
    assert!(errors.contains("takes longer than --timeout"), "{errors}");
}

#[test]
fn measures_how_far_two_nodes_are_apart_within_what_it_proves() {
    for offset_us in [0_i64, 1_500, -40_000_000] {
        let first = node(Clock::HostPlus(offset_us * 1_000));
        let second = node(Clock::HostPlus(0));
        let output = ping(&[&first, &second, "--interval", "5", "--json"]);
        let printed: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(printed["nodes"].as_array().map(Vec::len), Some(2));
        let pair = &printed["pairs"][0];
        assert_eq!(
            (&pair["first"], &pair["second"]),
            (&first.into(), &second.into())
        );
        let rounds = pair["rounds"].as_array().expect("rounds");
        assert_eq!(rounds.len(), 5);
        for (round, (one, other)) in rounds.iter().zip(answers_of_both(&printed)) {
            let ns = |key: &str| round[key].as_i64().expect(key);
            let error = ns("apart_ns") - offset_us * 1_000;
            // The nodes stamp when a read returns, which is within the round trip.
            assert!(error.abs() <= ns("proved_ns"), "{error} ns in {round}");
            // No rate is known, so nothing is taken off; and each time has whole µs.
            let (one, other) = (one * 1_000, other * 1_000);
            let half_sum = (one + other) / 2;
            assert!(
                (0..=2_000).contains(&(ns("proved_ns") - half_sum)),
                "{round}"
            );
            let half_difference = (one - other).abs() / 2;
            assert!(
                (ns("if_alike_ns") - half_difference).abs() <= 1_000,
                "{round}"
            );
        }
    }
}

/// The round trips of both nodes in µs, round by round.
fn answers_of_both(printed: &Value) -> Vec<(i64, i64)> {
    let [one, other] = [0, 1].map(|node| {
        let answers = printed["nodes"][node]["answers"]
            .as_array()
            .expect("answers");
        let round_trips = answers.iter().map(|it| it["round_trip_us"].as_i64());
        round_trips.collect::<Option<Vec<_>>>().expect("times")
    });
    one.into_iter().zip(other).collect()
}

#[test]
fn prints_a_line_an_answer_and_a_line_a_pair() {
    let nodes = [0, 1_500_000, -46_000].map(|ns| node(Clock::HostPlus(ns)));
    let [one, two, three] = nodes.each_ref();
    let output = ping(&[one, two, three, "--count", "2", "--interval", "5"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    let lines: Vec<&str> = printed.lines().collect();
    for (seq, round) in (1..=2).zip(lines.chunks(6)) {
        for (number, (line, address)) in (1..).zip(round.iter().zip(&nodes)) {
            let expected = format!("seq {seq}    {number} {address}  2");
            assert!(line.starts_with(&expected), "{line}");
        }
        for (line, pair) in round[3..].iter().zip(["1 less 2", "1 less 3", "2 less 3"]) {
            assert!(
                line.starts_with(&format!("seq {seq}    {pair}: apart ")),
                "{line}"
            );
            assert!(line.contains(" proved, ± "), "{line}");
            assert!(line.ends_with(" if both ways are alike"), "{line}");
        }
    }
    assert!(
        lines[12].starts_with(&format!("1 {one}  2 asked, 2 answered")),
        "{printed}"
    );
    assert!(
        lines[15].starts_with("1 less 2: 2 rounds, median −1."),
        "{printed}"
    );
    assert_eq!(lines.len(), 12 + 3 + 3 + 2, "{printed}");
}

#[test]
fn a_clock_that_is_not_set_is_apart_from_no_other() {
    let (unset, set) = (node(Clock::Unset), node(Clock::HostPlus(0)));
    let output = ping(&[&unset, &set, "--count", "1"]);
    assert_eq!(output.status.code(), Some(0));
    let printed = text(&output.stdout);
    assert!(!printed.contains("apart"), "{printed}");
    assert!(printed.contains("1 less 2: no round in which both clocks were set"));
}

#[test]
fn a_node_that_does_not_answer_is_named_and_the_others_are_summed_up() {
    let silent = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let silent = format!("udp:{}", silent.local_addr().expect("its address"));
    let set = node(Clock::HostPlus(0));
    let output = ping(&[&silent, &set, "--count", "1", "--timeout", "100"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains(&format!("no answer from {silent}")));
    let printed = text(&output.stdout);
    assert!(printed.contains("no answer within 100 ms"), "{printed}");
    assert!(
        printed.contains(&format!("2 {set}  1 asked, 1 answered")),
        "{printed}"
    );
}

#[test]
fn asks_all_nodes_at_once() {
    // One after the other, the second would be asked when the first is given up.
    const TIMEOUT: Duration = Duration::from_millis(2_000);
    let sockets = [0, 1].map(|_| UdpSocket::bind("127.0.0.1:0").expect("a port"));
    let addresses = sockets
        .each_ref()
        .map(|socket| format!("udp:{}", socket.local_addr().expect("its address")));
    let asked = sockets.map(|socket| {
        thread::spawn(move || {
            socket.recv(&mut [0; 64]).expect("a request");
            Instant::now()
        })
    });
    let timeout = TIMEOUT.as_millis().to_string();
    let [one, other] = addresses.each_ref();
    ping(&[one, other, "--count", "1", "--timeout", &timeout]);
    let [one, other] = asked.map(|asked| asked.join().expect("it was asked"));
    let apart = one.max(other) - one.min(other);
    assert!(apart < TIMEOUT / 2, "{apart:?}");
}

#[test]
fn refuses_wrong_usage_with_what_is_allowed() {
    for arguments in [
        &["tcp:localhost"][..],
        &["5760"],
        &["tcp:127.0.0.1:5760", "--mavlink", "3"],
        &["tcp:127.0.0.1:5760", "--count", "0"],
        &[],
    ] {
        let output = ping(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(!output.stderr.is_empty());
    }
    let printed = text(&ping(&["tcp:localhost"]).stderr);
    assert!(
        printed.contains("allowed: tcp:HOST:PORT, udp:HOST:PORT, serial:DEVICE[:BAUD]"),
        "{printed}"
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_and_a_terminal_that_closes_end_with_a_summary() {
    for signal in ["-INT", "-HUP"] {
        ends_with_a_summary(signal);
    }
}

#[cfg(unix)]
fn ends_with_a_summary(signal: &str) {
    let address = node(Clock::HostPlus(0));
    let child = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["ping", &address, "--count", "1000", "--interval", "50"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("xtask runs");
    thread::sleep(Duration::from_millis(700));
    let interrupt = Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status();
    assert!(interrupt.expect("kill runs").success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    let printed = text(&output.stdout);
    assert!(
        printed
            .lines()
            .last()
            .is_some_and(|line| line.contains(" asked, ")),
        "{printed}"
    );
}
