//! The field reports as flights: each demand that is made of them is met.

use std::fmt::Write as _;

use flight::demands::{self, Demand};
use flight::player::Setup;
use flight::{Flight, replay};
use host_tests::captures;

#[test]
fn each_demand_of_the_field_reports_is_met() {
    let Some(table) = captures::file("field/demands.csv") else {
        return;
    };
    let all = demands::parse(&table).unwrap();
    let mut files: Vec<&str> = all.iter().map(|demand| &*demand.file).collect();
    files.dedup();
    let mut unmet = String::new();
    for file in files {
        let text = captures::file(&format!("field/{file}")).unwrap();
        let flight = Flight::parse(&String::from_utf8_lossy(&text)).unwrap();
        let mut demands: Vec<Demand> = all.clone();
        demands.retain(|demand| demand.file == file);
        for judged in &replay(&flight, &Setup::default(), &demands, |_| {}).demands {
            if let Err(why) = judged.verdict() {
                writeln!(unmet, "{file}: {}: {why}", judged.demand).unwrap();
            }
        }
    }
    assert!(unmet.is_empty(), "{unmet}");
}
