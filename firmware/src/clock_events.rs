//! What happens to the clock and to the log of a test, for the people at a ground station.
//!
//! | queue | filled by | drained by | when full |
//! |---|---|---|---|
//! | events, 8 | the GNSS task at sets, steps, what the receiver is and refuses, and what [`ClockNews`](crate::clock_news::ClockNews) sees; the MAVLink task and thread level with what becomes of a log | the MAVLink task, each second | the newest is dropped |

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use fault_record::{Place, Reason};
use ubx_link::{Finding, Setting};

use crate::not_saved::NotSaved;

/// Events that have room.
pub const ROOM: usize = 8;

static EVENTS: Channel<CriticalSectionRawMutex, ClockEvent, ROOM> = Channel::new();

/// What a person at a ground station is to know.
#[derive(Clone, Copy)]
pub enum ClockEvent {
    /// The clock was set.
    Set,
    /// The second of a set clock is not proved, or not any more.
    SecondUnproved,
    /// Date and second are proved.
    SecondProved,
    /// The receiver names another second than the clock.
    SecondContradicted,
    /// No receiver steers the clock any more.
    Holdover,
    /// A receiver steers the clock again.
    SteeredAgain,
    /// The clock stepped.
    Stepped {
        /// What was added to it. [ns]
        by_ns: i64,
    },
    /// The pulse steers the clock.
    PulseFollowed,
    /// The pulse does not steer the clock any more.
    PulseLost,
    /// What is new about the receiver.
    Receiver(Finding),
    /// The receiver does not take a setting.
    Refused(Setting),
    /// A fault ended the run before.
    Restarted {
        /// Why.
        reason: Reason,
        /// Where.
        place: Place,
    },
    /// The crystal has started, and late.
    CrystalLate {
        /// After this. \[µs\]
        after_us: u32,
    },
    /// The log of a test has no more room.
    LogFull,
    /// The log of a test is on the card.
    Saved {
        /// The number in the file's name.
        file: u16,
        /// Samples in it.
        samples: u32,
    },
    /// The log of a test is being written to the card.
    Saving {
        /// For how long already. \[s\]
        for_s: u64,
    },
    /// A test was to begin, and this number of samples would have been lost.
    Unsaved(u32),
    /// The log of a test is not on the card; it still is in memory.
    NotSaved(NotSaved),
}

/// Puts an event into the queue.
pub fn push(event: ClockEvent) {
    // The queue is full when more than eight events happen within a second. What is dropped then is
    // still in the log or in a counter.
    let _ = EVENTS.try_send(event);
}

/// The oldest event in the queue.
pub fn poll() -> Option<ClockEvent> {
    EVENTS.try_receive().ok()
}
