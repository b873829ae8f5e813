//! What an experiment leaves behind: the same files from the same runs, whole and
//! readable by others, and verdicts that can fail.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mavlink_node::Address;
use mavlink_node::client::Message;
use tempfile::TempDir;
use testbed::{
    Case, Conversation, Experiment, Folder, Link, Method, OwnLog, Place, Receivers, Record, Run,
    bounds, summary,
};

const UTC_US: i64 = 1_795_320_000_000_000;
const SECONDS: i64 = 30;
/// What a board's log has beyond whole µs.
const LOGGED_NS: i64 = 250;

/// A board whose clock is `ahead_us` ahead at each PING.
fn record(name: &str, ahead_us: impl Fn(i64) -> i64) -> Record {
    let mut conversation = Conversation::new(name);
    for sequence in 0..SECONDS * 10 {
        let sent_ns = sequence * 100_000_000;
        conversation.handle_sent(sequence as u32, sent_ns, None);
        let board_us = UTC_US + sent_ns / 1_000 + ahead_us(sequence);
        let target = Address {
            system: 255,
            component: 190,
        };
        let message = Message::Ping {
            time_usec: board_us.cast_unsigned(),
            seq: sequence as u32,
            target,
        };
        conversation.handle_message(sent_ns + 5_000_000, &message);
    }
    let mut record = conversation.end(Some(&|sent_ns| UTC_US * 1_000 + sent_ns));
    let mut log = "sequence,board_time_ns\r\n".to_owned();
    for sample in &record.samples {
        let _ = write!(
            log,
            "{},{}\r\n",
            sample.sequence,
            sample.board_ns + LOGGED_NS
        );
    }
    record.take_log(OwnLog::read(log.into(), 0));
    record
}

/// An experiment with every method and two seeds, the boards `apart_us` apart.
fn experiment(apart_us: impl Fn(Method) -> i64) -> Experiment {
    let run = |method: Method, seed: u64| {
        let apart_us = apart_us(method) * (9 + seed as i64) / 10;
        let sawtooth = move |n: i64| apart_us + n * 7_919 % 11 * apart_us / 1_000;
        Run {
            case: Case::of(method, Receivers::M8),
            seed,
            lasted_s: SECONDS as u32,
            records: vec![
                record("board 1", |_| -40_000),
                record("board 2", move |n| sawtooth(n) - 40_000),
            ],
            late_ns: Vec::new(),
        }
    };
    let runs = Method::ALL
        .into_iter()
        .flat_map(|method| [run(method, 1), run(method, 2)]);
    Experiment {
        command: "cargo xtask testbed --boards virtual --method all --seeds 2".to_owned(),
        rate_hz: 10,
        place: Place::Virtual,
        conditions: vec![("receivers", "M8".to_owned())],
        runs: runs.collect(),
        cut_short: None,
    }
}

/// What has to hold, does.
fn good(method: Method) -> i64 {
    match method {
        Method::PaperDefaultMixed => 20_000,
        Method::Pixclock => 100,
        Method::PixclockPps => 0,
        _ => 6_000,
    }
}

fn written(experiment: &Experiment) -> BTreeMap<String, Vec<u8>> {
    let place = TempDir::new().expect("a file");
    let folder = Folder::create(&place.path().join("results")).expect("a file");
    for run in &experiment.runs {
        folder.write_run(run).expect("a file");
    }
    folder.write_summary(experiment).expect("a file");
    let mut files = BTreeMap::new();
    collect(folder.path(), folder.path(), &mut files);
    files
}

fn collect(root: &Path, folder: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).expect("a file") {
        let path = entry.expect("a file").path();
        if path.is_dir() {
            collect(root, &path, files);
        } else {
            let name = path
                .strip_prefix(root)
                .expect("below it")
                .to_str()
                .expect("UTF-8");
            files.insert(name.to_owned(), fs::read(&path).expect("a file"));
        }
    }
}

