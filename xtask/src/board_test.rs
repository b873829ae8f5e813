//! `board-test`: the tests of the flashed image, on the virtual board.

use anyhow::Result;

use crate::image::{self, Board, Variant, cargo};

/// Builds the image at every tick setting and runs the tests on them.
///
/// # Errors
///
/// When something cannot be built, or a test fails.
pub fn run(arguments: &[String]) -> Result<()> {
    let mut tests = cargo();
    tests.args(["test", "--locked", "--package", "virtual-pixhawk"]);
    for tick_us in console::TICKS_US {
        let image = image::build(Variant {
            tick_us,
            ..Variant::standard(Board::Pixhawk1)
        })?;
        tests.env(format!("PIXCLOCK_IMAGE_{tick_us}US"), &image);
        if tick_us == Variant::standard(Board::Pixhawk1).tick_us {
            tests.env("PIXCLOCK_IMAGE", image);
        }
    }
    image::run(tests.args(arguments))
}
