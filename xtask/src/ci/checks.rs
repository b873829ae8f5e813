//! What the output of a step has to be, beside its success.

use anyhow::{Context, Result, ensure};
use serde_json::Value;

/// Two boards by the pulse agree to far better than 1 µs: the edge is captured to 12 ns, and the
/// receivers' pulses are 30 ns (RMS) off.
const BY_PULSE_NS: i64 = 500;

/// `sim` shows two boards, what they are apart by, and a summary.
pub fn two_boards_are_apart(output: &str) -> Result<()> {
    let mut lines = output.lines();
    let heading = lines.find(|line| line.trim_start().starts_with("t  "));
    let heading = heading.context("no heading")?;
    for word in ["board 1", "board 2", "apart"] {
        ensure!(heading.contains(word), "no `{word}` in `{heading}`");
    }
    let mut rows = output
        .lines()
        .filter(|line| line.matches("set by ").count() == 2);
    let row = rows.next_back().context("no row in which both are set")?;
    let unit = row.split_whitespace().next_back();
    ensure!(
        unit.is_some_and(|unit| ["ns", "µs", "ms"].contains(&unit))
            && row.matches('±').count() == 2,
        "no difference with its unit in `{row}`"
    );
    for line in [
        "first set after ",
        "error, mean ",
        "CPU load ",
        "apart ",
        "refused ",
    ] {
        let is_there = output.lines().any(|it| it.starts_with(line));
        ensure!(is_there, "no line `{line}` in the summary");
    }
    ensure!(!output.contains('\u{1b}'), "colours in a pipe");
    Ok(())
}

/// `sim --pulse --json`: the pulse steers both boards, and they agree to nanoseconds.
pub fn boards_follow_the_pulse(output: &str) -> Result<()> {
    let summary: Value = serde_json::from_str(output)?;
    for board in 0..2 {
        let source = &summary["boards"][board]["last_status"]["source"];
        ensure!(source == "pulse", "{source} steers board {}", board + 1);
        let error = summary["boards"][board]["error_ns"]["last"].as_i64();
        let error = error.context("no error")?;
        ensure!(
            error.abs() < BY_PULSE_NS,
            "board {} is {error} ns off",
            board + 1
        );
    }
    let apart = summary["apart_ns"]["last"]
        .as_i64()
        .context("no difference")?;
    ensure!(apart < BY_PULSE_NS, "the boards are {apart} ns apart");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const GOOD: &str = "\
virtual Pixhawk 1
     t    board 1                              board 2                              apart
   0.8 s  board 1: the clock is set
    10 s  set by messages  −61.03 ms ±121 ms   set by messages  −60.98 ms ±121 ms   46.0 µs

after 10.0 s            board 1             board 2
first set after         0.76 s              0.76 s
error, mean             38.7 ms             38.6 ms
CPU load                0.45 %              0.45 %
apart                   mean 259 µs, largest 900 µs at 3 s, last 46.0 µs (10 readings)
refused                 nothing
";

    #[test]
    fn a_screen_of_two_boards_with_a_summary_is_good() {
        two_boards_are_apart(GOOD).unwrap();
    }

    #[test]
    fn what_is_missing_on_a_screen_is_named() {
        for (old, new, missing) in [
            ("  apart\n", "\n", "no `apart`"),
            ("  46.0 µs\n", "  –\n", "no difference"),
            ("refused  ", "", "`refused "),
            ("set by messages", "not set", "no row"),
            ("board 1: the", "\u{1b}[1mboard", "colours"),
        ] {
            let error = two_boards_are_apart(&GOOD.replace(old, new)).unwrap_err();
            assert!(error.to_string().contains(missing), "{error}");
        }
    }

    #[test]
    fn boards_that_are_apart_or_follow_no_pulse_are_refused() {
        let check = |source: &str, error_ns: i64, apart_ns: i64| {
            let board = json!({"last_status": {"source": source}, "error_ns": {"last": error_ns}});
            let summary = json!({"boards": [board, board], "apart_ns": {"last": apart_ns}});
            boards_follow_the_pulse(&summary.to_string())
        };
        check("pulse", 28, 55).unwrap();
        for (source, error_ns, apart_ns) in
            [("message", 28, 55), ("pulse", 900, 55), ("pulse", 28, 900)]
        {
            check(source, error_ns, apart_ns).unwrap_err();
        }
    }
}
