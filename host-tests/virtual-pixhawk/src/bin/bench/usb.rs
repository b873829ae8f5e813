//! What a byte over USB costs.

use anyhow::Context as _;
use mavlink_node::client::Client;
use mavlink_node::{Address, Version};
use virtual_pixhawk::{Host, Pixhawk, Script, Tally};
use world::{Transmission, WorldNanos};

use crate::board::{BAUD, HOST, MS, SECOND, Subject};
use crate::table::Row;

/// A stretch of time: from, to. \[ns\]
type Window = (u64, u64);

/// When the port is open, and nothing is on it but what is sent each second.
const BEGIN: u64 = 2 * SECOND + 10 * MS;
const WINDOW: Window = (BEGIN, BEGIN + 500 * MS);
/// What is sent to the board, in full packets.
const BYTES: usize = 100 * 64;
/// PINGs whose samples are read, 1 ms apart.
const PINGS: u32 = 400;
const BOARD: Address = Address {
    system: 1,
    component: 1,
};

/// A board at the beginning of `window`, whose program at the port sends `script`.
fn board(subject: &Subject, script: Script, window: Window) -> anyhow::Result<Pixhawk> {
    let host = Host::new(script);
    let mut board = subject.board().usb(host).power_on()?;
    board.run_to(WorldNanos(window.0))?;
    Ok(board)
}

/// Instructions that a board executes in `window`, whose program at the port sends `script`.
pub fn executed(subject: &Subject, script: Script, window: Window) -> anyhow::Result<f64> {
    let mut board = board(subject, script, window)?;
    let before = board.instructions()?;
    board.run_to(WorldNanos(window.1))?;
    Ok((board.instructions()? - before) as f64)
}

/// The same for one function with all that it calls, and the bytes that the board has sent.
fn of_function(
    subject: &Subject,
    script: Script,
    function: &str,
) -> anyhow::Result<(Tally, usize)> {
    let mut board = board(subject, script, WINDOW)?;
    board.with_usb(Host::take_received)?;
    board.start_meter(&[function])?;
    board.run_to(WorldNanos(WINDOW.1))?;
    let profile = board.stop_meter();
    let tally = profile.functions.get(function).copied();
    let received = board.with_usb(Host::take_received)?;
    Ok((tally.unwrap_or_default(), received.len()))
}

/// A byte to the board and one from it, with every interrupt, wake-up and poll, but without the search for frames and
/// without what makes them.
pub fn bytes(subject: &Subject) -> anyhow::Result<[Row; 2]> {
    Ok([to_board(subject)?, from_board(subject)?])
}

fn to_board(subject: &Subject) -> anyhow::Result<Row> {
    const SEARCH: &str = "node::Node>::push_packet";
    let zeros = || {
        Script::new([Transmission {
            start: WorldNanos(BEGIN),
            bytes: vec![0; BYTES],
            baud: BAUD,
        }])
    };
    let silence = executed(subject, Script::default(), WINDOW)?;
    let all = executed(subject, zeros(), WINDOW)?;
    let (search, _) = of_function(subject, zeros(), SEARCH)?;
    anyhow::ensure!(
        search.times as usize == BYTES / 64,
        "the board has not taken all bytes"
    );
    let cost = (all - silence - search.instructions as f64) / BYTES as f64;
    Ok(Row::new(
        "a byte to the board over USB, in full packets",
        cost,
        9.0,
        "usb-device 15",
    ))
}

fn from_board(subject: &Subject) -> anyhow::Result<Row> {
    const MAKES: &str = "node::Node>::poll";
    let mut client = Client::new(HOST, Version::V2);
    let mut requests: Vec<_> = (0..PINGS)
        .map(|n| Transmission {
            start: WorldNanos(SECOND + u64::from(n) * MS),
            bytes: client.ping(u64::from(n), n).to_vec(),
            baud: BAUD,
        })
        .collect();
    let without = Script::new(requests.clone());
    requests.push(Transmission {
        start: WorldNanos(BEGIN),
        bytes: client.log_data(BOARD, 0, u32::MAX).to_vec(),
        baud: BAUD,
    });
    let with = || Script::new(requests.clone());
    let silence = executed(subject, without.clone(), WINDOW)?;
    let all = executed(subject, with(), WINDOW)?;
    let (none, others) = of_function(subject, without, MAKES)?;
    let (made, sent) = of_function(subject, with(), MAKES)?;
    let sent = sent
        .checked_sub(others)
        .filter(|&bytes| bytes > PINGS as usize * 40)
        .context("the board has not sent its log")?;
    let makes = (made.instructions - none.instructions) as f64;
    let cost = (all - silence - makes) / sent as f64;
    Ok(Row::new(
        "a byte from the board over USB, of a log",
        cost,
        5.0,
        "usb-device 10",
    ))
}
