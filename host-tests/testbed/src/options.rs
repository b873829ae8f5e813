//! The options of the experiment.
//!
//! *Purpose.* One place where they are named, checked and explained, for the verb that
//! a person gives and for the program that runs virtual boards.
//!
//! *Design.* A clap [`Args`]. The verb builds the images and passes them with `--image`.
//!
//! *Limits.* A wrong option ends the program with exit code 2 and a list of what is allowed.

use std::convert::Infallible;
use std::path::PathBuf;

use clap::Args;
use variant::{Image, Load, UnknownLoad};

use crate::boards::{Boards, Crystals, Receivers};
use crate::case::Case;
use crate::link::Link;
use crate::method::Method;

/// PINGs a second at most: more than the line has room for.
const MAX_RATE_HZ: i64 = 1_000;
/// How long a quick test lasts, and how long its boards have been up before. \[s\]
const QUICK_S: u32 = 30;

/// The options of the experiment.
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
    /// run. Without it all, and on real boards the one that they run
    #[arg(long = "method", value_name = "METHOD", value_delimiter = ',', value_parser = parse_methods)]
    methods: Vec<Methods>,

    /// What `--method` was called; refused.
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "", value_parser = console::renamed("--method"))]
    way: Option<Infallible>,

    /// The receivers of boards that are not real: their latency. On virtual boards several, with commas
    /// between them, make a row each
    #[arg(long = "receiver", value_enum, value_delimiter = ',', default_values_t = [Receivers::M8])]
    pub receivers: Vec<Receivers>,

    /// What else keeps the core of virtual boards busy, in % of it: `px4` (55) or 0 to 80. Several, with
    /// commas between them, make a row each
    #[arg(long = "load", value_name = "LEVEL,LEVEL", value_delimiter = ',', default_value = "0", value_parser = parse_load)]
    loads: Vec<u8>,

    /// By which link the boards are asked; on virtual boards several, with commas between them, make a row each, and
    /// `--check` adds TELEM1 to USB, which is held against it
    #[arg(long = "link", value_enum, value_delimiter = ',', default_values_t = [Link::Telem1])]
    links: Vec<Link>,

    /// The same in ten minutes: one seed, 30 s after 30, whatever --seeds, --duration and --settle say
    #[arg(long)]
    pub quick: bool,

    /// The error of each virtual board's crystal in ppm; as many as there are boards
    #[arg(
        long,
        value_name = "PPM,PPM",
        default_value = "40,-25",
        allow_hyphen_values = true
    )]
    pub crystals: Crystals,

    /// Cycles that a virtual board's core takes for an instruction, from 1 to 4
    #[arg(long, value_name = "N", default_value = "1.0")]
    pub cpi: String,

    /// The first seed of boards that are not real
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,

    /// Run every method with this many seeds, from the first on
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

impl Options {
    /// The methods that `--method` names, in the order of [`Method::ALL`].
    #[must_use]
    pub fn named_methods(&self) -> Vec<Method> {
        let is_named = |method: &Method| {
            let mut named = self.methods.iter();
            named.any(|methods| methods.0.contains(method))
        };
        Method::ALL.into_iter().filter(is_named).collect()
    }

    /// The methods to run on boards that are given their image.
    #[must_use]
    pub fn methods(&self) -> Vec<Method> {
        match self.named_methods() {
            methods if methods.is_empty() => Method::ALL.to_vec(),
            methods => methods,
        }
    }

    /// The rows of the table: each method with each of the receivers under each load.
    #[must_use]
    pub fn cases(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for method in self.methods() {
            for &receivers in &self.receivers {
                for &load in &self.loads {
                    for link in self.links() {
                        let case = Case {
                            method,
                            receivers,
                            load,
                            link,
                        };
                        // What is named twice is run once.
                        if !cases.contains(&case) {
                            cases.push(case);
                        }
                    }
                }
            }
        }
        cases
    }

    /// The links, TELEM1 first.
    #[must_use]
    pub fn links(&self) -> Vec<Link> {
        let mut links = self.links.clone();
        if self.check && self.boards == Boards::Virtual && links.contains(&Link::Usb) {
            links.push(Link::Telem1);
        }
        links.sort();
        links.dedup();
        links
    }

    /// The link to boards that have the same in every row: the first that is named.
    #[must_use]
    pub fn first_link(&self) -> Link {
        self.links.first().copied().unwrap_or(Link::Telem1)
    }

    /// Whether a load is asked for.
    #[must_use]
    pub fn has_load(&self) -> bool {
        self.loads.iter().any(|&load| load > 0)
    }

