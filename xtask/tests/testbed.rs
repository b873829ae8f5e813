//! `cargo xtask testbed` as a person calls it, with boards at the end of a line: that it
//! measures what is there, and what it prints and keeps when something goes wrong.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use host_tests::mavlink_server::{Behaviour, Clock, Mishap, serve};
use serde_json::Value;
use tempfile::TempDir;

/// What the second board is ahead of the first, in ns: more than this host's noise.
const AHEAD_NS: i64 = 20_000_000;

/// Two good boards.
fn behaviours() -> [Behaviour; 2] {
    [(1, 0), (2, AHEAD_NS)].map(|(system_id, ahead_ns)| Behaviour {
        system_id,
        ..Behaviour::from(Clock::HostPlus(ahead_ns))
    })
}

/// Boards that live as long as the test; their addresses.
fn boards(behaviours: &[Behaviour]) -> Vec<String> {
    let start = |&behaviour: &Behaviour| {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("its address");
        thread::spawn(move || serve(&listener, behaviour));
        format!("tcp:{address}")
    };
    behaviours.iter().map(start).collect()
}

/// Runs a test of `seconds` at `addresses`, its results in `out`.
fn testbed(addresses: &[String], seconds: u32, out: &Path, more: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["testbed", "--boards", &addresses.join(",")])
        .args(["--settle", "1", "--rate", "50", "--json"])
        .args(["--duration", &seconds.to_string()])
        .arg("--out")
        .arg(out)
        .args(more)
        // Where results go that have no place.
        .env("TMPDIR", out.with_file_name("elsewhere"))
        .output()
        .expect("xtask runs")
}

fn folder() -> (TempDir, std::path::PathBuf) {
    let folder = TempDir::new().expect("a folder");
    std::fs::create_dir(folder.path().join("elsewhere")).expect("a folder");
    let out = folder.path().join("results");
    (folder, out)
}

fn output_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn summary(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", output_of(output)))
}

/// Samples of board `number` that nothing has spoiled; how many of them a busy host makes
/// late is its own affair.
fn unspoiled(out: &Path, number: usize) -> usize {
    let file = out.join(format!("pixclock/seed-1/samples-{number}.csv"));
    let mut table = csv::Reader::from_path(file).expect("a file");
    let verdicts = table.records().map(|row| row.expect("a row")[6].to_owned());
    verdicts
        .filter(|verdict| ["good", "late"].contains(&verdict.as_str()))
        .count()
}

fn lines(file: &Path) -> usize {
    let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{file:?}: {error}"));
    text.lines().count()
}

#[test]
fn it_measures_what_two_boards_are_apart_and_its_own_noise() {
    let (_kept, out) = folder();
    let output = testbed(&boards(&behaviours()), 4, &out, &["--method", "pixclock"]);
    assert_eq!(output.status.code(), Some(0), "{}", output_of(&output));
    let summary = summary(&output);
    let method = &summary["methods"][0];
    assert_eq!(method["method"], "pixclock");
    let median = method["difference"]["p50_ns"].as_i64().expect("a size");
    assert!((median - AHEAD_NS).abs() < AHEAD_NS / 4, "{median}");
    for board in method["runs"][0]["boards"].as_array().expect("boards") {
        assert_eq!(board["asked"], 200);
        assert_eq!(board["answered"], 200);
        assert_eq!(board["in_own_log"], 200);
        assert!(board["round_trip"]["p50_ns"].as_u64() > Some(0));
        assert!(board["send_delay"]["max_ns"].as_u64() > Some(0));
    }
    let folder = out.join("pixclock").join("seed-1");
    for file in ["samples-1", "samples-2", "log-1", "log-2"] {
        assert_eq!(
            lines(&folder.join(file).with_extension("csv")),
            201,
            "{file}"
        );
    }
    let pairs = method["difference"]["count"].as_u64().expect("a count");
    assert_eq!(lines(&folder.join("difference.csv")) as u64, pairs + 1);
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.contains("This host’s own noise") && report.contains("<svg"));
}

