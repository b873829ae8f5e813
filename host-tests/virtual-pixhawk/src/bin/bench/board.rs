//! The board that is measured, with what is connected to it.

use mavlink_node::Address;
use virtual_pixhawk::{Builder, CyclesPerInstruction, Firmware, Profile};
use world::{Port, Receiver, ReceiverSettings, Talker, WorldNanos};

/// The speed of both lines.
pub const BAUD: u32 = 115_200;
/// A millisecond. \[ns\]
pub const MS: u64 = 1_000_000;
/// A second. \[ns\]
pub const SECOND: u64 = 1_000 * MS;
/// The address of the client, a ground station.
pub const HOST: Address = Address {
    system: 255,
    component: 190,
};
/// 2026-11-22T04:00:00Z.
const START_UTC_NS: i64 = 1_795_320_000 * 1_000_000_000;

/// What is measured: an image, and the pace of the core that runs it.
pub struct Subject {
    /// The image.
    pub firmware: Firmware,
    /// The pace.
    pub pace: CyclesPerInstruction,
}

impl Subject {
    /// A board of it.
    pub fn board(&self) -> Builder {
        Builder::new(self.firmware.clone()).pace(self.pace)
    }
}

/// A receiver that needs no configuration.
fn receiver_settings() -> ReceiverSettings {
    let mut settings = ReceiverSettings::new(START_UTC_NS);
    settings.port = Port::CONFIGURED;
    settings
}

/// That receiver.
pub fn receiver() -> Receiver {
    Receiver::new(receiver_settings())
}

/// Runs a board and meters the time from `from_ns` to `to_ns`, with calls of `functions` watched.
pub fn metered(
    subject: &Subject,
    gps: impl Talker + Send + 'static,
    telem1: impl Talker + Send + 'static,
    (from_ns, to_ns): (u64, u64),
    functions: &[&str],
) -> anyhow::Result<Profile> {
    let mut board = subject.board().gps(gps).telem1(telem1).power_on()?;
    board.run_to(WorldNanos(from_ns))?;
    board.start_meter(functions)?;
    board.run_to(WorldNanos(to_ns))?;
    Ok(board.stop_meter())
}

/// Instructions that a board executes from `from_ns` to `to_ns`.
pub fn executed(
    subject: &Subject,
    gps: impl Talker + Send + 'static,
    telem1: impl Talker + Send + 'static,
    window: (u64, u64),
) -> anyhow::Result<f64> {
    executed_by(subject.board().gps(gps).telem1(telem1), window)
}

/// The same, of a board with all that is connected to it.
pub fn executed_by(board: Builder, (from_ns, to_ns): (u64, u64)) -> anyhow::Result<f64> {
    let mut board = board.power_on()?;
    board.run_to(WorldNanos(from_ns))?;
    let before = board.instructions()?;
    board.run_to(WorldNanos(to_ns))?;
    Ok((board.instructions()? - before) as f64)
}
