//! `board-test`: the tests of the flashed image, on the virtual board.
//!
//! *Design.* Each image is built once, and then all tests are played on cores of each pace: one that takes
//! a cycle for an instruction, as the emulator has it, and one that takes 1.6, as a Pixhawk of metal may
//! (`docs/timing.md`).

use anyhow::Result;
use variant::{Image, Load, TICKS_US, Variant};

use crate::image::{self, Board, Build, cargo};
use crate::venv;

/// PX4's uploader as PyPI has it, and what it needs and does not name.
const UPLOADER: [&str; 2] = ["autopilot_tools==0.7.0", "pyserial==3.5"];

/// The paces that are played where none is named, in cycles an instruction.
const PACES: [&str; 2] = ["1.0", "1.6"];

/// The variable in which the virtual board looks for its pace.
const PACE_VARIABLE: &str = "PIXCLOCK_CYCLES_PER_INSTRUCTION";

/// The variants that are also tested under a load, and how much of the core that takes. \[%\]
const LOADED: [(Variant, u8); 3] = [
    (Variant::STANDARD, 60),
    (Variant::PaperStep2 { tick_us: 50 }, Load::PX4_PERCENT),
    (Variant::PaperTickOnly { tick_us: 50 }, Load::PX4_PERCENT),
];

/// Builds the image at every tick setting and in the paper's variants, and runs the tests on them, at
/// `paces` or at [`PACES`].
///
/// # Errors
///
/// When something cannot be built, or a test fails.
pub fn run(paces: &[String], arguments: &[String]) -> Result<()> {
    let built = |image: Image| {
        image::build(Build {
            image,
            ..Build::standard(Board::Pixhawk1)
        })
    };
    let mut tests = cargo();
    tests.args(["test", "--locked", "--package", "virtual-pixhawk"]);
    for tick_us in TICKS_US {
        let variant = Variant::Pixclock { tick_us };
        let path = built(Image::of(variant))?;
        tests.env(format!("PIXCLOCK_IMAGE_{tick_us}US"), &path);
        if variant == Variant::STANDARD {
            tests.env("PIXCLOCK_IMAGE", path);
        }
    }
    for variant in Variant::PAPERS {
        tests.env(variable(variant, ""), built(Image::of(variant))?);
    }
    let slower = Image {
        gps_baud: 38_400,
        ..Image::of(Variant::PaperDefault)
    };
    tests.env(variable(slower.variant, "_38400BD"), built(slower)?);
    for (variant, percent) in LOADED {
        let image = Image {
            load: Load::of(percent),
            ..Image::of(variant)
        };
        let ending = format!("_LOAD_{percent}");
        let name = match variant {
            Variant::STANDARD => format!("PIXCLOCK_IMAGE{ending}"),
            papers => variable(papers, &ending),
        };
        tests.env(name, built(image)?);
    }
    let for_radio = image::build(Build {
        for_radio: true,
        ..Build::standard(Board::Pixhawk1)
    })?;
    tests.env("PIXCLOCK_IMAGE_TELEM1_57600BD", for_radio);
    let stanag = image::build(Build {
        stanag: true,
        ..Build::standard(Board::Pixhawk1)
    })?;
    tests.env("PIXCLOCK_IMAGE_STANAG", stanag);
    tests.env("PIXCLOCK_BOOTLOADER", image::build_bootloader()?);
    tests.env("PIXCLOCK_XTASK", std::env::current_exe()?);
    match venv::with("uploader-venv", "autopilot_tools", &[&UPLOADER]) {
        Ok(python) => {
            tests.env("PIXCLOCK_UPLOADER_PYTHON", python);
        }
        // A program of other people, from a place of other people: not here, the rest is tested.
        Err(error) => {
            console::print_line!("SKIPPED: PX4's uploader could not be installed: {error:#}");
        }
    }
    tests.args(arguments);
    let paces: Vec<&str> = match paces {
        [] => PACES.to_vec(),
        named => named.iter().map(String::as_str).collect(),
    };
    for pace in paces {
        console::print_line!("== {pace} cycles an instruction");
        image::run(tests.env(PACE_VARIABLE, pace))?;
    }
    Ok(())
}

/// The variable that names the image of one of the paper's variants, as in
/// `PIXCLOCK_IMAGE_PAPER_STEP2_50`.
fn variable(variant: Variant, ending: &str) -> String {
    let name = variant.to_string().to_uppercase().replace(['-', ':'], "_");
    format!("PIXCLOCK_IMAGE_{name}{ending}")
}