#[test]
fn the_same_runs_make_the_same_files_byte_for_byte() {
    let files = written(&experiment(good));
    assert_eq!(files, written(&experiment(good)));
    // Two files of samples, two logs and one of differences a run; a figure a method, a
    // summary, a report.
    assert_eq!(files.len(), (5 * 2 + 1) * Method::ALL.len() + 2);
    assert_ne!(files, written(&experiment(|method| good(method) + 10)));
}

#[test]
fn a_file_of_samples_is_a_table_that_others_can_read() {
    let files = written(&experiment(good));
    let text = &files["paper-step2-50/seed-1/samples-2.csv"];
    let mut table = csv::Reader::from_reader(text.as_slice());
    let columns = table.headers().unwrap().clone();
    assert_eq!(&columns[2], "board_time_ns");
    let rows: Vec<_> = table.records().collect::<Result<_, _>>().unwrap();
    assert_eq!(rows.len(), 300);
    assert_eq!(&rows[1][0], "1");
    assert_eq!(
        rows[0][2].parse(),
        Ok((UTC_US + 6_000 - 40_000) * 1_000 + LOGGED_NS)
    );
    assert_eq!(&rows[0][3], "log");
    assert_eq!(rows[0][5].parse(), Ok(-34_000_000 + LOGGED_NS));
    // The board's own log is there as it was, and the report's figure by itself.
    let log = &files["paper-step2-50/seed-1/log-2.csv"];
    assert_eq!(log.iter().filter(|byte| **byte == b'\n').count(), 301);
    let page = String::from_utf8(files["report.html"].clone()).unwrap();
    let figure = String::from_utf8(files["figures/paper-step2-50.svg"].clone()).unwrap();
    assert!(page.contains(&figure));
}

#[test]
fn the_report_needs_nothing_else_and_has_a_figure_and_a_row_for_each_method() {
    let experiment = experiment(good);
    let files = written(&experiment);
    let page = String::from_utf8(files["report.html"].clone()).unwrap();
    let links = page.replace("http://www.w3.org/2000/svg", "");
    for foreign in ["http", "src=", "<script", "<link", "@import", "url("] {
        assert!(!links.contains(foreign), "{foreign}");
    }
    assert_eq!(page.matches("<svg").count(), Method::ALL.len());
    assert_eq!(page.matches("<figure").count(), Method::ALL.len());
    for word in [
        "21.64 ms",
        "6.38 ms",
        "3.44 ms",
        "±",
        "@media print",
        "come out alike",
        &experiment.command,
    ] {
        let page = page.replace("</span> <span>", " ");
        assert!(page.contains(word), "{word}");
    }
}

#[test]
fn the_summary_has_the_figures_of_the_table() {
    let summary = summary(&experiment(good));
    let methods = summary["methods"].as_array().unwrap();
    let step1 = methods
        .iter()
        .find(|method| method["method"] == "paper-step1")
        .unwrap();
    assert_eq!(step1["paper_mean_ns"], 6_380_000.0);
    assert_eq!(step1["difference"]["count"], 600);
    // 6 ms and 6.6 ms, each with a sawtooth of 0.5 % on average.
    let mean = step1["mean_of_runs"]["mean_ns"].as_f64().unwrap();
    assert!((mean - 6.3e6 * 1.005).abs() < 0.01e6, "{mean}");
    // Student's t for two runs, 12.706, by half their distance.
    let half = step1["mean_of_runs"]["confidence_95_ns"].as_f64().unwrap();
    assert!((half - 12.706 * 0.3e6 * 1.005).abs() < 0.05e6, "{half}");
    assert_eq!(step1["error_to_utc"][0]["mean_ns"], 39_999_750.0);
}

