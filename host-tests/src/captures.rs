//! The recordings of real receivers, which are other people's and lie beside the project.
//!
//! *Purpose.* [`folder`] and [`file()`] find them; without a folder a test is skipped, with a
//! message.
//!
//! *Design.* The message goes to standard error past the test harness, which hides the output of
//! a test that passes.
//!
//! *Limits.* For tests: a file that is missing in the folder is a panic.

use std::io::{self, Write as _};
use std::path::PathBuf;

/// Names the folder.
const VARIABLE: &str = "PIXCLOCK_CAPTURES";

/// The folder; none, and a message, if the variable is not set.
#[must_use]
pub fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os(VARIABLE).map(PathBuf::from);
    if folder.is_none() {
        let test = std::thread::current();
        let test = test.name().unwrap_or("a test");
        let _ = writeln!(
            io::stderr(),
            "SKIPPED: {test}: {VARIABLE} does not name the folder of recordings"
        );
    }
    folder
}

/// What is in the file `name` below the folder, if that is named.
///
/// # Panics
///
/// When the folder has no such file.
#[must_use]
pub fn file(name: &str) -> Option<Vec<u8>> {
    let path = folder()?.join(name);
    Some(std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}
