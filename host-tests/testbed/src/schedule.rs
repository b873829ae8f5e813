//! When the laptop asks.
//!
//! *Purpose.* The moments of a test's PINGs, the same for every board.
//!
//! *Design.* One PING in each period, anywhere in its first half: moments that stand in
//! no relation to the receivers' epochs, which lie on whole periods, too, and still at
//! least half a period apart. All chance comes from a seed.
//!
//! *Limits.* Sequence numbers have 24 bits in the boards' own logs: 19 days at 10 Hz.

use fastrand::Rng;

/// In ns.
const SECOND: u64 = 1_000_000_000;

/// What makes the schedule's chance another than the receivers' of the same seed.
const STREAM: u64 = 0x7069_6e67;

/// A test's PINGs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// PINGs a second to each board.
    pub rate_hz: u32,
    /// How long the test lasts. \[s\]
    pub duration_s: u32,
    /// Where its chance comes from.
    pub seed: u64,
}

impl Schedule {
    /// How many PINGs there are.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.rate_hz.saturating_mul(self.duration_s)
    }

    /// Each PING's sequence number, from 0 on, and its moment since the test's start in
    /// ns.
    pub fn pings(&self) -> impl Iterator<Item = (u32, u64)> + use<> {
        let period_ns = SECOND / u64::from(self.rate_hz.max(1));
        let mut rng = Rng::with_seed(self.seed ^ STREAM);
        (0..self.count()).map(move |sequence| {
            let dither_ns = rng.u64(0..(period_ns / 2).max(1));
            (sequence, u64::from(sequence) * period_ns + dither_ns)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_in_each_period_never_close_together_and_at_every_phase() {
        let schedule = Schedule {
            rate_hz: 10,
            duration_s: 600,
            seed: 1,
        };
        let moments: Vec<u64> = schedule.pings().map(|(_, at)| at).collect();
        assert_eq!(moments.len(), 6_000);
        let mut phases = [0; 5];
        for (n, pair) in moments.windows(2).enumerate() {
            assert!(pair[1] - pair[0] >= 50_000_000);
            let phase = pair[0] - n as u64 * 100_000_000;
            phases[(phase / 10_000_000) as usize] += 1;
        }
        // 1200 of each, with a standard deviation of 31.
        assert!(
            phases.iter().all(|&n| (1_050..1_350).contains(&n)),
            "{phases:?}"
        );
        assert!(schedule.pings().eq(schedule.pings()));
        let other = Schedule {
            seed: 2,
            ..schedule
        };
        assert!(!schedule.pings().eq(other.pings()));
    }
}
