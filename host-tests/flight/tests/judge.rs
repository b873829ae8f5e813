//! The judge beside another one, that shares no code with it: `judged/` has readings
//! made by hand and, as the last column of its demands, what `judge.py` of the field
//! reports said of them.

use std::path::PathBuf;

use flight::demands::{self, Judged};
use flight::{Flight, Reading, UNSET, WorldPicos};

fn file(name: &str) -> String {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "tests", "judged", name]
        .iter()
        .collect();
    std::fs::read_to_string(path).expect("a file of the test")
}

/// `us,utc_ns,uncertainty_ns,state` as a reading.
fn reading(line: &str) -> Reading {
    let columns: Vec<&str> = line.split(',').collect();
    let us: f64 = columns[0].parse().expect("µs");
    let at = WorldPicos((us * 1e6).round() as i64);
    if columns[3] == UNSET {
        return Reading::unset(at, "nothing");
    }
    Reading {
        at,
        utc_ns: Some(columns[1].parse().expect("ns")),
        uncertainty_ns: Some(columns[2].parse().expect("ns")),
        state: "set",
        source: "nothing",
    }
}

/// Whether two verdicts say the same: words alike, numbers to the four digits that are
/// printed.
fn is_same(one: &str, other: &str) -> bool {
    let words = |text: &str| -> Vec<String> {
        let words = text.split_whitespace();
        words
            .map(|word| word.trim_matches(',').to_owned())
            .collect()
    };
    let (one, other) = (words(one), words(other));
    let is_same =
        |(one, other): (&String, &String)| match (one.parse::<f64>(), other.parse::<f64>()) {
            (Ok(one), Ok(other)) => (one - other).abs() <= 1e-3 * one.abs(),
            _ => one == other,
        };
    one.len() == other.len() && one.iter().zip(&other).all(is_same)
}

#[test]
fn the_verdicts_are_those_of_another_judge() {
    let table = file("demands.csv");
    let all = demands::parse(table.as_bytes()).unwrap();
    let printed = table
        .lines()
        .skip(1)
        .map(|line| line.rsplit_once(',').unwrap().1);
    let mut unmet = 0;
    for (demand, printed) in all.iter().zip(printed) {
        let flight = Flight::parse(&file(&demand.file)).unwrap();
        let mut judged = Judged::new(demand);
        for line in file(&format!("{}.csv", demand.file)).lines().skip(1) {
            let reading = reading(line);
            judged.push(&reading, flight.header.utc_ns(reading.at));
        }
        let verdict = judged.verdict();
        unmet += usize::from(verdict.is_err());
        let verdict = verdict.map_or_else(|unmet| unmet.to_string(), |()| "met".to_owned());
        assert!(
            is_same(&verdict, printed),
            "{}: {demand}: {verdict}, not {printed}",
            demand.file
        );
    }
    assert_eq!((all.len(), unmet), (22, 9));
}
