//! The watchdog is fed while tick, GNSS and MAVLink are alive.
//!
//! *Design.* The alarm looks ten times a second ([`look`]). That it comes at all shows that the tick
//! runs, and that nothing keeps the core from what stands below the lines. A task shows that it is alive by [`came_by`], in each
//! pass of its loop, which it makes at least every [`COME_BY`] whether anything happens or not. One that
//! has missed [`PATIENCE`] looks in a row ends the run, with its name. Looks are counted and not time, so that a
//! core that stood still, in a debugger or because an emulator's host was busy, has done nothing wrong.
//!
//! *Limits.* What stops the alarm itself is found by [`time`](crate::drivers::time) within 50 ms; if it masks interrupts, by the
//! watchdog alone, within 1.5 s, without a place.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering::Relaxed};

use embassy_time::{Duration, Instant};
use fault_record::Hang;
use timebase::CORE_HZ;

use crate::drivers::{backup, time, watchdog};
use crate::fault;

/// From look to look, in cycles: 100 ms.
const LOOK_EVERY: u32 = CORE_HZ / 10;

/// So many looks in a row may find that a task did not come by.
const PATIENCE: u8 = 10;

/// A loop comes by at least this often. Half of what is asked of it.
pub const COME_BY: Duration = Duration::from_millis(500);

/// The tasks, each with the number of looks that have missed it.
static MISSED: [(Hang, AtomicU8); 2] = [
    (Hang::Gnss, AtomicU8::new(0)),
    (Hang::Mavlink, AtomicU8::new(0)),
];

/// When the last look was.
static LOOKED: AtomicU32 = AtomicU32::new(0);

/// `due`, or when a loop has to come by, whichever is sooner.
pub fn no_later(due: Instant) -> Instant {
    due.min(Instant::now() + COME_BY)
}

/// A task's loop has come by.
pub fn came_by(task: Hang) {
    for (which, missed) in &MISSED {
        if *which == task {
            missed.store(0, Relaxed);
        }
    }
}

/// Looks, if it is time to: the alarm calls it, with the place of its exception's frame.
#[inline(always)]
pub fn look(sp: u32) {
    let now = time::stamp().0;
    if now.wrapping_sub(LOOKED.load(Relaxed)) >= LOOK_EVERY {
        LOOKED.store(now, Relaxed);
        look_at_all(sp);
    }
}

#[cold]
#[inline(never)]
fn look_at_all(sp: u32) {
    for (task, missed) in &MISSED {
        // The tasks stand below the alarm, so nothing comes between these two.
        let looks = missed.load(Relaxed) + 1;
        missed.store(looks, Relaxed);
        if looks > PATIENCE {
            fault::task_stopped(*task, sp);
        }
    }
    backup::set_up_ms(fault::up_ms());
    watchdog::feed();
}
