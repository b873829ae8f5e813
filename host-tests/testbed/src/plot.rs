//! A figure of the report.
//!
//! *Purpose.* How far two boards were apart over the test, as the paper draws it: the
//! difference over the time, its mean as a dashed line.
//!
//! *Design.* SVG as a text, small, so that its letters are still readable when a phone
//! shrinks it, and in black: the lines differ by their dashes. Of a test
//! of thousands of samples, each column of the picture shows the least and the greatest.
//!
//! *Limits.* Differences are drawn without their sign.

use anyhow::Result;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

use crate::pairing::Difference;
use crate::units::with_unit;

/// In units of the picture, which is as wide as its column.
const SIZE: (u32, u32) = (560, 320);
/// Columns into which the time is cut.
const COLUMNS: usize = 280;
/// Above the curve, for the names of the lines.
const HEADROOM: f64 = 1.32;
const FONT: &str = "sans-serif";
const FONT_SIZE: i32 = 17;
/// The curve, dark enough for grey print and lighter than the lines upon it.
const CURVE: RGBColor = RGBColor(90, 90, 90);

/// A level line across the figure.
#[derive(Clone, Debug)]
pub struct Level {
    /// Where. \[ns\]
    pub ns: f64,
    /// What it is called.
    pub name: String,
    /// How long its dashes are, and the gaps between them.
    pub dashes: (u32, u32),
}

/// The figure of `differences` over `duration_s`, with `levels` across it.
///
/// # Errors
///
/// When the picture cannot be drawn.
pub fn svg(differences: &[Difference], duration_s: u32, levels: &[Level]) -> Result<String> {
    let sizes = differences.iter().map(|d| d.ns.unsigned_abs() as f64);
    let shown = levels.iter().map(|level| level.ns);
    let top = sizes.chain(shown).fold(0.0, f64::max).max(1_000.0) * HEADROOM;
    let (unit, name) = unit_for(top);
    let end = f64::from(duration_s.max(1));
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .margin_right(16)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..end, 0.0..top / unit)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.15))
            .x_labels(7)
            .y_labels(6)
            .label_style((FONT, FONT_SIZE))
            .axis_desc_style((FONT, FONT_SIZE))
            .x_label_formatter(&|s| format!("{s:.0}"))
            .x_desc("time, s")
            .y_desc(format!("difference, {name}"))
            .draw()?;
        chart.draw_series(LineSeries::new(
            columns(differences, end)
                .into_iter()
                .map(|(s, ns)| (s, ns / unit)),
            &CURVE,
        ))?;
        for level in levels {
            let line = [(0.0, level.ns / unit), (end, level.ns / unit)];
            let style = BLACK.stroke_width(2);
            let (dash, gap) = level.dashes;
            chart
                .draw_series(DashedLineSeries::new(line, dash, gap, style))?
                .label(level.name.clone())
                .legend(move |(x, y)| {
                    DashedPathElement::new([(x, y), (x + 40, y)], dash, gap, style)
                });
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .legend_area_size(46)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.4))
            .label_font((FONT, FONT_SIZE))
            .draw()?;
        area.present()?;
    }
    Ok(text)
}

/// A curve over the load.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What it is called.
    pub name: String,
    /// Load in % and mean difference in ns, from the least load on.
    pub points: Vec<(u8, f64)>,
}

/// The least and the greatest that a logarithmic axis shows. \[ns\]
const DECADES: (f64, f64) = (10.0, 100e6);

