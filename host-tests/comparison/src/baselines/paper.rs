//! The paper's clock: set anew at every message.
//!
//! *Source.* PX4 1.9, `src/drivers/gps/gps.cpp`: `GPSCallbackType::setClock` calls
//! `px4_clock_settime` for each NAV-PVT with a valid time; measured in Shim, Joo
//! and Kim, "Minimizing GPS Clock Synchronization Error for PX4-Based Unmanned
//! Aircraft" (2021).
//!
//! *Left out.* The wait between poll and read and the whole ticks of the clock:
//! what is left is the receiver's latency and its jitter. An image built for one of the paper's
//! variants (`PIXCLOCK_VARIANT`) has them.

use super::baseline::Baseline;

/// UTC less nominal time, as the last message had it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Paper {
    offset_ns: Option<i64>,
}

impl Baseline for Paper {
    fn handle_mark(&mut self, local_ns: i64, epoch_utc_ns: i64) {
        self.offset_ns = Some(epoch_utc_ns - local_ns);
    }

    fn utc_ns(&self, local_ns: i64) -> Option<i64> {
        Some(local_ns + self.offset_ns?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_message_is_the_time() {
        let mut clock = Paper::default();
        assert_eq!(clock.utc_ns(0), None);
        clock.handle_mark(100, 5_000);
        clock.handle_mark(350, 5_200);
        assert_eq!(clock.utc_ns(400), Some(5_250));
    }
}
