//! `replay` of a flight as people and judges start it: exit codes, files, JSON.
//!
//! The clock gets no mark here, so that its verdicts do not depend on it.

use std::path::Path;
use std::process::{Command, Output};

/// Ten seconds in which nothing arrives.
const SILENT: &str = "# window 0 5 first half\n10000000,pulse\n";

const DEMANDS: &str = "file,from_s,to_s,demand,bound_ns\n\
    silent.ev,0,5,not misleading,\n\
    other.ev,0,5,not misleading,\n\
    late.ev,0,5,not misleading,\n\
    late.ev,5,9,right,90000000\n";

/// Runs `replay` of `name`, a flight of silence, in `folder`.
fn replay(folder: &Path, name: &str, arguments: &[&str]) -> Output {
    std::fs::write(folder.join(name), SILENT).expect("a flight");
    std::fs::write(folder.join("demands.csv"), DEMANDS).expect("demands");
    Command::new(env!("CARGO_BIN_EXE_xtask"))
        .current_dir(folder)
        .args(["replay", name, "--svg", "picture.svg"])
        .args(arguments)
        .output()
        .expect("replay runs")
}

#[test]
fn demands_decide_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name| replay(folder.path(), name, &["--demands", "demands.csv"]);
    let printed = |output: &Output| String::from_utf8_lossy(&output.stdout).into_owned();
    let met = run("silent.ev");
    assert_eq!(met.status.code(), Some(0));
    assert!(printed(&met).contains("met      0-5 s: not misleading"));
    let unmet = run("late.ev");
    assert_eq!(unmet.status.code(), Some(1));
    assert!(printed(&unmet).contains("met      0-5 s: not misleading"));
    assert!(printed(&unmet).contains("NOT MET  5-9 s: right within 90 ms: set in 0.0 %"));
    assert_eq!(run("unnamed.ev").status.code(), Some(2));
}

#[test]
fn each_reading_is_written_and_the_json_is_one_object() {
    let folder = tempfile::tempdir().unwrap();
    let output = replay(
        folder.path(),
        "silent.ev",
        &[
            "--json",
            "--readings",
            "readings.csv",
            "--floor",
            "2013-01-01",
        ],
    );
    assert!(output.status.success());
    let printed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(printed["windows"][0]["name"], "first half");
    assert_eq!(printed["windows"][0]["readings"], 136);
    assert_eq!(printed["windows"][0]["states"]["unset"], 136);
    let readings = std::fs::read_to_string(folder.path().join("readings.csv")).unwrap();
    let lines: Vec<&str> = readings.lines().collect();
    // At 0, 37, 74 … up to 9 990 ms.
    assert_eq!(lines.len(), 1 + 271);
    assert_eq!(lines[0], "us,utc_ns,uncertainty_ns,state");
    assert_eq!(lines[271], "9990000.0000,0,0,unset");
    let picture = std::fs::read_to_string(folder.path().join("picture.svg")).unwrap();
    assert!(picture.contains("first half"));
}

#[test]
fn a_bad_line_is_told_by_its_number() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.ev"), "# ppm 20\n1,knock\n").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .current_dir(folder.path())
        .args(["replay", "bad.ev"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let printed = String::from_utf8_lossy(&output.stderr);
    assert!(
        printed.contains("line 2: the event is `knock`, allowed is mark, mark60"),
        "{printed}"
    );
}
