//! What `ping` is asked to do.

use std::str::FromStr;

use super::target::Target;
use crate::link::Address;

/// What `ping` is asked to do.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Where the nodes are: tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE, or serial:DEVICE:BAUD; or all of them
    /// stanag:GROUP:PORT/ID, where without an id it is listed who is there
    #[arg(value_name = "ADDR", required = true)]
    pub(super) places: Vec<NodePlace>,
    /// Over STANAG 4586: by heartbeats that are acknowledged, to the ms, as any node of it can
    #[arg(long)]
    pub(super) plain: bool,
    /// How many requests
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) count: u32,
    /// From one request to the next, in ms
    #[arg(long, value_name = "MS", default_value_t = 500, value_parser = clap::value_parser!(u64).range(1..=3_600_000))]
    pub(super) interval: u64,
    /// How long an answer may take, in ms
    #[arg(long, value_name = "MS", default_value_t = 1_000, value_parser = clap::value_parser!(u64).range(1..=3_600_000))]
    pub(super) timeout: u64,
    /// The version of MAVLink that is spoken, 1 or 2
    #[arg(long, value_name = "1|2", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    pub(super) mavlink: u8,
    /// The rate of the serial line behind a TCP or UDP address, in Bd: the bytes' own time at this
    /// rate is taken off what is uncertain. An emulator keeps no rate in this host's time
    #[arg(long, value_name = "BD", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) line_baud: Option<u32>,
    /// Print one JSON object at the end instead of lines
    #[arg(long)]
    pub(super) json: bool,
}

/// Where a node is, and so what it speaks.
#[derive(Clone, Debug)]
pub(super) enum NodePlace {
    Mavlink(Address),
    Stanag(Target),
}

impl FromStr for NodePlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("stanag:") {
            Some(target) => target.parse().map(Self::Stanag),
            None => text.parse().map(Self::Mavlink),
        }
    }
}