    /// The receivers of boards that have the same in every row: the first that are named.
    #[must_use]
    pub fn first_receivers(&self) -> Receivers {
        self.receivers.first().copied().unwrap_or(Receivers::M8)
    }

    /// The same with what `--quick` means.
    #[must_use]
    pub fn made_quick(mut self) -> Self {
        if self.quick {
            (self.seeds, self.duration, self.settle) = (1, QUICK_S, QUICK_S);
        }
        self
    }

    /// The seeds to run.
    #[must_use]
    pub fn seeds(&self) -> std::ops::Range<u64> {
        self.seed..self.seed.saturating_add(self.seeds)
    }

    /// Where the image of `setting` is, if it was passed.
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
        let methods = self.named_methods();
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
        if self.links() != [Link::Telem1] {
            let links: Vec<_> = self.links().iter().map(|link| link.name()).collect();
            command += &format!(" --link {}", links.join(","));
        }
        if !self.are_real() {
            let receivers: Vec<_> = self.receivers.iter().map(|each| each.name()).collect();
            command += &format!(" --receiver {} --seed {}", receivers.join(","), self.seed);
            command += &format!(" --seeds {}", self.seeds);
            if self.has_load() {
                let loads: Vec<_> = self.loads.iter().map(u8::to_string).collect();
                command += &format!(" --load {}", loads.join(","));
            }
        }
        if self.boards == Boards::Virtual {
            command += &format!(" --crystals {}", self.crystals.text());
            if self.cpi != "1.0" {
                command += &format!(" --cpi {}", self.cpi);
            }
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

fn parse_load(text: &str) -> Result<u8, String> {
    let load: Load = text
        .parse()
        .map_err(|wrong: UnknownLoad| wrong.to_string())?;
    Ok(load.percent())
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
        let cases = Method::ALL.map(|method| Case::of(method, Receivers::M8));
        assert_eq!(options.cases(), cases);
    }

    #[test]
    fn a_row_is_a_method_with_receivers_under_a_load() {
        let options =
            parse("--method pixclock,paper-step1 --load 0,px4 --receiver m8,paper").unwrap();
        let cases = options.cases();
        assert_eq!(cases.len(), 8);
        assert_eq!(cases[1].to_string(), "paper-step1, load 55 %");
        let quick = parse("--seeds 9 --quick").unwrap().made_quick();
        assert_eq!((quick.seeds, quick.duration, quick.settle), (1, 30, 30));
    }

    #[test]
    fn its_command_repeats_it() {
        for words in [
            "",
            "--method pixclock,paper-step2:50 --method paper-default --seeds 5 --crystals -1.5,0,2 --cpi 1.6",
            "--load 0,px4,60 --receiver m8,paper,paper-half --quick",
            "--method pixclock-pps --link usb,telem1,telem2",
            "--method pixclock --link usb --check",
            "--boards serial:/dev/ttyACM0,serial:/dev/ttyACM1 --link usb",
            "--boards qemu --receiver harsh --duration 60 --settle 30 --rate 100",
            "--boards tcp:localhost:5760,tcp:localhost:5761 --method all --one-line",
        ] {
            let command = parse(words).unwrap().command();
            let again = command.strip_prefix("cargo xtask testbed").unwrap();
            assert_eq!(parse(again).unwrap().command(), command);
            assert_eq!(command.contains("--one-line"), words.contains("--one-line"));
            assert_eq!(command.contains("--link"), words.contains("--link"));
        }
    }

    #[test]
    fn usb_is_held_against_telem1_where_the_truth_is_known() {
        let links = |words: &str| parse(words).unwrap().links();
        assert_eq!(links(""), [Link::Telem1]);
        assert_eq!(links("--link usb"), [Link::Usb]);
        assert_eq!(links("--link usb --check"), [Link::Telem1, Link::Usb]);
        let real = "--boards serial:/dev/ttyACM0,serial:/dev/ttyACM1 --link usb --check";
        assert_eq!(links(real), [Link::Usb]);
    }

    #[test]
    fn an_old_word_is_refused_with_the_new_one() {
        for old in ["--way paper-step1", "--way=pixclock", "--way"] {
            let error = parse(old).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{error}");
            assert!(error.to_string().contains("`--method`"), "{error}");
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
            ("--receiver m9", "m8, f9, harsh, paper, paper-half"),
            ("--link uart4", "telem1, telem2, usb"),
            ("--load 81", "from 0 to 80"),
            ("--load px5", "from 0 to 80"),
        ] {
            let error = parse(words).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(allowed), "{error}");
        }
    }
}
