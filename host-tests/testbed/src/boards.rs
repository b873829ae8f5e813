//! The boards of the experiment: where they are, their receivers and their crystals.

use std::str::FromStr;

use clap::ValueEnum;
use world::Latency;

/// How many boards: two make a difference, and more than 16 share no machine.
const BOARDS: std::ops::RangeInclusive<usize> = 2..=16;
/// The largest error of a crystal. \[ppm\]
const MAX_CRYSTAL_PPM: f64 = 500.0;

/// Which boards.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Boards {
    /// Virtual Pixhawks.
    Virtual,
    /// QEMU, two boards.
    Qemu,
    /// These addresses, two at least.
    At(Vec<String>),
}

impl FromStr for Boards {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "virtual" => Ok(Self::Virtual),
            "qemu" => Ok(Self::Qemu),
            addresses => {
                let addresses: Vec<String> = addresses.split(',').map(str::to_owned).collect();
                if BOARDS.contains(&addresses.len()) {
                    Ok(Self::At(addresses))
                } else {
                    Err(
                        "allowed: virtual, qemu, or 2 to 16 addresses with commas between them, \
                         as in serial:/dev/ttyUSB0,serial:/dev/ttyUSB1"
                            .to_owned(),
                    )
                }
            }
        }
    }
}

/// The receivers of boards that are not real.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Receivers {
    /// An M8 in good order: half a bell of 30 ms above 40 ms
    M8,
    /// An F9: half a bell with 3 ms of standard deviation above 60.9 ms
    F9,
    /// An M8 at work: even over 90 ms above 94.7 ms
    Harsh,
    /// As quiet as the paper's: half a bell whose spread alone makes the paper's best row, 3.44 ms
    Paper,
    /// The same with half of that spread
    PaperHalf,
}

impl Receivers {
    /// Their latency.
    #[must_use]
    pub fn latency(self) -> Latency {
        match self {
            Self::M8 => Latency::m8(),
            Self::F9 => Latency::f9(),
            Self::Harsh => Latency::harsh_m8(),
            Self::Paper => Latency::paper(),
            Self::PaperHalf => Latency::paper_half(),
        }
    }

    /// Their description in the report.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::M8 => "M8: half a bell of 30 ms above 40 ms",
            Self::F9 => "F9: half a bell with 3 ms of standard deviation above 60.9 ms",
            Self::Harsh => "harsh M8: even over 90 ms above 94.7 ms",
            Self::Paper => {
                "paper: half a bell above 40 ms whose spread alone sets two boards 3.44 ms apart"
            }
            Self::PaperHalf => "paper, half: the same with half of that spread",
        }
    }

    /// Their name on a command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::M8 => "m8",
            Self::F9 => "f9",
            Self::Harsh => "harsh",
            Self::Paper => "paper",
            Self::PaperHalf => "paper-half",
        }
    }
}

/// The error of each board's crystal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Crystals {
    /// Board by board. \[ppb\]
    pub ppb: Vec<i32>,
    /// As they were written.
    text: String,
}

impl Crystals {
    /// As a person wrote them.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }
}

impl FromStr for Crystals {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            "allowed: 2 to 16 numbers from -500 to 500 with commas between them, as in 40,-25"
                .to_owned()
        };
        let ppb = text.split(',').map(|ppm| {
            let ppm: f64 = ppm.trim().parse().map_err(|_| wrong())?;
            (ppm.abs() <= MAX_CRYSTAL_PPM)
                .then(|| (ppm * 1e3).round() as i32)
                .ok_or_else(wrong)
        });
        let ppb = ppb.collect::<Result<Vec<i32>, String>>()?;
        if !BOARDS.contains(&ppb.len()) {
            return Err(wrong());
        }
        Ok(Self {
            ppb,
            text: text.to_owned(),
        })
    }
}
