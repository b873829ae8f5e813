//! Files that are there as a whole or not at all.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};

/// Makes a file of these bytes. If they do not fit on the disk nothing of it stays behind.
///
/// # Errors
///
/// When it cannot be written; the message names it.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes)
        .inspect_err(|_| clear_away(path))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Takes away what was begun; a device, which is no file of ours, stays.
fn clear_away(path: &Path) {
    let is_ours = fs::symlink_metadata(path).is_ok_and(|it| it.is_file() || it.is_symlink());
    if is_ours {
        // The reason that matters is the one why it could not be written.
        let _ = fs::remove_file(path);
    }
}
