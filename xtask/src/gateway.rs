//! `gateway`: a board's line that speaks STANAG 4586, in a group of datagrams.
//!
//! *Design.* Frames of the line become datagrams, datagrams that divide into whole frames go on the line
//! ([`stanag_net::relay`]). Nothing is answered here: the board does that.
//!
//! *Limits.* One board a gateway. What the group sends faster than the line carries is delayed by the
//! system's own buffers.

use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use anyhow::{Result, bail};
use stanag_net::relay::{self, FromLine};
use stanag_net::{Group, Place};

use crate::ctrl_c;
use crate::link::{Address, Link};

/// What `gateway` is asked to do.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// The board's line: serial:DEVICE or serial:DEVICE:BAUD
    #[arg(value_name = "serial:DEVICE")]
    line: Address,
    /// Where the group meets
    #[arg(value_name = "GROUP:PORT", default_value_t = Place::default())]
    place: Place,
}

/// Runs until Ctrl-C.
///
/// # Errors
///
/// When the line or the group cannot be opened, or breaks.
pub fn run(options: &Options) -> Result<()> {
    ctrl_c::catch()?;
    let mut group = Group::node(options.place)?;
    group.set_patience(Some(Duration::from_millis(2)))?;
    let mut line = Link::open(&options.line)?;
    let mut incoming = line.another()?;
    console::print_line!("{} is in the group {}", options.line, options.place);
    let (sender, frames) = channel();
    let reader = thread::spawn(move || -> Result<()> {
        let (mut frames, mut buffer) = (FromLine::default(), [0; 1_024]);
        while !ctrl_c::is_pressed() {
            for frame in frames.push(incoming.receive(&mut buffer)?) {
                if sender.send(frame).is_err() {
                    return Ok(());
                }
            }
        }
        Ok(())
    });
    let (mut refused, mut buffer) = (0_u64, [0; 2_048]);
    while !ctrl_c::is_pressed() && !reader.is_finished() {
        if let Some(datagram) = group.receive(&mut buffer)? {
            match relay::for_line(datagram) {
                Ok(bytes) => line.send(&bytes)?,
                Err(_) => refused += 1,
            }
        }
        frames
            .try_iter()
            .for_each(|frame: Vec<u8>| group.send(&frame));
    }
    console::print_line!("{refused} datagrams were no whole frames, and stayed out");
    drop(frames);
    match reader.join() {
        Ok(ended) => ended,
        Err(_) => bail!("the thread that reads the line panicked"),
    }
}
