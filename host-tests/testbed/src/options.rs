//! The options of the experiment.
//!
//! *Purpose.* One place where they are named, checked and explained, for the verb that
//! a person gives and for the program that runs virtual boards.
//!
//! *Design.* A clap [`Args`]. Whoever builds the images hands them over with `--image`.
//!
//! *Limits.* A wrong option ends the program with exit code 2 and says what is allowed.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use variant::Image;
use world::Latency;

use crate::method::Method;

/// PINGs a second at most: more than the line has room for.
const MAX_RATE_HZ: i64 = 1_000;
/// Two boards make a difference; more than this share no machine.
const BOARDS: std::ops::RangeInclusive<usize> = 2..=16;
/// The largest error of a crystal, in ppm.
const MAX_CRYSTAL_PPM: f64 = 500.0;

/// What the experiment can be asked for.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Which boards: `virtual` ones, boards on `qemu`, or where two or more real ones
    /// are, as in serial:/dev/ttyUSB0,serial:/dev/ttyUSB1
    #[arg(long, value_name = "virtual|qemu|ADDR,ADDR", default_value = "virtual")]
    pub boards: Boards,

    /// How long a test lasts, in s
    #[arg(long, value_name = "S", default_value_t = 600, value_parser = clap::value_parser!(u32).range(1..=86_400))]
    pub duration: u32,

    /// From the boards' power to the first PING, in s; on real boards, how long their
    /// clocks may take to be set
    #[arg(long, value_name = "S", default_value_t = 180, value_parser = clap::value_parser!(u32).range(1..=86_400))]
    pub settle: u32,

    /// PINGs a second to each board
    #[arg(long, value_name = "HZ", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=MAX_RATE_HZ))]
    pub rate: u32,

    /// The real boards' RX are wired to one line: each PING is sent once, to the first
    /// address, and from the others only answers come
    #[arg(long)]
    pub one_line: bool,

    /// Which methods of keeping time, or `all`; on real boards, what they are expected to
    /// run. Without it all, and on real boards whatever they run
    #[arg(long = "method", value_name = "METHOD", value_delimiter = ',', value_parser = parse_methods)]
    methods: Vec<Methods>,

    /// The receivers of boards that are not real: what they take from an epoch to their
    /// message
    #[arg(long, value_enum, default_value_t = Receivers::M8)]
    pub receiver: Receivers,

    /// The error of each virtual board's crystal in ppm; as many as there are boards
    #[arg(
        long,
        value_name = "PPM,PPM",
        default_value = "40,-25",
        allow_hyphen_values = true
    )]
    pub crystals: Crystals,

    /// Where the chance of boards that are not real comes from
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,

    /// Run every method with so many seeds, from the first on
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000))]
    pub seeds: u64,

    /// The folder for the results
    #[arg(long, value_name = "DIR", default_value = "testbed-results")]
    pub out: PathBuf,

    /// Print one JSON object at the end instead of lines for people
    #[arg(long)]
    pub json: bool,

    /// Fail if a bound breaks
    #[arg(long)]
    pub check: bool,

    /// The image for a build setting; `cargo xtask` builds them and fills this in
    #[arg(long = "image", value_name = "SETTING=PATH", hide = true, value_parser = parse_image)]
    images: Vec<(String, PathBuf)>,
}

/// One `--method`.
#[derive(Clone, Debug)]
struct Methods(Vec<Method>);

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Receivers {
    /// An M8 in good order: half a bell of 30 ms above 40 ms
    M8,
    /// An F9: half a bell with 3 ms of standard deviation above 60.9 ms
    F9,
    /// An M8 at work: even over 90 ms above 94.7 ms
    Harsh,
}

impl Receivers {
    /// What they take from an epoch to their message.
    #[must_use]
    pub fn latency(self) -> Latency {
        match self {
            Self::M8 => Latency::m8(),
            Self::F9 => Latency::f9(),
            Self::Harsh => Latency::harsh_m8(),
        }
    }

    /// What a person reads.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::M8 => "M8: half a bell of 30 ms above 40 ms",
            Self::F9 => "F9: half a bell with 3 ms of standard deviation above 60.9 ms",
            Self::Harsh => "harsh M8: even over 90 ms above 94.7 ms",
        }
    }
}

/// The error of each board's crystal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Crystals {
    /// In ppb, board by board.
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

impl Options {
    /// The methods that are asked for by name, in the order of [`Method::ALL`]; none if none
    /// is.
    #[must_use]
    pub fn asked_methods(&self) -> Vec<Method> {
        let asked = |method: &Method| {
            self.methods
                .iter()
                .any(|methods| methods.0.contains(method))
        };
        Method::ALL.into_iter().filter(asked).collect()
    }

