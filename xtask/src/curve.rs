//! `curve`: what curves between waypoints save, and what a clock is worth to those who fly them.
//!
//! *Purpose.* A study claims that 9 waypoints with curves between them fit where 20 with straight lines
//! fail. Here both are counted on a section of 857 m, or on a mission of one's own. With `--results`, two
//! boards fly that track by the times that `testbed` recorded.
//!
//! *Design.* Files of their own: the [track], the search for waypoints ([fit]), [mission] files, the
//! distance between two boards ([apart]), pictures ([plot]).

mod apart;
mod fit;
mod mission;
mod plot;
mod track;

use std::path::PathBuf;

use anyhow::{Result, ensure};

use fit::Piece;
use track::Track;

/// What routes are counted for. \[m\]
const ERRORS_M: [f64; 6] = [5.0, 2.0, 1.0, 0.5, 0.25, 0.1];
/// The error of the picture, from the above. \[m\]
const DRAWN_M: f64 = 0.5;
/// The study's waypoints: straight, curved.
const CLAIM: [usize; 2] = [20, 9];

/// What a waypoint and a curve take on the wire. \[bytes\]
struct Form {
    name: &'static str,
    waypoint: usize,
    curve: usize,
}

/// #13002 as we send it with #52010; the study's in Edition 2's wrapper; MAVLink's items.
const FORMS: [Form; 3] = [
    Form {
        name: "Edition 3",
        waypoint: 47,
        curve: 44,
    },
    Form {
        name: "Edition 2",
        waypoint: 94,
        curve: 86,
    },
    Form {
        name: "MAVLink",
        waypoint: 49,
        curve: 2 * 49,
    },
];

/// The options of `cargo xtask curve`.
#[derive(clap::Args)]
pub struct Options {
    /// A mission: QGroundControl's .plan, or QGC WPL 110 text
    file: Option<PathBuf>,
    /// What `testbed` left: how far two boards are apart that fly the track by their own time
    #[arg(long, value_name = "DIR")]
    results: Option<PathBuf>,
    /// How fast they fly
    #[arg(long, value_name = "M_S", default_value_t = 20.0)]
    speed: f64,
    /// Where the picture goes
    #[arg(long, value_name = "FILE", default_value = "target/curve.svg")]
    svg: PathBuf,
}

/// Counts, or flies.
///
/// # Errors
///
/// When a file cannot be read or written.
pub fn run(options: &Options) -> Result<()> {
    let track = match &options.file {
        Some(file) => mission::read(file)?,
        None => Track::section(),
    };
    match &options.results {
        Some(results) => {
            let speed_m_s = options.speed;
            ensure!(
                speed_m_s > 0.0 && speed_m_s.is_finite(),
                "no speed: {speed_m_s} m/s"
            );
            let found = apart::read(results, &track, speed_m_s)?;
            console::print_text!("{}", distances(&found, speed_m_s));
            plot::distances(&found, speed_m_s, &options.svg)?;
        }
        None => {
            console::print_text!("{}", counts(&track));
            let drawn = (fit::straight(&track, DRAWN_M), fit::curved(&track, DRAWN_M));
            plot::routes(&track, &drawn.0, &drawn.1, &options.svg)?;
            console::print_line!("within {DRAWN_M} m: {}", options.svg.display());
        }
    }
    Ok(())
}

/// Waypoints of a route with these pieces.
fn waypoints(route: &[Piece]) -> usize {
    route.len() + 1
}

/// The table of waypoints and bytes.
fn counts(track: &Track) -> String {
    let mut table = format!(
        "a track of {:.2} m\n\nerror ≤ m   waypoints",
        track.length_m()
    );
    for form in FORMS {
        table += &format!("        {}, bytes", form.name);
    }
    table += "\n         straight curved";
    for _ in FORMS {
        table += "     straight    curved";
    }
    table.push('\n');
    for error_m in ERRORS_M {
        let straight = waypoints(&fit::straight(track, error_m));
        let curved = fit::curved(track, error_m);
        let bent = curved
            .iter()
            .filter(|it| matches!(it.between, fit::Between::Curve(_)));
        let (bent, curved) = (bent.count(), waypoints(&curved));
        table += &format!("{error_m:>7} {straight:>9} {curved:>6}");
        for form in FORMS {
            let bytes = (
                form.waypoint * straight,
                form.waypoint * curved + form.curve * bent,
            );
            table += &format!(" {:>12} {:>9}", bytes.0, bytes.1);
        }
        table.push('\n');
    }
    let [straight, curved] = CLAIM;
    table += &format!(
        "\nleast error with {straight} straight waypoints {:.2} m, with {curved} curved ones {:.2} m\n",
        fit::least_error_m(straight, |error_m| fit::straight(track, error_m)),
        fit::least_error_m(curved, |error_m| fit::curved(track, error_m)),
    );
    table
}

/// The table of distances.
fn distances(found: &[apart::Apart], speed_m_s: f64) -> String {
    let mut table = format!("two boards on one route at {speed_m_s} m/s, by their own time\n\n");
    table += &format!(
        "{:<44} {:>12} {:>12} {:>12} {:>14}\n",
        "", "clocks apart", "mean", "greatest", "paper's mean"
    );
    for it in found {
        let paper_m = it.method.paper_ms().map(|ms| ms * 1e-3 * speed_m_s);
        table += &format!(
            "{:<44} {:>12} {:>12} {:>12} {:>14}\n",
            it.method.title(),
            scaled(it.mean_ns * 1e-9, "s"),
            scaled(it.mean_m(), "m"),
            scaled(it.most_m(), "m"),
            paper_m.map_or("–".to_owned(), |it| scaled(it, "m")),
        );
    }
    table
}

/// Three digits and a prefix.
fn scaled(value: f64, unit: &str) -> String {
    let prefixes = [(1.0, ""), (1e-3, "m"), (1e-6, "µ")];
    let (scale, prefix) = prefixes
        .into_iter()
        .find(|&(scale, _)| value >= scale)
        .unwrap_or((1e-9, "n"));
    let value = value / scale;
    let digits = if value < 10.0 {
        2
    } else if value < 100.0 {
        1
    } else {
        0
    };
    format!("{value:.digits$} {prefix}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The counts of the facts' own search, which is another one.
    #[test]
    fn as_many_waypoints_as_another_search_finds_but_for_one() {
        let track = Track::section();
        assert!((track.length_m() - 857.39).abs() < 0.01);
        let known = [(13, 6), (21, 7), (26, 8), (35, 10), (49, 11), (75, 13)];
        for (error_m, (straight, curved)) in ERRORS_M.into_iter().zip(known) {
            let found = waypoints(&fit::straight(&track, error_m));
            assert!(
                found.abs_diff(straight) <= 1,
                "{error_m} m: {found} straight"
            );
            let found = waypoints(&fit::curved(&track, error_m));
            assert!(found.abs_diff(curved) <= 1, "{error_m} m: {found} curved");
        }
    }

    #[test]
    fn lengths_have_three_digits() {
        for (value, text) in [
            (0.4328, "433 mm"),
            (1.5, "1.50 m"),
            (6.88e-2, "68.8 mm"),
            (2e-7, "200 nm"),
        ] {
            assert_eq!(scaled(value, "m"), text);
        }
    }
}
