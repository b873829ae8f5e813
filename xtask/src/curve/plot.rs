//! Pictures: a track with its waypoints, and distances over time.

use std::path::Path;

use anyhow::Result;
use plotters::prelude::*;

use super::apart::Apart;
use super::fit::Piece;
use super::track::Track;

const FONT: &str = "sans-serif";
/// Readable without telling red from green.
const COLOURS: [RGBColor; 8] = [
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(213, 94, 0),
    RGBColor(240, 228, 66),
    RGBColor(86, 180, 233),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(0, 0, 0),
];
const STRAIGHT: RGBColor = RGBColor(213, 94, 0);
const CURVED: RGBColor = RGBColor(0, 114, 178);
const GREY: RGBColor = RGBColor(200, 200, 200);

/// Draws the track, east to the right, and two routes with their waypoints.
///
/// # Errors
///
/// When the file cannot be written.
pub fn routes(track: &Track, straight: &[Piece], curved: &[Piece], svg: &Path) -> Result<()> {
    let points: Vec<_> = track.0.iter().map(|it| (it.at[1], it.at[0])).collect();
    let span = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = points
            .iter()
            .map(of)
            .fold((f64::MAX, f64::MIN), |(low, high), it| {
                (low.min(it), high.max(it))
            });
        let margin = 0.05 * (high - low) + 5.0;
        low - margin..high + margin
    };
    let (east, north) = (span(|it| it.0), span(|it| it.1));
    let height = 1_000.0 * (north.end - north.start) / (east.end - east.start);
    let size = (1_080, height.clamp(300.0, 1_400.0) as u32 + 90);
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .build_cartesian_2d(east, north)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("m east")
        .y_desc("m north")
        .draw()?;
    chart.draw_series(LineSeries::new(points, GREY.stroke_width(9)))?;
    for (route, name, colour) in [(straight, "straight", STRAIGHT), (curved, "curved", CURVED)] {
        let ends = route.first().map(|it| it.from).into_iter();
        let ends = ends
            .chain(route.iter().map(|it| it.to))
            .map(|it| (it[1], it[0]));
        let line = route
            .iter()
            .flat_map(|piece| (0..=32).map(|n| piece.at(f64::from(n) / 32.0)));
        let line: Vec<_> = line.map(|it| (it[1], it[0])).collect();
        chart
            .draw_series(LineSeries::new(line, colour.stroke_width(2)))?
            .label(format!("{} {name} waypoints", route.len() + 1))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour));
        chart.draw_series(ends.map(|point| Circle::new(point, 4, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .border_style(BLACK)
        .background_style(WHITE)
        .label_font((FONT, 14))
        .draw()?;
    area.present()?;
    drop((chart, area));
    console::write_file(svg, text.as_bytes())
}

/// Columns of the picture that a point can be told apart in.
const COLUMNS: f64 = 500.0;

/// Of each column the point that is farthest apart: more would not be seen, and make a large file.
fn greatest_by_column(points: &[(f64, f64)], end_s: f64) -> Vec<(f64, f64)> {
    let column = |at: f64| (at / end_s * COLUMNS) as u32;
    let chunks = points.chunk_by(|one, next| column(one.0) == column(next.0));
    let greatest =
        chunks.filter_map(|chunk| chunk.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)));
    greatest.collect()
}

/// Draws the distances of each method's first seed over time, by decades.
///
/// # Errors
///
/// When the file cannot be written.
pub fn distances(found: &[Apart], speed_m_s: f64, svg: &Path) -> Result<()> {
    // 1 ns at 1 m/s; less is drawn as this.
    let least_m = 1e-9_f64;
    let firsts = || found.iter().flat_map(|it| &it.points[..it.first_seed]);
    let end_s = firsts().map(|it| it.0).fold(1.0, f64::max);
    let most_m = found.iter().map(Apart::most_m).fold(1e-6, f64::max) * 3.0;
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, (1_200, 600)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(
            format!("two boards on one route at {speed_m_s} m/s, by their own time"),
            (FONT, 18),
        )
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..end_s, (least_m..most_m).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("s since the start")
        .y_desc("m apart")
        .y_label_formatter(&|it| format!("{it:.0e}"))
        .draw()?;
    for (it, colour) in found.iter().zip(COLOURS.into_iter().cycle()) {
        let points = greatest_by_column(&it.points[..it.first_seed], end_s);
        let points = points
            .into_iter()
            .map(|(at, apart_m)| (at, apart_m.max(least_m)));
        chart
            .draw_series(LineSeries::new(points, &colour))?
            .label(it.method.title())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour));
    }
    chart
        .configure_series_labels()
        .border_style(BLACK)
        .background_style(WHITE.mix(0.8))
        .label_font((FONT, 13))
        .draw()?;
    area.present()?;
    drop((chart, area));
    console::write_file(svg, text.as_bytes())
}
