//! A trace and what the clocks made of it, as a picture.
//!
//! *Design.* Time to the right, upwards how far ahead of the best smooth line: the
//! arrivals as dots, each clock as a line. The scale is that of the clocks without
//! their extremes; what lies beyond it is cut off, a stall's dots first of all.

use std::path::Path;

use anyhow::Result;
use comparison::spread::quantile;
use comparison::trace::Replayed;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1_200, 600);
/// One for each clock, ours first; readable without telling red from green.
const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
];
const DOTS: RGBColor = RGBColor(120, 120, 120);
const FONT: &str = "sans-serif";

/// Draws it into the file `svg`.
///
/// # Errors
///
/// When that cannot be written.
pub fn draw(replayed: &Replayed, title: &str, svg: &Path) -> Result<()> {
    let begin = replayed.at.first().copied().unwrap_or(0);
    let seconds = |at: i64| (at - begin) as f64 * 1e-9;
    let ms = |ns: i64| ns as f64 * 1e-6;
    let end = seconds(replayed.at.last().copied().unwrap_or(begin)).max(1.0);
    let (low, high) = scale(replayed);

    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(title, (FONT, 18))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .build_cartesian_2d(0.0..end, low..high)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("s since the first arrival")
        .y_desc("ms ahead of the best smooth line")
        .draw()?;
    let inside = |y: f64| (low..=high).contains(&y);
    // Ours last, on top of all others.
    for (track, colour) in replayed.tracks.iter().zip(COLOURS).rev() {
        let points = replayed.at.iter().zip(&track.ahead);
        let points: Vec<_> = points
            .map(|(&at, ahead)| ahead.map(|ahead| (seconds(at), ms(ahead))))
            .collect();
        // A line ends where its clock leaves the scale or is not set.
        let pieces = points.split(|point| point.is_none_or(|(_, y)| !inside(y)));
        let mut is_first = true;
        for piece in pieces.filter(|piece| !piece.is_empty()) {
            let series = LineSeries::new(piece.iter().flatten().copied(), &colour);
            let drawn = chart.draw_series(series)?;
            if std::mem::take(&mut is_first) {
                drawn
                    .label(track.name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour));
            }
        }
    }
    let dots = replayed.arrivals.iter();
    let dots = dots.map(|&(at, ahead)| (seconds(at), ms(ahead)));
    let dots = dots.filter(|&(_, y)| inside(y));
    chart
        .draw_series(dots.map(|point| Circle::new(point, 2, DOTS.filled())))?
        .label("arrivals")
        .legend(|(x, y)| Circle::new((x + 10, y), 2, DOTS.filled()));
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .label_font((FONT, 14))
        .draw()?;
    area.present()?;
    drop((chart, area));
    console::write_file(svg, text.as_bytes())
}

/// From where to where, in ms: the middle 99 % of what each clock published, and a
/// margin.
fn scale(replayed: &Replayed) -> (f64, f64) {
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for track in &replayed.tracks {
        let mut ahead: Vec<i64> = track.ahead.iter().flatten().copied().collect();
        ahead.sort_unstable();
        for share in [0.005, 0.995] {
            let edge = quantile(&ahead, share).unwrap_or(0) as f64 * 1e-6;
            (low, high) = (low.min(edge), high.max(edge));
        }
    }
    let margin = 0.1 * (high - low).max(0.1);
    (low - margin, high + margin)
}

#[cfg(test)]
mod tests {
    use comparison::trace::{HEADER, Trace};

    use super::*;

    #[test]
    fn the_picture_names_every_clock_that_was_set() {
        let rows = (0..600_u64).map(|i| {
            let utc = 1_800_000_000_000_000 + i * 200_000;
            format!("{},{utc}", i * 200_000 + 40_000 + i * 7_919 % 30_000)
        });
        let text = format!("{HEADER}\n{}", rows.collect::<Vec<_>>().join("\n"));
        let replayed = Trace::parse(&text).unwrap().replay();
        let name = format!("pixclock-plot-{}.svg", std::process::id());
        let file = std::env::temp_dir().join(name);
        draw(&replayed, "a trace", &file).unwrap();
        let picture = std::fs::read_to_string(&file).unwrap();
        std::fs::remove_file(&file).unwrap();
        for word in [
            "<svg", "a trace", "arrivals", "ours", "paper", "px4", "chrony",
        ] {
            assert!(picture.contains(word), "{word}");
        }
        assert_eq!(picture.matches("<circle").count(), 601, "one in the legend");
    }
}
