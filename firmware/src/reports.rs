//! What the tasks and the card have counted, for the status line.
//!
//! | report | written by | read by | when full |
//! |---|---|---|---|
//! | [`GNSS`] | the GNSS task, each second | the status line and the MAVLink task, each second | the new report replaces the old |
//! | [`MAVLINK`] | the MAVLink task, each second | the status line | the same |
//! | `STANAG`, if a line speaks that | the MAVLink task, each second | the status line | the same |
//! | [`CARD`] | thread level, after each use of the card | the status line | the same |

#[cfg(stanag)]
use timebase::{CivilTime, Validity};
use timebase::{Cycles, Fix};
use ubx_link::{Finding, LinkCounters, SessionCounters};
use utc_clock::{Counters, Ppb, SecondProof, Source};

use crate::drivers::card::CardErrors;
use crate::drivers::pulse::EdgeCounters;
use crate::drivers::uart::LineErrors;
use crate::latest::Latest;
use crate::not_saved::NotSaved;

/// The last report of the GNSS task.
pub static GNSS: Latest<GnssReport> = Latest::new();

/// MAVLink's links: TELEM1, TELEM2 unless it speaks STANAG 4586, and USB.
pub const LINKS: usize = if cfg!(stanag) { 2 } else { 3 };

/// The last report of the MAVLink task, by link; of those that there are.
pub static MAVLINK: Latest<[Option<LinkReport>; LINKS]> = Latest::new();

/// What came over the line that speaks STANAG 4586.
#[cfg(stanag)]
pub static STANAG: Latest<StanagReport> = Latest::new();

/// What has gone wrong with the card, as of its last use.
pub static CARD: Latest<CardReport> = Latest::new();

/// What came over the line that speaks STANAG 4586.
#[cfg(stanag)]
#[derive(Clone, Copy)]
pub struct StanagReport {
    /// Frames and requests.
    pub node: stanag_node::Counters,
    /// Errors of the line itself.
    pub line: LineErrors,
}

/// What thread level knows of the card.
#[derive(Clone, Copy)]
pub struct CardReport {
    /// What failed since boot.
    pub errors: CardErrors,
    /// Why the last log is not on it.
    pub not_saved: Option<NotSaved>,
}

/// What the GNSS task has counted and seen.
#[derive(Clone, Copy)]
pub struct GnssReport {
    /// What came from the receiver.
    pub receiver: ReceiverReport,
    /// Marks and what became of them.
    pub clock: Counters,
    /// What steers the clock.
    pub source: Source,
    /// What is known about its second.
    pub second: SecondProof,
    /// How much faster than the crystal the clock runs.
    pub frequency: Ppb,
    /// Edges on the pulse's wire.
    pub edges: EdgeCounters,
}

/// What came over the receiver's line.
#[derive(Clone, Copy)]
pub struct ReceiverReport {
    /// Bytes and frames.
    pub link: LinkCounters,
    /// The receiver's configuration.
    pub session: SessionCounters,
    /// What is known of the receiver.
    pub finding: Finding,
    /// Errors of the line itself.
    pub line: LineErrors,
    /// The last solution, and when it arrived.
    pub fix: Option<(Cycles, Fix)>,
    /// Its epoch, and what the receiver claims about that.
    #[cfg(stanag)]
    pub epoch: Option<(CivilTime, Validity)>,
}

/// What the MAVLink task has counted on one link.
#[derive(Clone, Copy)]
pub struct LinkReport {
    /// Frames and requests.
    pub node: mavlink_node::Counters,
    /// Errors of the line itself.
    pub line: LineErrors,
}
