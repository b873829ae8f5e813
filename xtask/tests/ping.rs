//! `cargo xtask ping` as a person calls it, against a node on a TCP port.

use std::io::{Read, Write};
use std::net::{TcpListener, UdpSocket};
use std::process::{Command, Output};
use std::thread;

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
fn tells_the_difference_to_this_host() {
    for offset_us in [0_i64, 1_500_000, -250_000] {
        let address = node(Clock::HostPlus(offset_us * 1_000));
        let output = ping(&[&address, "--count", "5", "--interval", "5", "--json"]);
        let told: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(told["answered"], 5);
        for answer in told["answers"].as_array().expect("answers") {
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
fn says_when_nobody_answers() {
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
    assert!(text(&output.stderr).contains("nobody answered at tcp:127.0.0.1"));

    let silent = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let address = format!("udp:{}", silent.local_addr().expect("its address"));
    let output = ping(&[&address, "--count", "1", "--timeout", "50"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("nobody answered at udp:"));

    let output = ping(&["tcp:127.0.0.1:1"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no node at tcp:127.0.0.1:1"));
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
    let told = text(&ping(&["tcp:localhost"]).stderr);
    assert!(
        told.contains("allowed: tcp:HOST:PORT, udp:HOST:PORT, serial:DEVICE[:BAUD]"),
        "{told}"
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_with_a_summary() {
    let address = node(Clock::HostPlus(0));
    let child = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["ping", &address, "--count", "1000", "--interval", "50"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("xtask runs");
    thread::sleep(std::time::Duration::from_millis(700));
    let interrupt = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
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
