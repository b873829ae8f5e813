//! The board: what differs from one circuit board to another.
//!
//! *Design.* Constants and clocks only: nothing here knows a driver. Exactly one board is in an image;
//! its file says what its processor's clocks are, how its two counters compare, and how much memory
//! it can spare. Pins, UARTs and timers are those of the Pixhawk 1 on every board (PX4
//! `boards/px4/fmu-v2`, ArduPilot `hwdef/fmuv3`): [`bring_up`](crate::bring_up) and the drivers
//! name them. `docs/adding-a-board.md` says what another board needs.

#[cfg_attr(feature = "pixhawk1", path = "pixhawk1.rs")]
#[cfg_attr(feature = "qemu", path = "qemu.rs")]
mod this;

mod crystal;

pub use crystal::CrystalStart;

pub use this::{
    HAS_CARD_SLOT, HAS_CONSTANT_CLOCKS, HAS_USB, NAME, SAMPLE_ROOM, WITNESS_PRESCALER,
    WITNESS_RATIO, apb1_khz, clocks, read_pair, silicon, take_crystal_failure, take_over,
    unique_id, witness_khz,
};
