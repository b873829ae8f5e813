//! A sleep in whole ticks, as NuttX has it.
//!
//! *Design.* `usleep` rounds the time up to whole ticks (NuttX 7,
//! `sched/signal/sig_timedwait.c`) and the watchdog that ends the wait counts one more
//! (`sched/wdog/wd_start.c`), since the next tick may come at once: a sleep ends with a tick, and
//! lasts what was asked for and at most two ticks more.
//!
//! *Limits.* What the task does after it has been woken is not part of it.

use timebase::{CORE_HZ, Cycles};

/// The tick that ends a sleep of `us` µs which begins between `last_tick` and the next tick.
///
/// `last_tick` is the time of a tick; `period` is from tick to tick, in cycles and more than 0.
#[must_use]
pub const fn wakes_at(last_tick: Cycles, us: u32, period: u32) -> Cycles {
    let period = period as u64;
    let cycles = us as u64 * (CORE_HZ / 1_000_000) as u64;
    let ticks = cycles.div_ceil(period) + 1;
    last_tick.plus(ticks * period)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sleep_is_rounded_up_and_a_tick_longer() {
        let ticks = |us, tick_us: u32| {
            let period = tick_us * 168;
            let last_tick = Cycles(u64::from(period) * 7_000);
            let slept = wakes_at(last_tick, us, period).since(last_tick);
            assert_eq!(slept % i64::from(period), 0);
            slept / i64::from(period)
        };
        // PX4's wait for 32 characters at 115200 and at 38400, and the paper's.
        assert_eq!(ticks(2_777, 1_000), 4);
        assert_eq!(ticks(8_333, 1_000), 10);
        assert_eq!(ticks(5_000, 1_000), 6);
        assert_eq!(ticks(5_000, 500), 11);
        assert_eq!(ticks(5_000, 200), 26);
        assert_eq!(ticks(5_000, 50), 101);
        assert_eq!(ticks(5_001, 50), 102);
    }

    #[test]
    fn no_sleep_is_shorter_than_asked_for_nor_two_ticks_longer() {
        for tick_us in [50_u32, 200, 500, 1_000] {
            let period = tick_us * 168;
            for us in (0..20_000).step_by(7) {
                let slept = wakes_at(Cycles::BOOT, us, period).0;
                let wanted = u64::from(us) * 168;
                // It may begin anywhere in a tick.
                assert!(slept - u64::from(period) >= wanted);
                assert!(slept < wanted + 2 * u64::from(period));
            }
        }
    }
}