/// Two boards whose RX are wired to the first one's line; their addresses, and how many
/// bytes were sent to the second one, where no board receives them.
fn boards_on_one_line() -> (Vec<String>, Arc<AtomicUsize>) {
    let bound = || TcpListener::bind("127.0.0.1:0").expect("a port");
    let nodes = boards(&behaviours());
    let near = [bound(), bound()];
    let addresses = near.iter().map(|listener| {
        let address = listener.local_addr().expect("its address");
        format!("tcp:{address}")
    });
    let addresses = addresses.collect();
    let unreceived = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&unreceived);
    thread::spawn(move || {
        let [host_1, host_2] = near.map(|listener| listener.accept().expect("the host").0);
        let node = |place: &String| {
            let place = place.trim_start_matches("tcp:");
            TcpStream::connect(place).expect("the node")
        };
        let [node_1, node_2] = [node(&nodes[0]), node(&nodes[1])];
        let both = |stream: &TcpStream| stream.try_clone().expect("a handle");
        let to_both = [both(&node_1), both(&node_2)];
        thread::spawn({
            let host = both(&host_1);
            move || pass_on(host, &to_both, &AtomicUsize::new(0))
        });
        thread::spawn(move || pass_on(node_1, &[host_1], &AtomicUsize::new(0)));
        thread::spawn({
            let host = both(&host_2);
            move || pass_on(host, &[], &counted)
        });
        pass_on(node_2, &[host_2], &AtomicUsize::new(0));
    });
    (addresses, unreceived)
}

/// Hands on what comes, byte for byte, and counts it.
fn pass_on(mut from: TcpStream, to: &[TcpStream], count: &AtomicUsize) {
    let mut buffer = [0; 1_024];
    while let Ok(length @ 1..) = from.read(&mut buffer) {
        count.fetch_add(length, Ordering::Relaxed);
        for mut to in to {
            if to.write_all(&buffer[..length]).is_err() {
                return;
            }
        }
    }
}

