//! How far a long run has come.
//!
//! *Purpose.* One bar for every method of running the experiment.
//!
//! *Design.* Shown where standard error is a terminal; nothing is printed otherwise, so
//! that logs stay short.
//!
//! *Limits.* It counts seconds of the boards' time, not of ours.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar of `seconds`, of which none has passed.
#[must_use]
pub fn bar(seconds: u64) -> ProgressBar {
    let bar = ProgressBar::new(seconds);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} s {msg} ({eta} to go)");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}
