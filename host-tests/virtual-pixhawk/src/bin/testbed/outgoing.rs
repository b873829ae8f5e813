//! What the laptop sends to a board.

use mavlink_node::client::{Client, GROUND_STATION};
use mavlink_node::{Address, Frame, Parameter, Test, Version};
use testbed::Schedule;
use world::{Transmission, WorldNanos};

/// A second. \[ns\]
const SECOND: u64 = 1_000_000_000;
/// The speed of the laptop's line: off by less than a USB adapter's, and slower than the
/// board's own 115 068, so that the emulated port, which takes ten of its own bit times for a
/// word, is free when the next one begins. \[Bd\]
const BAUD: u32 = 115_000;
/// From the command that a test begins to the first PING, and from the last one to the command
/// that it ends. \[ns\]
const ASIDE_NS: u64 = SECOND / 2;
/// A board, as it is flashed.
const BOARD: Address = Address {
    system: 1,
    component: 1,
};

/// All of it: the commands that the test begins and ends, and the PINGs between.
pub fn all(schedule: Schedule, begins: u64) -> Vec<Transmission> {
    let mut client = Client::new(GROUND_STATION, Version::V2);
    let leaves = |start: u64, frame: Frame| Transmission {
        start: WorldNanos(start),
        bytes: frame.to_vec(),
        baud: BAUD,
    };
    let ends = begins + u64::from(schedule.duration_s) * SECOND;
    let mut all = vec![leaves(begins - ASIDE_NS, client.test(BOARD, Test::Begins))];
    all.extend(pings(schedule, begins));
    all.push(leaves(ends + ASIDE_NS, client.test(BOARD, Test::Ends)));
    let log_missed = client.parameter(BOARD, Parameter::LogMissed);
    all.push(leaves(ends + 2 * ASIDE_NS, log_missed));
    all
}

/// The PINGs of a test that begins at `begins`, ns after the board's power. Those that the line
/// has no room for until the test's end are not sent.
pub fn pings(schedule: Schedule, begins: u64) -> Vec<Transmission> {
    let mut client = Client::new(GROUND_STATION, Version::V2);
    let mut free = WorldNanos(0);
    let ends = begins + u64::from(schedule.duration_s) * SECOND;
    let pings = schedule.pings().map(|(sequence, at)| {
        let transmission = Transmission {
            start: WorldNanos(begins + at).max(free),
            bytes: client.ping(at / 1_000, sequence).to_vec(),
            baud: BAUD,
        };
        free = transmission.end();
        transmission
    });
    pings.take_while(|ping| ping.start.0 < ends).collect()
}
