//! What a person sees of a running board: its log decoded, a status line a second.
//!
//! *Purpose.* The part of `sim` and `qemu` that does not care which emulator runs
//! the board: the options they share, the firmware's log, the status line and the
//! summary at the end.
//!
//! *Design.* [`Options`] is parsed here, so that whoever builds the image and
//! whoever runs it read the same words.
//! [`LogDecoder`] turns bytes into [`LogLine`]s; a line that begins with `status ` is a
//! [`Status`]; [`Screen`] prints, and keeps what the summary needs.
//!
//! *Limits.* Nothing here starts, stops or paces anything.

mod log;
mod options;
mod screen;
mod status;

pub use log::{Level, LogDecoder, LogLine};
pub use options::{DEFAULT_MAVLINK_PORT, MAX_BOARDS, Options, SimOptions, UtcNanos};
pub use screen::{Screen, Verdict};
pub use status::Status;
