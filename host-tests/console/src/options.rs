//! The options of `sim` and `qemu`.
//!
//! *Purpose.* One place where they are named, checked and explained.
//!
//! *Design.* [`Options`] is what the two share, [`SimOptions`] adds what only `sim` has. `cargo
//! xtask` reads them to build the image, and hands its path over with `--image`.
//!
//! *Limits.* A wrong option ends the program with exit code 2 and says what is allowed. Files are
//! opened later.

use std::convert::Infallible;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use clap::builder::{StringValueParser, TypedValueParser as _};
use variant::{TICKS_US, Variant};

/// The first board's MAVLink port: where ground stations look for a simulator.
pub const DEFAULT_MAVLINK_PORT: u16 = 5_760;
/// Where nodes of STANAG 4586 meet unless told: no number is fixed by anybody.
const STANAG_PLACE: &str = "239.255.45.86:51017";
/// How many boards a run may have.
pub const MAX_BOARDS: u16 = 16;
/// How many `sim` has unless asked for another number: two can disagree.
const SIM_BOARDS: u16 = 2;

/// The last port that leaves room for every board after the first.
const MAX_PORT: i64 = (u16::MAX - (MAX_BOARDS - 1)) as i64;

/// The years of the firmware's calendar.
const FIRST_YEAR: i16 = 1_980;
const LAST_YEAR: i16 = 2_100;

/// UTC in ns since 1970, as the option `--start` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct UtcNanos(pub i64);

/// What `sim` and `qemu` can be asked for.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Replay this recording instead of simulating a receiver: the bytes up to
    /// each NAV-PVT leave together at 115200, spaced by its time of week
    #[arg(long, value_name = "FILE", conflicts_with = "start")]
    pub ubx: Option<PathBuf>,

    /// Of a recording: the earliest date that the clock believes; without it, its first one
    #[arg(long, value_name = "DATE", requires = "ubx", value_parser = parse_day)]
    pub floor: Option<u32>,

    /// What the simulated receiver takes for UTC when the board powers up, as in
    /// 2026-11-22T04:00:00Z; without it, this host's clock
    #[arg(long, value_name = "TIME", value_parser = parse_utc)]
    pub start: Option<UtcNanos>,

    /// Build the firmware for this tick, in µs
    #[arg(long, value_name = "N", default_value = "50", value_parser = tick_parser())]
    tick_us: u32,

    /// Build the firmware for another variant of keeping the clock: paper-default, paper-step1,
    /// paper-step2:500, paper-step2:200 or paper-step2:50
    #[arg(long, value_name = "VARIANT", conflicts_with = "tick_us")]
    variant: Option<Variant>,

    /// The old name of `--variant`.
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "", value_parser = renamed("--variant"))]
    way: Option<Infallible>,

    /// The TCP port of the first board's MAVLink; the next boards take the next ports
    #[arg(long, value_name = "P", default_value_t = DEFAULT_MAVLINK_PORT, value_parser = clap::value_parser!(u16).range(1_024..=MAX_PORT))]
    pub mavlink_port: u16,

    /// End after this many seconds; without it, at Ctrl-C
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u64).range(1..=31_536_000))]
    duration: Option<u64>,

    /// How many boards to run; without it, two in `sim` and one on QEMU or with `--ubx`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MAX_BOARDS)))]
    boards: Option<u16>,

    /// Print each board's status line, too, with every counter
    #[arg(long, conflicts_with = "json")]
    pub verbose: bool,

    /// Print one JSON object at the end instead of lines for people
    #[arg(long)]
    pub json: bool,

    /// The firmware image to run; without it, `cargo xtask` builds one
    #[arg(long, value_name = "PATH")]
    pub image: Option<PathBuf>,
}

/// What `sim` can be asked for.
#[derive(Args, Clone, Debug)]
pub struct SimOptions {
    /// What `qemu` can be asked for, too.
    #[command(flatten)]
    pub shared: Options,

    /// Wire the simulated receiver's time pulse to the board, too
    #[arg(long, conflicts_with_all = ["ubx", "variant"])]
    pub pulse: bool,

    /// Let TELEM2 speak STANAG 4586, in this group of datagrams on the loopback interface. Of several boards at
    /// a unicast place each takes the next port
    #[arg(long, value_name = "GROUP:PORT", num_args = 0..=1, default_missing_value = STANAG_PLACE)]
    pub stanag: Option<String>,

