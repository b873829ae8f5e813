//! What every verb does at a terminal that is closed, on a disk that is full, with files from a
//! spreadsheet and arguments that are no text.
#![cfg(unix)]

use std::ffi::OsStr;
use std::fs::{File, OpenOptions};
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Arrivals as a board logged them.
const TRACE: &str = "local_us,gps_utc_us\n\
    1000000,1790000001000000\n1200000,1790000001200000\n1400000,1790000001400000\n";

fn xtask(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
    command.current_dir(folder).stdin(Stdio::null());
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A folder with what the verbs below read.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("the test's own files can be used");
    let file = |name: &str, content: &[u8]| std::fs::write(folder.path().join(name), content);
    file("trace.csv", TRACE.as_bytes()).expect("the test's own files can be used");
    file("silent.ev", b"# window 0 5 first half\n10000000,pulse\n")
        .expect("the test's own files can be used");
    file("card.img", &fat_image::formatted(fat_image::Kind::Fat16))
        .expect("the test's own files can be used");
    folder
}

/// Verbs that print something without a board: its arguments, one word each.
const VERBS: [&str; 8] = [
    "replay trace.csv --svg picture.svg",
    "replay trace.csv --svg picture.svg --json",
    "replay silent.ev --svg picture.svg",
    "compare --list",
    "card card.img",
    "card card.img --json",
    "device-id 3670026",
    "ping udp:127.0.0.1:9 --count 2 --interval 1 --timeout 20",
];

/// Each verb with this standard output, and what it said on standard error.
fn each(stdout: impl Fn() -> Stdio) -> Vec<(&'static str, Output)> {
    let folder = folder();
    let run = |verb: &'static str| {
        let mut command = xtask(folder.path());
        let output = command.args(verb.split(' ')).stdout(stdout()).output();
        (verb, output.expect("the test's own files can be used"))
    };
    VERBS.into_iter().map(run).collect()
}

#[test]
fn a_closed_pipe_ends_every_verb_quietly() {
    for (verb, output) in each(|| {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        writer.into()
    }) {
        assert_eq!(output.status.code(), Some(1), "{verb}: {output:?}");
        assert_eq!(text(&output.stderr), "", "{verb}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_ends_every_verb_with_one_sentence() {
    for (verb, output) in each(|| {
        let full = OpenOptions::new().write(true).open("/dev/full");
        full.unwrap().into()
    }) {
        assert_eq!(output.status.code(), Some(1), "{verb}");
        let said = text(&output.stderr);
        assert_eq!(said.lines().count(), 1, "{verb}: {said}");
        assert!(
            said.starts_with("error: cannot write the output: "),
            "{said}"
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn errors_that_nobody_can_read_are_no_panic() {
    let full: File = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let folder = folder();
    let mut command = xtask(folder.path());
    let ended = command
        .args(["replay", "nowhere.csv"])
        .stderr(full)
        .status();
    assert_eq!(ended.unwrap().code(), Some(1));
}

#[cfg(target_os = "linux")]
#[test]
fn nothing_stays_behind_on_a_full_disk() {
    let folder = folder();
    let picture = folder.path().join("picture.svg");
    // Takes no byte, as a full disk does.
    std::os::unix::fs::symlink("/dev/full", &picture).unwrap();
    let mut command = xtask(folder.path());
    let output = command.args(["replay", "trace.csv", "--svg", "picture.svg"]);
    let output = output.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(
        said.contains("cannot write picture.svg: No space left"),
        "{said}"
    );
    assert!(picture.symlink_metadata().is_err());
}

#[test]
fn a_spreadsheets_csv_is_read_or_refused_by_its_name() {
    let folder = folder();
    let replay = |content: &str| {
        std::fs::write(folder.path().join("one.csv"), content).unwrap();
        let mut command = xtask(folder.path());
        let output = command.args(["replay", "one.csv", "--svg", "one.svg"]);
        output.output().unwrap()
    };
    let plain = replay(TRACE);
    assert_eq!(plain.status.code(), Some(0), "{plain:?}");
    let of_a_spreadsheet = format!("\u{FEFF}{}", TRACE.replace(',', ";"));
    assert_eq!(replay(&of_a_spreadsheet).stdout, plain.stdout);
    let refused = replay(&format!("{}0,5;1\n", TRACE.replace(',', ";")));
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        text(&refused.stderr).contains("`,` in numbers"),
        "{refused:?}"
    );
}

#[test]
fn arguments_that_are_no_text_are_refused_in_words() {
    let folder = folder();
    let no_text = OsStr::from_bytes(b"tcp:\xFF:1");
    let output = xtask(folder.path()).arg("ping").arg(no_text).output();
    let output = output.unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("UTF-8"), "{output:?}");
    // The name of a file may be any.
    let named = folder.path().join(OsStr::from_bytes(b"\xFF.csv"));
    std::fs::copy(folder.path().join("trace.csv"), &named).unwrap();
    let mut command = xtask(folder.path());
    let output = command.arg("replay").arg(named).args(["--svg", "one.svg"]);
    assert_eq!(output.status().unwrap().code(), Some(0));
}

#[test]
fn help_wraps_at_the_width_that_there_is() {
    let folder = folder();
    for verb in ["ping", "testbed", "sim"] {
        let mut command = xtask(folder.path());
        let output = command.args([verb, "--help"]).env("COLUMNS", "60");
        let help = text(&output.output().unwrap().stdout);
        let longest = help.lines().map(|line| line.chars().count()).max();
        assert!(
            longest.is_some_and(|width| width <= 60),
            "{verb}: {longest:?}\n{help}"
        );
    }
}
