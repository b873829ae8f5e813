//! What tasks tell each other.
//!
//! *Design.* One writer each: the GNSS task publishes the clock and its report,
//! the MAVLink task its own report. The clock is read without a lock, from any
//! interrupt; reports are copied under a critical section, once a second.
//!
//! | queue | filled by | drained by | when full |
//! |---|---|---|---|
//! | [`CLOCK_EVENTS`] | the GNSS task, at sets, steps and changes of the source; the MAVLink task and thread level, what becomes of a log | the MAVLink task, each second | the newest is dropped: the log has it |

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use mavlink_node::NodeTime;
use paper_clock::BaseTime;
use timebase::Cycles;
use ubx_link::{Fix, LinkCounters, SessionCounters};
use utc_clock::{ClockState, Ppb, Published, Reading, Source};

use crate::drivers::card::CardErrors;
use crate::drivers::pulse::EdgeCounters;
use crate::drivers::time;
use crate::drivers::uart::LineErrors;
use crate::settings::VARIANT;
use crate::storage::NotSaved;

/// The clock.
pub static CLOCK: Published = Published::new();

/// The last report of the GNSS task.
pub static GNSS: Report<GnssReport> = Report::new();

/// The last report of the MAVLink task.
pub static MAVLINK: Report<MavlinkReport> = Report::new();

/// What has gone wrong with the card, since thread level last used it.
pub static CARD: Report<CardErrors> = Report::new();

/// What the clock did that others should hear of.
pub static CLOCK_EVENTS: Channel<CriticalSectionRawMutex, ClockEvent, 4> = Channel::new();

/// What the clock did that others should hear of.
#[derive(Clone, Copy)]
pub enum ClockEvent {
    /// It was set.
    Set,
    /// It stepped.
    Stepped {
        /// What was added to it, in ns.
        by_ns: i64,
    },
    /// The pulse steers it.
    PulseFollowed,
    /// The pulse does not any more.
    PulseLost,
    /// The log of a test has no more room.
    LogFull,
    /// The log of a test is on the card.
    Saved {
        /// The number in the file's name.
        file: u16,
        /// Samples in it.
        samples: u32,
    },
    /// It is not; it still is in memory.
    NotSaved(NotSaved),
}

/// What the paper's clock, which stands in for [`CLOCK`] in the paper's variants, was set to last.
pub static BASE_TIME: Report<BaseTime> = Report::new();

/// The clock at `when`.
#[inline]
pub fn reading_at(when: Cycles) -> Reading {
    read(seen(when))
}

/// The clock at a moment as [`seen`] by it.
#[inline(always)]
fn read(seen: Cycles) -> Reading {
    if VARIANT.is_papers() {
        BASE_TIME.get().unwrap_or_default().reading_at(seen)
    } else {
        CLOCK.reading_at(seen)
    }
}

/// When something was that happened at `when`. In the paper's variants a moment is the last tick
/// before it is asked for: NuttX has no other.
#[inline(always)]
fn seen(when: Cycles) -> Cycles {
    if VARIANT.is_papers() {
        time::last_tick()
    } else {
        when
    }
}

/// The clock at `when`, and the time that the node tells of it.
#[inline(never)]
pub fn told_at(when: Cycles) -> (NodeTime, Reading) {
    let when = seen(when);
    let reading = read(when);
    let time = NodeTime {
        boot_us: when.as_micros(),
        utc_ns: (reading.state != ClockState::Unset).then_some(reading.utc.0),
    };
    (time, reading)
}

/// The node's time at `when`, for MAVLink.
pub fn node_time(when: Cycles) -> NodeTime {
    told_at(when).0
}

/// What the GNSS task has counted and seen.
#[derive(Clone, Copy)]
pub struct GnssReport {
    /// Bytes and frames on the receiver's line.
    pub link: LinkCounters,
    /// The receiver's configuration.
    pub session: SessionCounters,
    /// Marks and what became of them.
    pub clock: utc_clock::Counters,
    /// Errors of the line itself.
    pub line: LineErrors,
    /// Edges on the pulse's wire.
    pub edges: EdgeCounters,
    /// What steers the clock.
    pub source: Source,
    /// How much faster than the crystal it runs.
    pub frequency: Ppb,
    /// The last solution, and when it arrived.
    pub fix: Option<(Cycles, Fix)>,
}

/// What the MAVLink task has counted.
#[derive(Clone, Copy)]
pub struct MavlinkReport {
    /// Frames and requests.
    pub node: mavlink_node::Counters,
    /// Errors of the line itself.
    pub line: LineErrors,
}

/// The latest of a kind of report; before the first there is none.
pub struct Report<T>(Mutex<CriticalSectionRawMutex, Cell<Option<T>>>);

impl<T: Copy> Report<T> {
    const fn new() -> Self {
        Self(Mutex::new(Cell::new(None)))
    }

    /// Replaces the report.
    pub fn tell(&self, report: T) {
        self.0.lock(|cell| cell.set(Some(report)));
    }

    /// The last one.
    pub fn get(&self) -> Option<T> {
        self.0.lock(Cell::get)
    }
}
