//! What others make of the same arrivals: their published filters, short.
//!
//! *Purpose.* The figures to be compared with: each filter hears when a message
//! arrived and which epoch it told, and says what time it would publish.
//!
//! *Design.* One file a filter, after the source that it names; the constants are
//! theirs, the lines are ours. They count in a board's nominal time: what its
//! counter says, divided by its nominal rate.
//!
//! *Limits.* The filters alone. Polling loops, priorities and late stamps, which
//! cost some of them more than their filter does, are left out, in their favour.

mod ardupilot;
mod chrony;
mod paper;
mod px4;

pub use ardupilot::ArduPilot;
pub use chrony::Chrony;
pub use paper::Paper;
pub use px4::Px4;

/// A clock that follows the arrivals of time messages.
pub trait Other {
    /// Hears that the first byte of the message that tells `epoch_utc_ns` (UTC
    /// since 1970) arrived at `local_ns` of the board's nominal time. Calls come
    /// in the order of the arrivals.
    fn handle_mark(&mut self, local_ns: i64, epoch_utc_ns: i64);

    /// What it publishes at `local_ns`, in ns of UTC since 1970; nothing as long
    /// as it is unset. Never asked about a time before the last message.
    fn utc_ns(&self, local_ns: i64) -> Option<i64>;
}

/// Makes a clock that is unset.
pub type Make = fn() -> Box<dyn Other + Send>;

/// The name of each and how it is made, in the order of the tables.
pub const ALL: [(&str, Make); 4] = [
    ("paper", || Box::new(Paper::default())),
    ("ardupilot", || Box::new(ArduPilot::default())),
    ("px4", || Box::new(Px4::default())),
    ("chrony", || Box::new(Chrony::default())),
];
