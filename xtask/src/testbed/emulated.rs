//! Two boards on QEMU, each with a simulated receiver.
//!
//! *Purpose.* Boards at the end of a line, without a board.
//!
//! *Design.* QEMU connects its USART2 to a port of ours, so that no port has to be
//! free, and its UART4 to the receiver, as for `cargo xtask qemu`.
//!
//! *Limits.* Both boards share this host's clock and its scheduling: no crystals, and
//! noise that is the host's.

use std::net::TcpListener;
use std::path::PathBuf;
use std::process::Stdio;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Instant, SystemTime};

use anyhow::Result;
use testbed::Options;
use world::ReceiverSettings;

use super::board::Connected;
use crate::link::Link;
use crate::qemu::machine;
use crate::qemu::player::Player;

/// Has `test` done on a board for each of `images`.
///
/// # Errors
///
/// Those of `test`; or QEMU cannot be started.
pub fn with_boards<T>(
    options: &Options,
    seed: u64,
    images: &[PathBuf],
    test: impl FnOnce(Vec<Connected>) -> Result<T>,
) -> Result<T> {
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        let mut boards = Vec::new();
        let mut running = Vec::new();
        let mut start = || -> Result<()> {
            for (index, image) in images.iter().enumerate() {
                let port = TcpListener::bind("127.0.0.1:0")?;
                let mavlink = format!("tcp:{}", port.local_addr()?);
                let mut command = machine::command(image);
                let (qemu, gps) = machine::power_on(command.stdout(Stdio::null()), &mavlink)?;
                running.push(qemu);
                let (line, _) = port.accept()?;
                let name = format!("board {}", index + 1);
                boards.push(Connected::new(name, Link::over(line)?)?);
                let settings = receiver(options, seed, index)?;
                let started = Instant::now();
                let is_over = || is_over.load(Ordering::Relaxed);
                // A QEMU that ends by itself is a board that falls silent.
                scope.spawn(move || Player::receiver(settings).play(gps, started, is_over));
            }
            Ok(())
        };
        let done = start().and_then(|()| test(boards));
        is_over.store(true, Ordering::Relaxed);
        done
    })
}

fn receiver(options: &Options, seed: u64, index: usize) -> Result<ReceiverSettings> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
    Ok(ReceiverSettings {
        // As far apart as seeds of neighbouring tests are not.
        seed: seed << 8 | index as u64,
        latency: options.first_receivers().latency(),
        ..ReceiverSettings::new(i64::try_from(now.as_nanos())?)
    })
}