    /// Put this image of a memory card, of any size, into board 1: it is changed in place
    #[arg(long, value_name = "IMAGE")]
    pub card: Option<PathBuf>,

    /// Plug a USB cable into each board, too: its serial port is a pseudo-terminal, whose name is printed
    #[arg(long)]
    pub usb: bool,
}

impl SimOptions {
    /// How many boards to run. A recording is of one receiver.
    #[must_use]
    pub const fn boards(&self) -> u16 {
        match (self.shared.boards, &self.shared.ubx) {
            (Some(boards), _) => boards,
            (None, Some(_)) => 1,
            (None, None) => SIM_BOARDS,
        }
    }
}

impl Options {
    /// How many boards to run on QEMU.
    #[must_use]
    pub fn qemu_boards(&self) -> u16 {
        self.boards.unwrap_or(1)
    }

    /// How long the run is to last; `None` is until Ctrl-C.
    #[must_use]
    pub fn duration(&self) -> Option<Duration> {
        self.duration.map(Duration::from_secs)
    }

    /// How the firmware is to keep the clock.
    #[must_use]
    pub fn variant(&self) -> Variant {
        let tick_us = self.tick_us;
        self.variant.unwrap_or(Variant::Pixclock { tick_us })
    }

    /// The MAVLink port of board `index`, counted from 0 and below
    /// [`MAX_BOARDS`]; it wraps beyond that.
    #[must_use]
    pub const fn mavlink_port_of(&self, index: u16) -> u16 {
        self.mavlink_port.wrapping_add(index)
    }
}

/// The parser of an option that has another name now: every value of it is refused with `new`.
pub fn renamed(new: &'static str) -> impl clap::builder::TypedValueParser<Value = Infallible> {
    StringValueParser::new()
        .try_map(move |_| Err::<Infallible, _>(format!("its name is `{new}` now")))
}

fn tick_parser() -> impl clap::builder::TypedValueParser<Value = u32> {
    clap::value_parser!(u32).try_map(|tick_us| {
        let allowed = TICKS_US.map(|tick_us| tick_us.to_string()).join(", ");
        let found = TICKS_US.contains(&tick_us).then_some(tick_us);
        found.ok_or_else(|| format!("allowed: {allowed}"))
    })
}

fn parse_utc(text: &str) -> Result<UtcNanos, String> {
    let time: jiff::Timestamp = text.parse().map_err(|error: jiff::Error| {
        format!("{error}; wanted is a time as in 2026-11-22T04:00:00Z")
    })?;
    let years = FIRST_YEAR..=LAST_YEAR;
    let year = time.to_zoned(jiff::tz::TimeZone::UTC).year();
    match i64::try_from(time.as_nanosecond()) {
        Ok(utc_ns) if years.contains(&year) => Ok(UtcNanos(utc_ns)),
        _ => Err(format!(
            "wanted is a time of the years {FIRST_YEAR} to {LAST_YEAR}"
        )),
    }
}