#[test]
fn boards_on_one_line_receive_the_same_pings() {
    let (_kept, out) = folder();
    let (addresses, unreceived) = boards_on_one_line();
    let output = testbed(&addresses, 3, &out, &["--one-line"]);
    assert_eq!(output.status.code(), Some(0), "{}", output_of(&output));
    assert_eq!(unreceived.load(Ordering::Relaxed), 0);
    let summary = summary(&output);
    let method = &summary["methods"][0];
    let median = method["difference"]["p50_ns"].as_i64().expect("a size");
    assert!((median - AHEAD_NS).abs() < AHEAD_NS / 4, "{median}");
    let sent = |board: usize| {
        let file = out.join(format!("pixclock/seed-1/samples-{board}.csv"));
        let mut table = csv::Reader::from_path(file).expect("a file");
        let rows = table.records().map(|row| row.expect("a row"));
        rows.map(|row| row[1].to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(sent(1).len(), 150);
    assert_eq!(sent(1), sent(2));
    for board in method["runs"][0]["boards"].as_array().expect("boards") {
        assert_eq!(board["in_own_log"], 150);
    }
    let output = testbed(&["virtual".to_owned()], 3, &out, &["--one-line"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn a_reboot_is_reported_and_the_samples_before_it_are_kept() {
    let (_kept, out) = folder();
    let mut behaviours = behaviours();
    behaviours[1].mishap = Some((Duration::from_secs(3), Mishap::Reboots));
    let output = testbed(&boards(&behaviours), 30, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        output_of(&output).contains("it rebooted "),
        "{}",
        output_of(&output)
    );
    let summary = summary(&output);
    // Until then 50 a second, and no sample from after.
    assert!((100..=150).contains(&unspoiled(&out, 2)), "{summary:#}");
    assert!(summary["methods"][0]["runs"][0]["lasted_s"].as_u64() < Some(10));
}

#[test]
fn a_piece_of_a_log_that_is_lost_is_asked_for_again() {
    let (_kept, out) = folder();
    let mut behaviours = behaviours();
    behaviours[0].mishap = Some((Duration::ZERO, Mishap::LosesALogPiece));
    let output = testbed(&boards(&behaviours), 2, &out, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", output_of(&output));
    let summary = summary(&output);
    let boards = &summary["methods"][0]["runs"][0]["boards"];
    assert_eq!(boards[0]["in_own_log"], boards[0]["answered"]);
    // Byte for byte as the other one, whose log came at once, but for its times.
    let log = |n: u32| {
        let file = out.join(format!("pixclock/seed-1/log-{n}.csv"));
        std::fs::read_to_string(file).expect("a log")
    };
    assert_eq!(log(1).len(), log(2).len());
    assert_eq!(lines(&out.join("pixclock/seed-1/log-1.csv")), 101);
}

#[test]
fn a_missing_log_is_reported_and_the_answers_are_kept() {
    let (_kept, out) = folder();
    let mut behaviours = behaviours();
    behaviours[1].mishap = Some((Duration::ZERO, Mishap::MissesTheEnd));
    // What an earlier test has left.
    let stale = out.join("pixclock/seed-1/log-2.csv");
    std::fs::create_dir_all(stale.parent().expect("its folder")).expect("a folder");
    std::fs::write(&stale, "old").expect("a file");
    let output = testbed(&boards(&behaviours), 2, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    let text = output_of(&output);
    assert!(
        text.contains("did not confirm that the test has ended"),
        "{text}"
    );
    let summary = summary(&output);
    assert_eq!(
        summary["methods"][0]["runs"][0]["boards"][1]["answered"],
        100
    );
    assert!(!stale.exists());
}

#[test]
fn a_lost_receiver_is_reported_and_the_samples_before_it_are_kept() {
    let (_kept, out) = folder();
    let mut behaviours = behaviours();
    behaviours[0].mishap = Some((Duration::from_secs(6), Mishap::LosesReceiver));
    let output = testbed(&boards(&behaviours), 9, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        output_of(&output).contains("it lost its receiver"),
        "{}",
        output_of(&output)
    );
    let summary = summary(&output);
    assert!((100..=250).contains(&unspoiled(&out, 1)), "{summary:#}");
    assert_eq!(unspoiled(&out, 2), 450);
}

#[test]
fn silence_is_reported_and_the_samples_before_it_are_kept() {
    let (_kept, out) = folder();
    let mut behaviours = behaviours();
    behaviours[1].mishap = Some((Duration::from_secs(2), Mishap::FallsSilent));
    let output = testbed(&boards(&behaviours), 30, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        output_of(&output).contains("it fell silent"),
        "{}",
        output_of(&output)
    );
    let summary = summary(&output);
    assert!((50..=100).contains(&unspoiled(&out, 2)), "{summary:#}");
    assert!(summary["methods"][0]["runs"][0]["lasted_s"].as_u64() < Some(15));
}

#[test]
fn boards_that_cannot_be_tested_together_are_refused_in_a_sentence() {
    let (_kept, out) = folder();
    let [good, other] = behaviours();
    let unset = Behaviour {
        clock: Clock::Unset,
        ..other
    };
    let twin = Behaviour {
        system_id: 1,
        ..other
    };
    let step2 = Behaviour {
        parameters: [3.0, 200.0, 115_200.0, 1.0, 0.0, 0.0],
        ..other
    };
    for (behaviour, sentence) in [
        (unset, "was not set within 1 s"),
        (twin, "are both system 1"),
        (step2, "runs paper-step2 with a tick of 200 µs"),
    ] {
        let output = testbed(&boards(&[good, behaviour]), 1, &out, &[]);
        assert_eq!(output.status.code(), Some(1));
        let text = output_of(&output);
        assert!(text.contains(sentence), "{text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
    let output = testbed(
        &boards(&behaviours()),
        1,
        &out,
        &["--method", "paper-step1"],
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(output_of(&output).contains("these boards run pixclock, not paper-step1"));
}

#[test]
fn a_link_that_is_not_there_is_wrong_usage() {
    let (_kept, out) = folder();
    let two = boards(&behaviours());
    for (boards, options, sentence) in [
        (
            &["qemu".to_owned()][..],
            &["--link", "usb"][..],
            "QEMU has no USB",
        ),
        (&two, &["--link", "telem1,usb"], "by one link"),
        (
            &two,
            &["--link", "usb", "--one-line"],
            "a serial line to all boards",
        ),
    ] {
        let output = testbed(boards, 1, &out, options);
        assert_eq!(output.status.code(), Some(2));
        assert!(
            output_of(&output).contains(sentence),
            "{}",
            output_of(&output)
        );
    }
}

#[test]
fn real_boards_by_usb_have_its_frame_in_their_statement_of_uncertainty() {
    let (_kept, out) = folder();
    let output = testbed(&boards(&behaviours()), 2, &out, &["--link", "usb"]);
    assert_eq!(output.status.code(), Some(0), "{}", output_of(&output));
    assert_eq!(
        summary(&output)["methods"][0]["arrival_unknown_ns"],
        1_000_000
    );
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.contains("a difference is known to ±1.00 ms"));
}

#[test]
fn an_address_without_a_board_is_reported() {
    let (_kept, out) = folder();
    let deaf = TcpListener::bind("127.0.0.1:0").expect("a port");
    let mut addresses = boards(&behaviours()[..1]);
    addresses.push(format!("tcp:{}", deaf.local_addr().expect("its address")));
    let output = testbed(&addresses, 1, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        output_of(&output).contains("no board answers at tcp:127"),
        "{}",
        output_of(&output)
    );
    addresses[1] = "serial:/dev/there-is-none".to_owned();
    let output = testbed(&addresses, 1, &out, &[]);
    assert!(
        output_of(&output).contains("there is no /dev/there-is-none"),
        "{}",
        output_of(&output)
    );
    let output = testbed(&["tcp:here".to_owned(), addresses[0].clone()], 1, &out, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        output_of(&output).contains("allowed: tcp:HOST:PORT"),
        "{}",
        output_of(&output)
    );
}

#[cfg(unix)]
#[test]
fn a_port_that_somebody_else_holds_is_said() {
    use serialport::SerialPort as _;

    let (_kept, out) = folder();
    let (_far_end, near_end) = serialport::TTYPort::pair().expect("a terminal");
    let device = near_end.name().expect("its name");
    drop(near_end);
    let _held = serialport::new(&device, 115_200)
        .open()
        .expect("the first one");
    let mut addresses = boards(&behaviours()[..1]);
    addresses.push(format!("serial:{device}"));
    let output = testbed(&addresses, 1, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        output_of(&output).contains("if another program holds it"),
        "{}",
        output_of(&output)
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_costs_no_sample() {
    let (kept, out) = folder();
    let folder = out.join("pixclock").join("seed-1");
    std::fs::create_dir_all(&folder).expect("a folder");
    // Takes no byte, as a full disk does.
    std::os::unix::fs::symlink("/dev/full", folder.join("samples-1.csv")).expect("a link");
    let output = testbed(&boards(&behaviours()), 2, &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    let text = output_of(&output);
    assert!(
        text.contains("cannot write") && text.contains("samples-1.csv"),
        "{text}"
    );
    assert!(text.contains("everything was written to"), "{text}");
    assert_eq!(lines(&folder.join("samples-2.csv")), 101);
    let elsewhere = std::fs::read_dir(kept.path().join("elsewhere")).expect("a folder");
    let rescued = elsewhere.flatten().next().expect("a folder").path();
    assert_eq!(lines(&rescued.join("pixclock/seed-1/samples-1.csv")), 101);
    assert!(rescued.join("report.html").exists());
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_what_was_measured() {
    let (_kept, out) = folder();
    let addresses = boards(&behaviours()).join(",");
    let child = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["testbed", "--boards", &addresses, "--settle", "1"])
        .arg("--out")
        .arg(&out)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("xtask runs");
    thread::sleep(Duration::from_secs(5));
    let interrupt = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(interrupt.expect("kill runs").success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0), "{}", output_of(&output));
    assert!(
        output_of(&output).contains("stopped by Ctrl-C"),
        "{}",
        output_of(&output)
    );
    // The boards got the command, and write their cards.
    assert!(
        !output_of(&output).contains("confirm"),
        "{}",
        output_of(&output)
    );
    assert!(lines(&out.join("pixclock").join("seed-1").join("samples-1.csv")) > 10);
}
