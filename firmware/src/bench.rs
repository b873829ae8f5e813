//! Two functions for the bench to watch: readings of the clock, not inlined.
//!
//! *Design.* The image with the feature `bench` is the one that is flashed plus this task, on the low
//! executor; nothing else in it knows of the bench.

use core::hint::black_box;

use embassy_time::{Duration, Ticker};
use timebase::Cycles;
use utc_clock::UtcNanos;

use crate::clock::CLOCK;
use crate::drivers::time;

/// Reads the clock both ways, a hundred times a second.
#[embassy_executor::task]
pub async fn run() {
    let mut beat = Ticker::every(Duration::from_millis(10));
    loop {
        beat.next().await;
        black_box(bench_cycles_now());
        black_box(bench_utc_now());
    }
}

/// Cycles since boot.
#[unsafe(no_mangle)]
#[inline(never)]
fn bench_cycles_now() -> Cycles {
    time::now()
}

/// UTC. [ns]
#[unsafe(no_mangle)]
#[inline(never)]
fn bench_utc_now() -> UtcNanos {
    CLOCK.utc_of(time::stamp())
}
