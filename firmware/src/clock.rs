//! The clock, as everything but the GNSS task sees it.
//!
//! *Design.* The GNSS task is the one writer; the clock is read without a lock, from any interrupt.
//! In the paper's variants the paper's clock stands in its place. NuttX has no other time than the
//! ticks that it has counted when a task asks for it, so there every moment becomes that.

use mavlink_node::NodeTime;
use timebase::{ClockState, Cycles};
use utc_clock::{Published, Reading};

use crate::base_time;
use crate::drivers::time;
use crate::settings::VARIANT;

/// The clock. Nothing writes to it in the paper's variants.
pub static CLOCK: Published = Published::new();

/// The clock at `when`.
#[inline]
pub fn reading_at(when: Cycles) -> Reading {
    read(moment(when))
}

/// The node's time at `when`, and the reading that it is from.
#[inline(never)]
pub fn node_time_and_reading_at(when: Cycles) -> (NodeTime, Reading) {
    let when = moment(when);
    let reading = read(when);
    let time = NodeTime {
        boot: when,
        utc_ns: (reading.state != ClockState::Unset).then_some(reading.utc.0),
    };
    (time, reading)
}

/// The node's time at `when`, for MAVLink.
pub fn node_time_at(when: Cycles) -> NodeTime {
    node_time_and_reading_at(when).0
}

/// The time under which the variant reads its clock for something that happened at `when`.
#[inline(always)]
fn moment(when: Cycles) -> Cycles {
    if VARIANT.is_papers() {
        time::counted_ticks()
    } else {
        when
    }
}

/// The clock of the variant at a [`moment`].
#[inline(always)]
fn read(moment: Cycles) -> Reading {
    if VARIANT.is_papers() {
        base_time::get().reading_at(moment)
    } else {
        CLOCK.reading_at(moment)
    }
}