/// The figure of `curves` over the load, with a logarithmic axis: methods are orders of magnitude apart.
///
/// # Errors
///
/// When the picture cannot be drawn.
pub fn over_load(curves: &[Curve]) -> Result<String> {
    let loads = curves.iter().flat_map(|curve| &curve.points);
    let most = loads.map(|(load, _)| *load).max().unwrap_or(0);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (SIZE.0, 2 * SIZE.1)).into_drawing_area();
        area.fill(&WHITE)?;
        let (least_ns, most_ns) = DECADES;
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .margin_right(16)
            .x_label_area_size(44)
            .y_label_area_size(72)
            .build_cartesian_2d(-1.0..f64::from(most) + 1.0, (least_ns..most_ns).log_scale())?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.15))
            .label_style((FONT, FONT_SIZE))
            .axis_desc_style((FONT, FONT_SIZE))
            .x_label_formatter(&|load| format!("{load:.0}"))
            .y_label_formatter(&|ns| with_unit(*ns))
            .x_desc("load, % of the core")
            .y_desc("mean difference")
            .draw()?;
        for (number, curve) in curves.iter().enumerate() {
            let points = curve.points.iter().map(|&(load, ns)| (load.into(), ns));
            let style = BLACK.stroke_width(2);
            // Lines differ by their dashes, marks by their size.
            let (dash, gap) = (4 + 4 * number as u32, 3);
            chart
                .draw_series(DashedLineSeries::new(points.clone(), dash, gap, style))?
                .label(curve.name.clone())
                .legend(move |(x, y)| {
                    DashedPathElement::new([(x, y), (x + 40, y)], dash, gap, style)
                });
            chart.draw_series(points.map(|point| Circle::new(point, 3, BLACK.filled())))?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::MiddleRight)
            .legend_area_size(46)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.4))
            .label_font((FONT, FONT_SIZE))
            .draw()?;
        area.present()?;
    }
    Ok(text)
}

/// The unit, in ns, in which `top` is a handy number, and its name.
fn unit_for(top_ns: f64) -> (f64, &'static str) {
    if top_ns >= 100_000.0 {
        (1e6, "ms")
    } else {
        (1e3, "µs")
    }
}

/// The least and the greatest size of each column, in the order in which they came; s
/// and ns.
fn columns(differences: &[Difference], end_s: f64) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = differences
        .iter()
        .map(|d| (d.at_ns as f64 / 1e9, d.ns.unsigned_abs() as f64))
        .collect();
    let column = |s: f64| (s / end_s * COLUMNS as f64) as usize;
    let mut shown = Vec::new();
    for part in points.chunk_by(|one, other| column(one.0) == column(other.0)) {
        let by_size = |one: &&(f64, f64), other: &&(f64, f64)| one.1.total_cmp(&other.1);
        let mut ends: Vec<(f64, f64)> = part.iter().min_by(by_size).into_iter().copied().collect();
        ends.extend(part.iter().max_by(by_size));
        ends.sort_by(|one, other| one.0.total_cmp(&other.0));
        ends.dedup();
        shown.extend(ends);
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    fn differences() -> Vec<Difference> {
        let difference = |n: u32| Difference {
            sequence: n,
            at_ns: i64::from(n) * 100_000_000,
            board: 1,
            ns: i64::from(n * 7_919 % 1_000) * 1_000,
        };
        (0..6_000).map(difference).collect()
    }

    #[test]
    fn extremes_survive_however_many_samples_a_column_has() {
        let mut all = differences();
        all[3_210].ns = -9_000_000;
        let shown = columns(&all, 600.0);
        assert!(shown.len() <= 2 * (COLUMNS + 1));
        assert!(shown.contains(&(321.0, 9e6)));
        assert!(shown.is_sorted_by(|one, other| one.0 < other.0));
    }

    #[test]
    fn it_names_its_levels_and_its_unit() {
        let level = Level {
            ns: 500_000.0,
            name: "mean 0.5 ms".to_owned(),
            dashes: (8, 6),
        };
        let picture = svg(&differences(), 600, &[level]).unwrap();
        for word in ["<svg", "viewBox", "mean 0.5 ms", "difference, ms"] {
            assert!(picture.contains(word), "{word} in {picture}");
        }
        assert!(svg(&[], 600, &[]).unwrap().contains("difference, µs"));
    }

    #[test]
    fn a_figure_over_the_load_names_its_curves() {
        let curve = |name: &str, ns: f64| Curve {
            name: name.to_owned(),
            points: vec![(0, ns), (60, 2.0 * ns)],
        };
        let picture = over_load(&[curve("one", 20.0), curve("other", 7e6)]).unwrap();
        for word in ["one", "other", "load, % of the core", "1.00 ms"] {
            assert!(picture.contains(word), "{word} in {picture}");
        }
    }
}
