//! A 16-bit capture, extended to cycles since boot.
//!
//! *Purpose.* A timer's input capture has the count at which an edge came, exactly, but not in
//! which round of the counter that was. [`Phase`] finds the moment.
//!
//! *Design.* The timer and the cycle count have one clock, so they differ by a constant while both
//! run: the *phase*, the moment of a count of 0, modulo a round. It is measured once, from readings
//! of both side by side. An edge is then the last moment that had the captured count; the present
//! time serves only to choose the round:
//!
//! ```text
//! edge = now − (now − phase − RATIO · capture) mod ROUND
//! ```
//!
//! *Limits.* A capture has to be extended within [`REACH`] of its edge, 774 µs; later, it is taken
//! for an edge of the next round. An error of the measured phase, a few cycles, is an error of
//! every edge. A debugger that halts the core and with it SysTick, but not the timer, changes
//! the phase.

use crate::Cycles;

/// Core cycles in a count: TIM4 counts the timer clock of APB1, half the core's (RM0090,
/// section 6.2).
pub const RATIO: u64 = 2;

/// Core cycles from a count of 0 to the next: 780 µs.
const ROUND: u64 = RATIO << u16::BITS;

/// How far in the future an edge may seem to be, in cycles, because of the error of the phase: 6
/// µs.
const AHEAD: u64 = 1 << 10;

/// How old an edge may be when it is extended, in cycles.
pub const REACH: u64 = ROUND - AHEAD;

/// The relation between a timer's count and the cycles since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase(u32);

impl Phase {
    /// The phase from one moment at which the timer stood between two counts.
    ///
    /// `at` lies midway between `before` and `after`, which are less than a round
    /// apart.
    #[must_use]
    pub const fn measured(before: u16, at: Cycles, after: u16) -> Self {
        // In half counts, which are cycles.
        let between = after.wrapping_sub(before) as u64;
        let midway = RATIO * before as u64 + between * RATIO / 2;
        Self((at.0.wrapping_sub(midway) % ROUND) as u32)
    }

    /// The phase from the word that [`Self::to_bits`] made.
    #[must_use]
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The phase as a word, for a shared variable.
    #[must_use]
    pub const fn to_bits(self) -> u32 {
        self.0
    }

    /// The moment of the edge that was captured at a count of `capture`, at most [`REACH`] before
    /// `now`.
    #[must_use]
    #[inline]
    pub const fn edge(self, capture: u16, now: Cycles) -> Cycles {
        let since_count_0 = (now.0 as u32).wrapping_sub(self.0);
        let since = since_count_0
            .wrapping_sub(capture as u32 * RATIO as u32)
            .wrapping_add(AHEAD as u32)
            % ROUND as u32;
        Cycles(now.0.wrapping_add(AHEAD).wrapping_sub(since as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The count at `at` of a timer with that phase.
    fn count(phase: u64, at: u64) -> u16 {
        (at.wrapping_sub(phase) / RATIO) as u16
    }

    /// Boot, the end of the low word, and any time.
    const AROUND: [u64; 3] = [ROUND, 1 << 32, 0x1234_5678_9abc];

    #[test]
    fn an_edge_is_found_from_every_phase_and_within_its_reach() {
        for around in AROUND {
            for phase in (0..ROUND).step_by(61).chain([ROUND - 1, AHEAD, REACH]) {
                let word = Phase(phase as u32);
                for edge in [around, around + 1, around + ROUND / 2 + 1] {
                    // The moment at which the count that was captured began.
                    let began = edge - (edge - phase) % RATIO;
                    let capture = count(phase, edge);
                    for delay in [0, 1, 2, 100, ROUND / 2, REACH - 1 - RATIO] {
                        let now = Cycles(edge + delay);
                        assert_eq!(
                            word.edge(capture, now),
                            Cycles(began),
                            "{phase} {edge} {delay}"
                        );
                    }
                    // The phase is a little wrong, so that the edge seems to be yet to come.
                    let now = Cycles(began - AHEAD);
                    assert_eq!(word.edge(capture, now), Cycles(began));
                }
            }
        }
    }

    #[test]
    fn every_capture_and_every_delay_is_one_edge() {
        let word = Phase(77_777);
        for around in AROUND {
            for capture in 0..=u16::MAX {
                let edge = word.edge(capture, Cycles(around));
                assert_eq!(count(77_777, edge.0), capture);
                let age = Cycles(around).since(edge);
                assert!((-(AHEAD as i64)..REACH as i64).contains(&age), "{age}");
            }
        }
    }

    #[test]
    fn the_phase_is_measured_to_a_cycle_whatever_the_counter_shows() {
        for around in AROUND {
            for phase in (0..ROUND).step_by(7) {
                // Readings at the same distance before and after.
                for apart in 1..40 {
                    let (before, after) = (around - apart, around + apart);
                    let measured =
                        Phase::measured(count(phase, before), Cycles(around), count(phase, after));
                    let wrong = u64::from(measured.0).wrapping_sub(phase) % ROUND;
                    assert!(wrong <= 1, "{wrong} at {phase}, {apart}");
                }
            }
        }
    }
}
