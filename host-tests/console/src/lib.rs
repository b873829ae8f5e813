//! What a person sees of running boards: a row of figures a second, and what happens, in words.
//!
//! *Purpose.* The part of `sim` and `qemu` that does not depend on which emulator runs the boards:
//! the options they share, the firmware's log, the screen and the summary.
//!
//! *Design.* [`Options`] is parsed here, because one program builds the image and another runs it.
//! [`LogDecoder`] turns bytes into [`LogLine`]s; a line that begins with `status ` is a [`Status`].
//! [`Screen`] takes lines, [`Event`]s and [`Sample`]s of all boards and makes the lines to print,
//! and in the end the summary.
//!
//! *Limits.* Nothing here starts, stops or paces anything.

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod board;
mod event;
mod file;
mod image;
mod log;
mod options;
mod output;
mod row;
mod sample;
mod screen;
mod status;
mod summary;
pub mod units;
mod writer;

pub use event::Event;
pub use file::write_file;
pub use image::{
    Word, flash_bytes, for_recording, patched, read_recording, with_word, word_address,
};
pub use log::{Level, LogDecoder, LogLine};
pub use options::{DEFAULT_MAVLINK_PORT, MAX_BOARDS, Options, SimOptions, UtcNanos, renamed};
pub use output::{Report, print_summary, show};
pub use sample::Sample;
pub use screen::{Contents, Screen, Verdict};
pub use status::Status;
pub use summary::Ending;
pub use writer::{
    ends_by_itself, is_output_gone, write_bytes, write_error, write_line, write_text,
};
