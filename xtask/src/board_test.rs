//! `board-test`: the tests of the flashed image, on the virtual board.

use anyhow::Result;
use console::{TICKS_US, Variant};

use crate::image::{self, Board, Build, cargo};

/// Builds the image at every tick setting and in the paper's variants, and runs the tests on them.
///
/// # Errors
///
/// When something cannot be built, or a test fails.
pub fn run(arguments: &[String]) -> Result<()> {
    let standard = Build::standard(Board::Pixhawk1);
    let mut tests = cargo();
    tests.args(["test", "--locked", "--package", "virtual-pixhawk"]);
    for tick_us in TICKS_US {
        let variant = Variant::Pixclock { tick_us };
        let image = image::build(Build {
            variant,
            ..standard
        })?;
        tests.env(format!("PIXCLOCK_IMAGE_{tick_us}US"), &image);
        if variant == standard.variant {
            tests.env("PIXCLOCK_IMAGE", image);
        }
    }
    for variant in Variant::PAPERS {
        let image = image::build(Build {
            variant,
            ..standard
        })?;
        tests.env(variable(variant, ""), image);
    }
    let slower = Build {
        variant: Variant::PaperDefault,
        gps_baud: 38_400,
        ..standard
    };
    tests.env(variable(slower.variant, "_38400BD"), image::build(slower)?);
    image::run(tests.args(arguments))
}

/// The variable that names the image of one of the paper's variants, as in
/// `PIXCLOCK_IMAGE_PAPER_STEP2_50`.
fn variable(variant: Variant, ending: &str) -> String {
    let name = variant.to_string().to_uppercase().replace(['-', ':'], "_");
    format!("PIXCLOCK_IMAGE_{name}{ending}")
}
