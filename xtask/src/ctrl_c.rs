//! Ctrl-C ends what runs with the results that there are.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Result, bail};

static PRESSED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C no longer ends the program: it is noted.
///
/// # Errors
///
/// When the system does not allow that.
pub fn catch() -> Result<()> {
    Ok(ctrlc::set_handler(|| {
        PRESSED.store(true, Ordering::Relaxed);
    })?)
}

/// Whether what runs is to end.
pub fn is_pressed() -> bool {
    PRESSED.load(Ordering::Relaxed)
}

/// Whether a test may still begin.
///
/// # Errors
///
/// When Ctrl-C was pressed.
pub fn check() -> Result<()> {
    if is_pressed() {
        bail!("stopped by Ctrl-C before the test had begun");
    }
    Ok(())
}