/// A date, in days since 1970.
fn parse_day(text: &str) -> Result<u32, String> {
    let wanted = "wanted is a date from 1980 on, as in 2016-05-01";
    let date: jiff::civil::Date = text.parse().map_err(|error| format!("{error}; {wanted}"))?;
    let begins = date.to_zoned(jiff::tz::TimeZone::UTC);
    let seconds = begins
        .map_err(|error| error.to_string())?
        .timestamp()
        .as_second();
    match u32::try_from(seconds / 86_400) {
        Ok(days) if date.year() >= FIRST_YEAR => Ok(days),
        _ => Err(wanted.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser, Debug)]
    struct Sim {
        #[command(flatten)]
        options: SimOptions,
    }

    fn parse_sim(words: &[&str]) -> Result<SimOptions, clap::Error> {
        Sim::try_parse_from(["sim"].iter().chain(words)).map(|sim| sim.options)
    }

    fn parse(words: &[&str]) -> Result<Options, clap::Error> {
        parse_sim(words).map(|options| options.shared)
    }

    #[test]
    fn without_options_it_is_two_boards_at_50_us_from_5760_on_until_ctrl_c() {
        let sim = parse_sim(&[]).unwrap();
        let options = &sim.shared;
        assert_eq!((sim.boards(), options.variant()), (2, Variant::STANDARD));
        assert_eq!(options.qemu_boards(), 1);
        let ports = [0, 1].map(|index| options.mavlink_port_of(index));
        assert_eq!(ports, [5_760, 5_761]);
        assert_eq!(options.duration(), None);
    }

    #[test]
    fn a_recording_is_played_to_one_board_unless_more_are_asked_for() {
        assert_eq!(parse_sim(&["--ubx", "a.ubx"]).unwrap().boards(), 1);
        let three = parse_sim(&["--ubx", "a.ubx", "--boards", "3"]).unwrap();
        assert_eq!((three.boards(), three.shared.qemu_boards()), (3, 3));
    }

    #[test]
    fn an_old_word_is_refused_with_the_new_one() {
        for old in [&["--way", "paper-step1"][..], &["--way"]] {
            let error = parse(old).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{error}");
            assert!(error.to_string().contains("`--variant`"), "{error}");
        }
    }

    #[test]
    fn every_tick_that_can_be_built_is_taken_and_another_is_refused_with_the_list() {
        for tick in TICKS_US {
            let options = parse(&["--tick-us", &tick.to_string()]).unwrap();
            assert_eq!(options.variant(), Variant::Pixclock { tick_us: tick });
        }
        let error = parse(&["--tick-us", "100"]).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("1000, 500, 200, 50"), "{error}");
    }

    #[test]
    fn a_variant_of_the_papers_has_its_own_tick() {
        let options = parse(&["--variant", "paper-step2:200"]).unwrap();
        assert_eq!(options.variant(), Variant::PaperStep2 { tick_us: 200 });
        for wrong in [
            ["--variant", "paper-step2"].as_slice(),
            &["--variant", "paper-step1", "--tick-us", "1000"],
        ] {
            assert_eq!(parse(wrong).unwrap_err().exit_code(), 2, "{wrong:?}");
        }
    }

    #[test]
    fn a_start_is_a_moment_of_utc_and_no_other_text() {
        let options = parse(&["--start", "2026-11-22T04:00:00.5Z"]).unwrap();
        assert_eq!(options.start, Some(UtcNanos(1_795_320_000_500_000_000)));
        let shifted = parse(&["--start", "2026-11-22T05:00:00.5+01:00"]).unwrap();
        assert_eq!(shifted.start, options.start);
        for wrong in [
            "yesterday",
            "2026-11-22T04:00:00",
            "2026-13-01T00:00:00Z",
            "9000-01-01T00:00:00Z",
        ] {
            assert_eq!(
                parse(&["--start", wrong]).unwrap_err().exit_code(),
                2,
                "{wrong}"
            );
        }
    }

    #[test]
    fn a_floor_is_a_date_and_a_recordings() {
        let old = parse(&["--ubx", "a.ubx", "--floor", "2016-05-01"]).unwrap();
        assert_eq!(old.floor, Some(16_922));
        for wrong in [
            &["--floor", "2016-05-01"][..],
            &["--ubx", "a.ubx", "--floor", "1970-01-02"],
            &["--ubx", "a.ubx", "--floor", "May"],
        ] {
            assert_eq!(parse(wrong).unwrap_err().exit_code(), 2, "{wrong:?}");
        }
    }

    #[test]
    fn a_recording_has_its_own_time() {
        let both = parse(&["--ubx", "a.ubx", "--start", "2026-11-22T04:00:00Z"]);
        assert_eq!(both.unwrap_err().exit_code(), 2);
    }

    #[test]
    fn a_pulse_needs_a_receiver_that_makes_one_and_a_variant_that_follows_it() {
        assert!(parse_sim(&["--pulse", "--tick-us", "200"]).unwrap().pulse);
        for [option, value] in [["--ubx", "a.ubx"], ["--variant", "paper-step1"]] {
            let error = parse_sim(&["--pulse", option, value]).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{option}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        for wrong in [
            ["--boards", "0"],
            ["--boards", "17"],
            ["--duration", "0"],
            ["--mavlink-port", "80"],
            ["--mavlink-port", "70000"],
        ] {
            assert_eq!(parse(&wrong).unwrap_err().exit_code(), 2, "{wrong:?}");
        }
    }
}
