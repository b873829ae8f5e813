//! Every case holds its bounds over five seeds.
//!
//! *Design.* The seeds are the first of those for figures. All fifty are
//! `cargo xtask compare --check`'s, with the table that is kept.
//!
//! *Limits.* How wide the uncertainty is beside the error, and the tail of the
//! difference beside that of the floors, are left to the fifty: five seeds' own mean
//! error, and five seeds' floors, are off by more than what the bounds leave.

use std::ops::Range;

use comparison::bounds::{Quantity, judge};
use comparison::case::{CASES, FIGURES, find};
use comparison::figures::Figures;
use comparison::{campaign, report};

const SEEDS: Range<u64> = FIGURES.start..FIGURES.start + 5;

const LEFT_OUT: [Quantity; 2] = [Quantity::Width, Quantity::P99OverFloors];

fn figures(name: &str) -> Figures {
    let case = find(name).expect("a case of that name");
    campaign::run(case, &SEEDS, &|| ()).expect("seeds")
}

#[test]
fn every_case_holds_its_bounds_on_phase_rate_and_uncertainty() {
    let mut broken = Vec::new();
    for case in &CASES {
        let figures = figures(case.name);
        print!("{}", report::text(&figures));
        let verdicts = judge(&figures);
        let breaks = verdicts
            .iter()
            .filter(|verdict| !verdict.holds && !LEFT_OUT.contains(&verdict.bound.quantity));
        broken.extend(breaks.map(|verdict| (case.name, *verdict)));
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

/// The worlds are the same but for the forecasts.
#[test]
fn a_forecast_makes_the_pulse_better() {
    let (without, with) = (figures("pulse"), figures("pulse-timtp"));
    let (without, with) = (without.ours().spread.mean, with.ours().spread.mean);
    assert!(with < 0.995 * without, "{with} ns for {without} ns");
}

#[test]
fn the_same_seeds_have_the_same_figures() {
    let once = report::value(&figures("f9"));
    assert_eq!(once, report::value(&figures("f9")));
}
