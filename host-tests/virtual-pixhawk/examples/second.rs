//! The paper's figure 2, of what a virtual board captures: `second IMAGE OUT.svg`.
//!
//! *Purpose.* When the receiver's pulse and the bytes of its messages reach the board, over two seconds.
//!
//! *Design.* The board runs in steps of half a millisecond under the meter, which counts the interrupts of the
//! pulse's timer, one an edge, and of the GPS line, one a byte.
//!
//! Steps begin between the moments at which edges come, because one that comes just where a step ends is not counted.
//!
//! *Limits.* A moment is good to half a step. The level is taken to be low at the start, which is 100 ms before a second.

use std::path::PathBuf;

use anyhow::Context as _;
use testbed::{Burst, Captured};
use virtual_pixhawk::{Builder, Firmware};
use world::{Receiver, ReceiverSettings, WorldNanos};

/// A millisecond. \[ns\]
const MS: u64 = 1_000_000;
const STEP: u64 = MS / 2;
/// 2026-11-22T04:00:00Z, a whole second: UTC when the board gets power. \[ns\]
const START_UTC_NS: i64 = 1_795_320_000 * 1_000_000_000;
/// By then the receiver is configured and locked, and its pulse as wide as asked for. \[ms\]
const BEGINS_MS: u64 = 30_000;
/// What is drawn before that second and after it. \[ms\]
const DRAWN_MS: (u64, u64) = (100, 2_100);
/// TIM4 and UART4 in the vector table (RM0090, table 62): 16 and the interrupt's number.
const PULSE: u16 = 16 + 30;
const GPS: u16 = 16 + 52;

fn main() -> anyhow::Result<()> {
    let mut paths = std::env::args_os().skip(1).map(PathBuf::from);
    let usage = "usage: second IMAGE OUT.svg";
    let (image, out) = (paths.next().context(usage)?, paths.next().context(usage)?);
    let receiver = Receiver::new(ReceiverSettings::new(START_UTC_NS));
    let mut board = Builder::new(Firmware::read(&image)?)
        .gps_and_pulse(receiver)
        .power_on()?;
    let (before, after) = DRAWN_MS;
    board.run_to(WorldNanos((BEGINS_MS - before) * MS - STEP / 2))?;
    let mut captured = Captured::default();
    while board.now().0 < (BEGINS_MS + after) * MS {
        let middle = board.now().0 + STEP / 2;
        let at_ms = middle as f64 / MS as f64 - BEGINS_MS as f64;
        board.start_meter(&[])?;
        board.run_for(STEP)?;
        let exceptions = board.stop_meter().exceptions;
        let times = |number| exceptions.get(number).map_or(0, |tally| tally.times);
        let edges = (0..times(&PULSE)).map(|_| at_ms);
        captured.edges_ms.extend(edges);
        captured.bytes.push(Burst {
            at_ms,
            bytes: times(&GPS),
        });
    }
    std::fs::write(&out, captured.svg()?).with_context(|| out.display().to_string())
}
