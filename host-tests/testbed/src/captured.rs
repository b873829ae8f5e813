//! The figure of a second: the pulse and the messages after it.
//!
//! *Purpose.* The paper's figure 2, of what a board captures.
//!
//! *Design.* Two rows over the time: the pulse's level, and a bar wherever bytes came.
//!
//! *Limits.* As fine as the steps in which it was captured.

use anyhow::Result;
use plotters::prelude::*;

/// In units of the picture, as the report's other figures.
const SIZE: (u32, u32) = (560, 220);
const FONT: (&str, i32) = ("sans-serif", 17);
/// Where the rows stand, from the bottom of the picture, and how high they are.
const BYTES_ROW: f64 = 0.15;
const PULSE_ROW: f64 = 1.45;
const ROW_HEIGHT: f64 = 0.8;
const TOP: f64 = 2.9;
/// A name stands so far above its row.
const NAME_ABOVE: f64 = 0.42;

/// What reached a board.
#[derive(Clone, Debug, Default)]
pub struct Captured {
    /// The edges of the pulse, the first one rising. \[ms\]
    pub edges_ms: Vec<f64>,
    /// The bytes from the receiver, step by step.
    pub bytes: Vec<Burst>,
}

/// The bytes of a step.
#[derive(Clone, Copy, Debug)]
pub struct Burst {
    /// The middle of the step. \[ms\]
    pub at_ms: f64,
    /// How many bytes came in it.
    pub bytes: u64,
}

impl Captured {
    /// The picture, from the first step to the last.
    ///
    /// # Errors
    ///
    /// When it cannot be drawn.
    pub fn svg(&self) -> Result<String> {
        let first = self.bytes.first().map_or(0.0, |burst| burst.at_ms);
        let last = self.bytes.last().map_or(first, |burst| burst.at_ms);
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            area.fill(&WHITE)?;
            let mut chart = ChartBuilder::on(&area)
                .margin(8)
                .margin_right(24)
                .x_label_area_size(44)
                .build_cartesian_2d(first..last.max(first + 1.0), 0.0..TOP)?;
            chart
                .configure_mesh()
                .disable_y_mesh()
                .disable_y_axis()
                .light_line_style(TRANSPARENT)
                .bold_line_style(BLACK.mix(0.15))
                .label_style(FONT)
                .axis_desc_style(FONT)
                .x_labels(12)
                .x_label_formatter(&|ms| format!("{ms:.0}"))
                .x_desc("since a second of UTC, ms")
                .draw()?;
            chart.draw_series(LineSeries::new(
                self.level(first, last),
                BLACK.stroke_width(2),
            ))?;
            let most = self.bytes.iter().map(|burst| burst.bytes).max();
            let most = most.unwrap_or(0).max(1) as f64;
            let bars = self.bytes.iter().filter(|burst| burst.bytes > 0);
            chart.draw_series(bars.map(|burst| {
                let top = BYTES_ROW + ROW_HEIGHT * burst.bytes as f64 / most;
                PathElement::new([(burst.at_ms, BYTES_ROW), (burst.at_ms, top)], BLACK)
            }))?;
            let names = [
                ("time pulse", PULSE_ROW),
                ("bytes on the GPS line", BYTES_ROW),
            ];
            chart.draw_series(names.map(|(name, row)| {
                Text::new(name, (first, row + ROW_HEIGHT + NAME_ABOVE), FONT)
            }))?;
            area.present()?;
        }
        Ok(text)
    }

    /// The pulse's level, as a line.
    fn level(&self, first: f64, last: f64) -> Vec<(f64, f64)> {
        let (mut y, mut line) = (PULSE_ROW, vec![(first, PULSE_ROW)]);
        for &edge in &self.edges_ms {
            line.push((edge, y));
            y = if y > PULSE_ROW {
                PULSE_ROW
            } else {
                PULSE_ROW + ROW_HEIGHT
            };
            line.push((edge, y));
        }
        line.push((last, y));
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_is_high_from_each_first_edge_to_its_second() {
        let captured = Captured {
            edges_ms: vec![0.0, 37.0, 1_000.0],
            bytes: vec![],
        };
        let line = captured.level(-100.0, 1_010.0);
        let is_high = |at: f64| {
            let before = line.iter().rfind(|(ms, _)| *ms <= at);
            before.is_some_and(|(_, y)| *y > PULSE_ROW)
        };
        assert_eq!(
            [-1.0, 20.0, 40.0, 1_005.0].map(is_high),
            [false, true, false, true]
        );
    }

    #[test]
    fn both_rows_are_named_even_if_nothing_came() {
        let picture = Captured::default().svg().unwrap();
        for word in ["time pulse", "bytes on the GPS line"] {
            assert!(picture.contains(word), "{picture}");
        }
    }
}
