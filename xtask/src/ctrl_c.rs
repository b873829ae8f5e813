//! Ctrl-C ends what runs with the results that there are; so does a terminal that is closed, and output
//! that nobody takes any more.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Result, bail};

static PRESSED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C no longer ends the program: it is noted.
///
/// # Errors
///
/// When the system does not allow that.
pub fn catch() -> Result<()> {
    console::ends_by_itself();
    Ok(ctrlc::set_handler(|| {
        PRESSED.store(true, Ordering::Relaxed);
    })?)
}

/// Whether what runs is to end.
pub fn is_pressed() -> bool {
    PRESSED.load(Ordering::Relaxed) || console::is_output_gone()
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