    /// The methods to run on boards that run whatever they are given.
    #[must_use]
    pub fn methods(&self) -> Vec<Method> {
        match self.asked_methods() {
            methods if methods.is_empty() => Method::ALL.to_vec(),
            methods => methods,
        }
    }

    /// The seeds to run.
    #[must_use]
    pub fn seeds(&self) -> std::ops::Range<u64> {
        self.seed..self.seed.saturating_add(self.seeds)
    }

    /// Where the image of `setting` is, if it was handed over.
    #[must_use]
    pub fn image(&self, setting: Image) -> Option<&PathBuf> {
        let name = setting.to_string();
        let found = self.images.iter().find(|(setting, _)| *setting == name);
        found.map(|(_, path)| path)
    }

    /// The command that repeats the experiment.
    #[must_use]
    pub fn command(&self) -> String {
        let mut command = "cargo xtask testbed".to_owned();
        match &self.boards {
            Boards::Virtual => command += " --boards virtual",
            Boards::Qemu => command += " --boards qemu",
            Boards::At(addresses) => command += &format!(" --boards {}", addresses.join(",")),
        }
        let methods = self.asked_methods();
        if methods.len() == Method::ALL.len() || (methods.is_empty() && !self.are_real()) {
            command += " --method all";
        } else if !methods.is_empty() {
            let names: Vec<String> = methods.iter().map(ToString::to_string).collect();
            command += &format!(" --method {}", names.join(","));
        }
        command += &format!(" --duration {} --rate {}", self.duration, self.rate);
        command += &format!(" --settle {}", self.settle);
        if self.one_line {
            command += " --one-line";
        }
        if !self.are_real() {
            let receiver = self.receiver.to_possible_value();
            let receiver = receiver.as_ref().map_or("", |value| value.get_name());
            command += &format!(" --receiver {receiver} --seed {}", self.seed);
            command += &format!(" --seeds {}", self.seeds);
        }
        if self.boards == Boards::Virtual {
            command += &format!(" --crystals {}", self.crystals.text);
        }
        command
    }

    fn are_real(&self) -> bool {
        matches!(self.boards, Boards::At(_))
    }
}

fn parse_methods(text: &str) -> Result<Methods, String> {
    if text == "all" {
        return Ok(Methods(Method::ALL.to_vec()));
    }
    text.parse().map(|method| Methods(vec![method]))
}

fn parse_image(text: &str) -> Result<(String, PathBuf), String> {
    text.split_once('=')
        .map(|(setting, path)| (setting.to_owned(), path.into()))
        .ok_or_else(|| "wanted is SETTING=PATH".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser, Debug)]
    struct Program {
        #[command(flatten)]
        options: Options,
    }

    fn parse(words: &str) -> Result<Options, clap::Error> {
        Program::try_parse_from(["testbed"].into_iter().chain(words.split_whitespace()))
            .map(|program| program.options)
    }

    #[test]
    fn without_options_it_is_the_papers_experiment_on_two_virtual_boards() {
        let options = parse("").unwrap();
        assert_eq!(options.boards, Boards::Virtual);
        assert_eq!((options.duration, options.rate), (600, 10));
        assert_eq!(options.crystals.ppb, [40_000, -25_000]);
        assert_eq!(options.methods(), Method::ALL);
        assert_eq!(options.seeds(), 1..2);
    }

    #[test]
    fn its_command_repeats_it() {
        for words in [
            "",
            "--method pixclock,paper-step2:50 --method paper-default --seeds 5 --crystals -1.5,0,2",
            "--boards qemu --receiver harsh --duration 60 --settle 30 --rate 100",
            "--boards tcp:localhost:5760,tcp:localhost:5761 --method all --one-line",
        ] {
            let command = parse(words).unwrap().command();
            let again = command.strip_prefix("cargo xtask testbed").unwrap();
            assert_eq!(parse(again).unwrap().command(), command);
            assert_eq!(command.contains("--one-line"), words.contains("--one-line"));
        }
    }

    #[test]
    fn what_is_wrong_is_refused_with_what_is_allowed() {
        for (words, allowed) in [
            ("--boards tcp:localhost:5760", "2 to 16 addresses"),
            ("--method paper", "paper-step2:200"),
            ("--crystals 40", "2 to 16 numbers"),
            ("--crystals 40,fast", "2 to 16 numbers"),
            ("--crystals 40,501", "-500 to 500"),
            ("--duration 0", "1..=86400"),
            ("--rate 0", "1..=1000"),
            ("--receiver m9", "m8, f9, harsh"),
        ] {
            let error = parse(words).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(allowed), "{error}");
        }
    }
}
