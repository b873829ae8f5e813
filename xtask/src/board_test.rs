//! `board-test`: the tests of the flashed image, on the virtual board.

use anyhow::Result;
use console::{TICKS_US, Way};

use crate::image::{self, Board, Variant, cargo};

/// Builds the image at every tick setting and in the paper's ways, and runs the tests on them.
///
/// # Errors
///
/// When something cannot be built, or a test fails.
pub fn run(arguments: &[String]) -> Result<()> {
    let standard = Variant::standard(Board::Pixhawk1);
    let mut tests = cargo();
    tests.args(["test", "--locked", "--package", "virtual-pixhawk"]);
    for tick_us in TICKS_US {
        let way = Way::Pixclock { tick_us };
        let image = image::build(Variant { way, ..standard })?;
        tests.env(format!("PIXCLOCK_IMAGE_{tick_us}US"), &image);
        if way == standard.way {
            tests.env("PIXCLOCK_IMAGE", image);
        }
    }
    for way in Way::PAPERS {
        let image = image::build(Variant { way, ..standard })?;
        tests.env(variable(way, ""), image);
    }
    let slower = Variant {
        way: Way::PaperDefault,
        gps_baud: 38_400,
        ..standard
    };
    tests.env(variable(slower.way, "_38400BD"), image::build(slower)?);
    image::run(tests.args(arguments))
}

/// The variable that names the image of one of the paper's ways, as in
/// `PIXCLOCK_IMAGE_PAPER_STEP2_50`.
fn variable(way: Way, ending: &str) -> String {
    let name = way.to_string().to_uppercase().replace(['-', ':'], "_");
    format!("PIXCLOCK_IMAGE_{name}{ending}")
}