#[test]
fn each_bound_holds_or_breaks_by_what_was_measured() {
    let broken = |apart_us: fn(Method) -> i64| {
        let bounds = bounds::judge(&experiment(apart_us));
        let broken = bounds.into_iter().filter(|bound| !bound.holds);
        broken.map(|bound| bound.text).collect::<Vec<_>>()
    };
    assert!(broken(good).is_empty());
    let of = |method: Method| {
        if method == Method::Pixclock {
            310
        } else {
            good(method)
        }
    };
    assert_eq!(broken(of).len(), 2, "too far, and not 20 times better");
    let of = |method: Method| {
        if method == Method::PixclockPps {
            1
        } else {
            good(method)
        }
    };
    assert_eq!(broken(of), ["pixclock-pps: mean ≤ 0.5 µs"]);
    let of = |method: Method| {
        if method == Method::PaperDefaultMixed {
            5_000
        } else {
            good(method)
        }
    };
    assert_eq!(broken(of), ["paper-default-mixed stands above paper-step1"]);
    let mut missing = experiment(good);
    missing.runs[3].records[0].samples.pop();
    let bounds = bounds::judge(&missing);
    let broken: Vec<_> = bounds.iter().filter(|bound| !bound.holds).collect();
    assert_eq!(broken.len(), 1);
    assert_eq!(broken[0].text, "every PING is answered");
}

/// pixclock by TELEM1, stamped at a PING's first byte, and by USB, stamped so long after it left.
fn by_usb(late_us: i64) -> Experiment {
    let mut experiment = experiment(good);
    experiment
        .runs
        .retain(|run| run.case.method == Method::Pixclock);
    experiment.runs.truncate(1);
    let telem1 = experiment.runs[0].clone();
    experiment.runs.push(Run {
        case: Case {
            link: Link::Usb,
            ..telem1.case
        },
        records: ["board 1", "board 2"]
            .map(|name| record(name, |_| late_us - 40_000))
            .into(),
        ..telem1
    });
    experiment.runs[0].records = ["board 1", "board 2"]
        .map(|name| record(name, |_| -40_000))
        .into();
    experiment
}

#[test]
fn by_usb_a_stamp_may_be_later_than_by_telem1_by_one_frame_and_no_more() {
    let holds = |late_us: i64| {
        let bounds = bounds::judge(&by_usb(late_us));
        let mut of_usb = bounds
            .iter()
            .filter(|bound| bound.text.starts_with("by USB"));
        of_usb.next().expect("it is judged").holds
    };
    // By TELEM1 it is the ten bits of a byte, 86.905 µs, after the PING left.
    assert!(holds(0) && holds(500) && holds(1_086));
    assert!(!holds(1_087) && !holds(-1));
    let summary = summary(&by_usb(500));
    assert_eq!(summary["methods"][1]["link"], "usb");
    assert_eq!(
        summary["methods"][1]["stamp_less_telem1"]["greatest_ns"],
        413_095
    );
    assert_eq!(summary["methods"][0]["arrival_unknown_ns"], 0);
    assert_eq!(summary["methods"][1]["arrival_unknown_ns"], 1_000_000);
}

#[test]
fn the_report_shows_the_frame_on_virtual_boards_and_its_uncertainty_on_real_ones() {
    let mut experiment = by_usb(500);
    let page = |experiment: &Experiment| {
        String::from_utf8(written(experiment)["report.html"].clone()).unwrap()
    };
    let virtual_boards = page(&experiment);
    assert!(virtual_boards.contains("From sending to the stamp"));
    assert!(virtual_boards.contains("less TELEM1") && virtual_boards.contains("+413 µs"));
    experiment.place = Place::Lines;
    experiment.runs.remove(0);
    let real_ones = page(&experiment);
    // Of 300 pairs: 1.96 · 0.408 ms / √300.
    for word in [
        "the next frame, up to 1.00 ms",
        "known to ±1.00 ms",
        "of 300 to ±46.2 µs",
    ] {
        assert!(real_ones.contains(word), "{word}");
        assert!(testbed::text(&experiment).contains(word), "{word}");
    }
}

#[test]
fn a_run_without_a_pair_is_reported_and_breaks_nothing_else() {
    let mut experiment = experiment(good);
    experiment.runs.truncate(2);
    for run in &mut experiment.runs {
        run.records[1].samples.clear();
    }
    let files = written(&experiment);
    let page = String::from_utf8(files["report.html"].clone()).unwrap();
    assert!(page.contains("answers are missing"));
    assert_eq!(
        files["paper-default-mixed/seed-1/difference.csv"]
            .iter()
            .filter(|b| **b == b'\n')
            .count(),
        1
    );
}
