//! The one writer to standard output and standard error.
//!
//! *Purpose.* Every verb prints by [`print_line!`](crate::print_line), and what becomes of output that
//! nobody takes is decided here: a closed pipe ends the program quietly, a full disk with one sentence.
//! What is said by [`print_error!`](crate::print_error) is said if there is somebody to say it to.
//!
//! *Design.* Colours are for a terminal, and are left out elsewhere. Who has something to clear away
//! says so by [`ends_by_itself`]; it then asks [`is_output_gone`] where it looks for Ctrl-C.
//!
//! *Limits.* What ends in that way ends with exit code 1: its result has not been printed.

use std::fmt;
use std::io::{self, ErrorKind, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};

static IS_GONE: AtomicBool = AtomicBool::new(false);
static ENDS_BY_ITSELF: AtomicBool = AtomicBool::new(false);

/// Prints a line, as `println!` does, by the one [writer](crate::write_line).
#[macro_export]
macro_rules! print_line {
    () => { $crate::write_line(format_args!("")) };
    ($($line:tt)*) => { $crate::write_line(format_args!($($line)*)) };
}

/// Prints a text without a new line after it, as `print!` does, by the one [writer](crate::write_text).
#[macro_export]
macro_rules! print_text {
    ($($text:tt)*) => { $crate::write_text(format_args!($($text)*)) };
}

/// Prints a line to standard error, as `eprintln!` does, but without a panic if nobody takes it.
#[macro_export]
macro_rules! print_error {
    ($($line:tt)*) => { $crate::write_error(format_args!($($line)*)) };
}

/// Writes a line, or ends the program if nobody takes it.
pub fn write_line(line: fmt::Arguments<'_>) {
    write(|out| writeln!(out, "{line}"));
}

/// Writes a text, or ends the program if nobody takes it.
pub fn write_text(text: fmt::Arguments<'_>) {
    write(|out| write!(out, "{text}"));
}

/// Writes bytes, all in one piece, or ends the program if nobody takes them.
pub fn write_bytes(bytes: &[u8]) {
    write(|out| out.write_all(bytes));
}

fn write(act: impl FnOnce(&mut dyn io::Write) -> io::Result<()>) {
    if is_output_gone() {
        return;
    }
    let mut out = anstream::stdout().lock();
    let Err(error) = act(&mut out).and_then(|()| out.flush()) else {
        return;
    };
    if error.kind() != ErrorKind::BrokenPipe {
        crate::print_error!("error: cannot write the output: {error}");
    }
    IS_GONE.store(true, Ordering::Relaxed);
    if !ENDS_BY_ITSELF.load(Ordering::Relaxed) {
        std::process::exit(1);
    }
}

/// Writes a line to standard error if it can be written, and nothing once [`is_output_gone`].
pub fn write_error(line: fmt::Arguments<'_>) {
    if is_output_gone() {
        return;
    }
    // There is nowhere to say that there is nowhere to say it.
    let _ = writeln!(anstream::stderr().lock(), "{line}");
}

/// From now on the program is not ended here: it looks at [`is_output_gone`] and ends by itself.
pub fn ends_by_itself() {
    ENDS_BY_ITSELF.store(true, Ordering::Relaxed);
}

/// Whether a line could not be written: nobody sees what follows.
#[must_use]
pub fn is_output_gone() -> bool {
    IS_GONE.load(Ordering::Relaxed)
}
