//! A Pixhawk 1 in the process: runs the image that is flashed.
//!
//! *Purpose.* Precision is measured here: the pixhawk1 image, bit for bit, on an
//! emulated STM32F427 whose time is known to the nanosecond from outside.
//!
//! *Design.* `rigless` emulates the part; this crate is the one place that knows it. A [`Builder`]
//! takes the [`Firmware`], the crystal's error and a [`Talker`](world::Talker) for each connector:
//! a simulated receiver or a recording, a [`Script`] or a [`TcpLine`]; and the pulse that belongs
//! to the receiver; and a [`Card`] in the slot. A [`Pixhawk`] is brought from moment to moment. Its
//! log, its statics and what it has sent are read where it stands, and a meter counts what it
//! executes. [`Gaps`] has what the emulator does not model: a run without gaps can be believed.
//!
//! An [`UploadBootloader`] makes the flash one that the board itself can program.
//!
//! *Limits.* Each instruction takes the same time, one cycle unless [`CyclesPerInstruction`]
//! says otherwise: no wait states, no time for entering an exception. A UART's words take the
//! board's own ten bit times. Hardware flow control has no model. The crystal
//! does not wander during a run.

mod board;
mod bootloader;
mod card;
mod clock;
mod crystal;
mod flash;
mod flash_array;
mod gaps;
mod image;
mod led;
mod meter;
mod operator;
mod probe;
mod provoke;
mod pulse_wire;
mod rtt;
mod run;
mod script;
mod sections;
mod stanag;
mod stepping;
mod tally;
mod tcp;
mod upload_bootloader;
mod usb;
mod waveform;
mod wire;

pub use board::CyclesPerInstruction;
pub use bootloader::Bootloader;
pub use card::{Card, Fault, Transfer};
pub use clock::ClockReading;
pub use crystal::CrystalStart;
pub use gaps::Gaps;
pub use image::{Firmware, IMAGE_VARIABLE, Symbol};
pub use meter::Profile;
pub use operator::Logged;
pub use probe::CoreRegister;
pub use run::{Builder, Connector, PACE_VARIABLE, Pixhawk};
pub use script::Script;
pub use stanag::StanagLine;
pub use tally::Tally;
pub use tcp::{TcpLine, Visits};
pub use upload_bootloader::UploadBootloader;
pub use usb::{Host, Transfer as ControlTransfer};
pub use wire::ReceivedByte;
