//! Baselines: other projects' published filters, on the same arrivals as our clock.
//!
//! *Purpose.* The figures to compare with: each filter takes the arrival and the epoch of a
//! message, and gives the time that it would publish.
//!
//! *Design.* One file a filter, after the source that it names; the constants are theirs, the lines
//! are ours. They count in a board's nominal time: its counter, divided by its nominal rate.
//!
//! *Limits.* The filters alone. Polling loops, priorities and late stamps, which cost some of them
//! more than their filter does, are left out, in their favour.

mod ardupilot;
mod baseline;
mod chrony;
mod paper;
mod px4;

pub use ardupilot::ArduPilot;
pub use baseline::Baseline;
pub use chrony::Chrony;
pub use paper::Paper;
pub use px4::Px4;

/// Makes a baseline that is unset.
type Make = fn() -> Box<dyn Baseline>;

/// The name of each and how it is made, in the order of the tables.
const ALL: [(&str, Make); 4] = [
    ("paper", || Box::new(Paper::default())),
    ("ardupilot", || Box::new(ArduPilot::default())),
    ("px4", || Box::new(Px4::default())),
    ("chrony", || Box::new(Chrony::default())),
];

/// One of each, in the order of `names`, all unset.
#[must_use]
pub fn all() -> Vec<Box<dyn Baseline>> {
    ALL.iter().map(|(_, make)| make()).collect()
}

/// The names of all candidates in the order of the tables: our clock, then the baselines.
pub fn candidates() -> impl Iterator<Item = &'static str> {
    ["ours"].into_iter().chain(ALL.map(|(name, _)| name))
}
