//! The paper's experiment, on boards of any kind.
//!
//! *Purpose.* Shim, Joo and Kim (2021) sent PINGs to two flight controllers at once and
//! looked how far their times were apart. Here is what that takes beside the boards:
//! which [`Method`]s there are, when to ask ([`Schedule`]), what was asked and answered
//! ([`Conversation`]), which answers belong together, the statistics, and the files and
//! the page with the results.
//!
//! *Design.* Nothing here does I/O with a board or knows the time: the program that runs
//! virtual boards and the verb that talks to real ones feed it alike.
//!
//! *Limits.* A difference is seen through PINGs, whose moment an interrupt stamps. Answers
//! have whole µs; the boards' own logs, where they are at hand, have ns.

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod boards;
pub mod bounds;
mod captured;
mod case;
mod conversation;
mod ending;
mod files;
mod latency;
mod link;
mod links;
mod method;
mod options;
mod own_log;
mod pairing;
mod plot;
pub mod progress;
mod record;
mod report;
mod run;
mod schedule;
mod statistics;
mod units;

pub use boards::{Boards, Crystals, Receivers};
pub use captured::{Burst, Captured};
pub use case::Case;
pub use conversation::{Conversation, SILENCE_NS};
pub use ending::{Results, text};
pub use files::{Folder, summary};
pub use latency::{Latency, beyond_telem1, latencies};
pub use link::Link;
pub use method::Method;
pub use options::Options;
pub use own_log::OwnLog;
pub use pairing::{Difference, differences, discard_late};
pub use record::{Anomaly, Record, Sample, Verdict};
pub use run::{Experiment, Place, Run};
pub use schedule::Schedule;
pub use statistics::{Estimate, Spread};
