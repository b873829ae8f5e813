//! `status`: all that a running board says of itself, over MAVLink.
//!
//! *Purpose.* What a probe would read in the board's log each second: every word of the status line, the
//! counters that are not 0, the last fault and the stack's mark. From any link, once or each second.
//!
//! *Design.* The board sends it as a log's pieces ([`Client::status`]). What is lost on the way is asked
//! for anew, from the beginning. STATUSTEXTs that come meanwhile go to standard error.
//!
//! *Limits.* One board a line. The words are of moments that lie as far apart as their pieces, some ms.

use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use console::Status;
use mavlink_node::client::{Client, GROUND_STATION, Message, Received};
use mavlink_node::{Address as System, LOG_DATA_LEN, Parameter, Version};
use timebase::{Stamp, StampedByte};

use crate::ctrl_c;
use crate::link::{Address, Link};

/// How long a HEARTBEAT is waited for; it comes each second.
const HEARTBEAT: Duration = Duration::from_secs(5);
/// How long the next piece is waited for, and how often all of it is asked for.
const PIECE: Duration = Duration::from_secs(1);
const ASKED: u32 = 5;

/// What `status` is asked to do.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Where the board is: tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE, or serial:DEVICE:BAUD
    #[arg(value_name = "ADDR")]
    address: Address,
    /// Go on, with a line each second, until Ctrl-C
    #[arg(long)]
    every: bool,
    /// Print JSON: an object, or one a line with --every
    #[arg(long)]
    json: bool,
}

/// Asks, and prints.
///
/// # Errors
///
/// When the line cannot be opened, or no board answers there.
pub fn run(options: &Options) -> Result<()> {
    ctrl_c::catch()?;
    let mut board = Board::find(&options.address)?;
    let mut next = Instant::now();
    loop {
        let Some(status) = board.status()? else {
            return Ok(());
        };
        match (options.json, options.every) {
            (true, true) => console::print_line!("{}", status.to_json()),
            (true, false) => console::print_line!("{:#}", status.to_json()),
            (false, true) => console::print_line!("{}", on_one_line(&status)),
            (false, false) => console::print_text!("{}", in_columns(&status)),
        }
        if !options.every {
            return Ok(());
        }
        next = (next + Duration::from_secs(1)).max(Instant::now());
        while Instant::now() < next {
            board.receive()?;
            if ctrl_c::is_pressed() {
                return Ok(());
            }
        }
    }
}

/// As in the board's log.
fn on_one_line(status: &Status) -> String {
    let words = status.pairs().map(|(key, value)| format!("{key}={value}"));
    words.collect::<Vec<_>>().join(" ")
}

/// A word a line, the values below each other.
fn in_columns(status: &Status) -> String {
    let width = status.pairs().map(|(key, _)| key.len()).max().unwrap_or(0);
    let lines = status
        .pairs()
        .map(|(key, value)| format!("{key:width$}  {value}\n"));
    lines.collect()
}

/// A board on a line.
pub struct Board {
    link: Link,
    client: Client,
    system: System,
}

impl Board {
    /// The board that sends HEARTBEATs there.
    ///
    /// # Errors
    ///
    /// When the line cannot be opened, or none comes.
    pub fn find(address: &Address) -> Result<Self> {
        let mut board = Self {
            link: Link::open(address)?,
            client: Client::new(GROUND_STATION, Version::V2),
            system: GROUND_STATION,
        };
        // Datagrams come only from where one was sent to.
        let ping = board.client.ping(0, 0);
        board.link.send(&ping)?;
        let until = Instant::now() + HEARTBEAT;
        while Instant::now() < until {
            ctrl_c::check()?;
            let received = board.receive()?;
            let heartbeat = received.iter().find(|it| it.message == Message::Heartbeat);
            if let Some(heartbeat) = heartbeat {
                board.system = heartbeat.from;
                return Ok(board);
            }
        }
        bail!(
            "no HEARTBEAT comes from {address}: is the board on, and is the rate of the line right?"
        )
    }

    /// Asks for a parameter.
    ///
    /// # Errors
    ///
    /// When the line breaks.
    pub fn ask_parameter(&mut self, parameter: Parameter) -> Result<()> {
        let request = self.client.parameter(self.system, parameter);
        self.link.send(&request)
    }

    /// What it says of itself now; `None` if Ctrl-C came before it had.
    fn status(&mut self) -> Result<Option<Status>> {
        for _ in 0..ASKED {
            let request = self.client.status(self.system);
            self.link.send(&request)?;
            let mut text = Vec::new();
            let mut until = Instant::now() + PIECE;
            while Instant::now() < until {
                if ctrl_c::is_pressed() {
                    return Ok(None);
                }
                for piece in self.receive()? {
                    let Message::LogData {
                        id: Client::STATUS,
                        offset,
                        data,
                        count,
                    } = piece.message
                    else {
                        continue;
                    };
                    if piece.from != self.system || offset as usize != text.len() {
                        continue;
                    }
                    let count = usize::from(count).min(data.len());
                    text.extend(&data[..count]);
                    if count < LOG_DATA_LEN {
                        return parse(&text).map(Some);
                    }
                    until = Instant::now() + PIECE;
                }
            }
        }
        bail!(
            "system {} does not answer: is it pixclock, of this version or a later one?",
            self.system.system
        )
    }

    /// What has come by now; texts for people are printed.
    ///
    /// # Errors
    ///
    /// When the line breaks.
    pub fn receive(&mut self) -> Result<Vec<Received>> {
        let mut buffer = [0; 1_024];
        let bytes = self.link.receive(&mut buffer)?;
        let stamp = Stamp(0);
        let received: Vec<_> = bytes
            .iter()
            .filter_map(|&byte| self.client.push(StampedByte { stamp, byte }))
            .collect();
        for what in &received {
            if let Message::StatusText { severity, text } = what.message {
                console::print_error!("{} {}", severity_name(severity), text.as_str());
            }
        }
        Ok(received)
    }
}

fn parse(text: &[u8]) -> Result<Status> {
    let text = String::from_utf8_lossy(text);
    match Status::parse(&text) {
        Some(status) => Ok(status),
        None => bail!("what the board has sent is no status: {text}"),
    }
}

/// MAV_SEVERITY, as a log's levels.
const fn severity_name(severity: u8) -> &'static str {
    match severity {
        0..=3 => "error:",
        4 => "warning:",
        5 => "notice:",
        _ => "info:",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_is_shown_in_columns_or_on_a_line() {
        let status = parse(b"status state=set unc_ns=120 mav_unknown=4 ").unwrap();
        assert_eq!(
            in_columns(&status),
            "state        set\nunc_ns       120\nmav_unknown  4\n"
        );
        assert_eq!(on_one_line(&status), "state=set unc_ns=120 mav_unknown=4");
        assert!(parse(b"time_s,board_ns").is_err());
    }
}
