//! A flight as a picture: the clock's error beside its claim.
//!
//! *Design.* Time to the right, ns upwards by decades, for both reach from a pulse's
//! to years. A piece of a flight is drawn by its worst reading; where that is beyond
//! the claim there is a dot. Windows are grey lines with their names.

use std::path::Path;

use ::flight::{Flight, Point, Replayed};
use anyhow::Result;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1_200, 600);
const ERROR: RGBColor = RGBColor(0, 0, 0);
const CLAIM: RGBColor = RGBColor(0, 114, 178);
/// Readable without telling red from green.
const BEYOND: RGBColor = RGBColor(213, 94, 0);
const FONT: &str = "sans-serif";
/// The scale begins here, in ns: less is drawn as this.
const LEAST_NS: f64 = 1.0;

/// Draws it into the file `svg`.
///
/// # Errors
///
/// When that cannot be written.
pub fn draw(flight: &Flight, replayed: &Replayed<'_>, title: &str, svg: &Path) -> Result<()> {
    let end_s = flight.end().as_secs().max(1.0);
    let scaled = |ns: u64| (ns as f64).max(LEAST_NS);
    let most_ns = replayed
        .points
        .iter()
        .filter_map(|point| point.worst)
        .map(|(error, claim)| scaled(error.max(claim)))
        .fold(1e3, f64::max);
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(title, (FONT, 18))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..end_s, (LEAST_NS..most_ns * 10.0).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("s since the start")
        .y_desc("ns")
        .y_label_formatter(&|ns| format!("{ns:.0e}"))
        .draw()?;
    for (window, _) in &replayed.windows {
        let from_s = window.from_s;
        if (0.0..=end_s).contains(&from_s) {
            let line = [(from_s, LEAST_NS), (from_s, most_ns * 10.0)];
            chart.draw_series(LineSeries::new(line, &BLACK.mix(0.25)))?;
            let name = Text::new(window.name.clone(), (from_s, most_ns * 8.0), (FONT, 12));
            chart.draw_series(std::iter::once(name))?;
        }
    }
    for (label, colour, of) in [
        ("claimed", CLAIM, claim as fn((u64, u64)) -> u64),
        ("error", ERROR, error),
    ] {
        // A line ends where the clock is unset.
        let pieces = replayed.points.split(|point| point.worst.is_none());
        let mut is_first = true;
        for piece in pieces.filter(|piece| !piece.is_empty()) {
            let points = piece
                .iter()
                .filter_map(|point| Some((point.at_s, scaled(of(point.worst?)))));
            let drawn = chart.draw_series(LineSeries::new(points, &colour))?;
            if std::mem::take(&mut is_first) {
                drawn
                    .label(label)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour));
            }
        }
    }
    let beyond = replayed.points.iter().filter_map(|point: &Point| {
        let (error, claim) = point.worst?;
        (error > claim).then(|| Circle::new((point.at_s, scaled(error)), 3, BEYOND.filled()))
    });
    chart
        .draw_series(beyond)?
        .label("beyond the claim")
        .legend(|(x, y)| Circle::new((x + 10, y), 3, BEYOND.filled()));
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .label_font((FONT, 14))
        .draw()?;
    area.present()?;
    drop((chart, area));
    console::write_file(svg, text.as_bytes())
}

const fn error(worst: (u64, u64)) -> u64 {
    worst.0
}

const fn claim(worst: (u64, u64)) -> u64 {
    worst.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::flight::player::Totals;

    #[test]
    fn what_is_beyond_the_claim_has_a_dot_and_a_window_its_name() {
        let flight = Flight::parse(
            "# window 2 4 a fault\n9e0,pulse\n"
                .replace("9e0", "9000000")
                .as_str(),
        );
        let flight = flight.unwrap();
        let window = flight.header.windows[0].clone();
        let point = |at_s, worst| Point { at_s, worst };
        let replayed = Replayed {
            windows: vec![(window, Default::default())],
            demands: Vec::new(),
            points: vec![
                point(0.0, Some((0, 250_000_000))),
                point(1.0, None),
                point(2.0, Some((400, 300))),
                point(3.0, Some((u64::MAX, 300))),
            ],
            totals: Totals::default(),
        };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("flight.svg");
        draw(&flight, &replayed, "x.ev", &file).unwrap();
        let picture = std::fs::read_to_string(file).unwrap();
        for word in ["<svg", "x.ev", "a fault", "claimed", "error"] {
            assert!(picture.contains(word), "{word}");
        }
        assert_eq!(picture.matches("<circle").count(), 3, "one in the legend");
    }
}
