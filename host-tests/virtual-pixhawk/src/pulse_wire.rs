//! The wire of the receiver's time pulse.
//!
//! *Purpose.* [`PulseWire`] brings [`Pulse`]s, which live in true time, to the board's
//! AUX5, where the firmware captures their edges.
//!
//! *Design.* It knows when the run has to stop for it, and at a stop which levels the
//! pin goes through. An edge that comes while the wire is high still, a bounce, is a
//! dip of no length. The pin reaches the timer only where the firmware has
//! connected the two.
//!
//! A timer of the emulator lets an edge in at once, in the count that has begun. One of metal resynchronises
//! it, which takes 2 to 3 counts: [`synchronised`] delays each edge by that, drawn, and by half a count
//! for the part of a count by which the emulator's is early.
//!
//! *Limits.* Edges are vertical, and at whole ns.

use std::fmt;
use std::iter::Peekable;

use fastrand::Rng;
use rigless::device::Level;
use rigless::mcu::Operate as _;
use rigless::soc::Width;
use rigless::soc::st::tim::Channel;
use rigless::soc::stm32f427::Stm32f427;
use rigless::time::VirtualNanos;
use world::{Pulse, WorldNanos};

/// TIM4 among the part's general-purpose timers.
const TIM4: usize = 2;
const CHANNEL: Channel = Channel::new(2).expect("timers have two channels");
/// GPIOD's mode and alternate-function registers (RM0090 2.3, 8.4.1, 8.4.10), and
/// what pin 13 shows there once it is TIM4's: mode 2, function 2.
const MODER: u64 = 0x4002_0C00;
const AFRH: u64 = MODER + 0x24;
const MODER_13: (u64, u64) = (0b11 << 26, 0b10 << 26);
const AFRH_13: (u64, u64) = (0xf << 20, 2 << 20);

/// The least delay of an edge, 2.5 counts of 84 MHz, and how much more it can be, a count. \[ns\]
const SYNCHRONISER_NS: u64 = 30;
const COUNT_NS: u64 = 12;

/// The edges of `pulses` as the timer's input lets them in, in their order.
pub(crate) fn synchronised(
    pulses: impl Iterator<Item = Pulse> + Send,
) -> impl Iterator<Item = Pulse> + Send {
    let mut rng = Rng::with_seed(0);
    let mut last = WorldNanos(0);
    let mut let_in = move |at: WorldNanos| {
        last = last.max(at.plus(SYNCHRONISER_NS + rng.u64(0..COUNT_NS)));
        last
    };
    pulses.map(move |pulse| Pulse {
        edge: let_in(pulse.edge),
        end: let_in(pulse.end),
        ..pulse
    })
}

/// What drives AUX5.
pub(crate) struct PulseWire {
    pulses: Peekable<Box<dyn Iterator<Item = Pulse> + Send>>,
    /// When it falls, if it is high.
    falls: Option<WorldNanos>,
}

impl fmt::Debug for PulseWire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PulseWire")
            .field("falls", &self.falls)
            .finish_non_exhaustive()
    }
}

impl PulseWire {
    /// A wire with these pulses on it, in the order of their edges.
    pub(crate) fn new(pulses: impl Iterator<Item = Pulse> + Send + 'static) -> Self {
        let pulses: Box<dyn Iterator<Item = Pulse> + Send> = Box::new(pulses);
        Self {
            pulses: pulses.peekable(),
            falls: None,
        }
    }

    /// The levels that the pin goes through at `now`.
    fn levels(&mut self, now: WorldNanos) -> Vec<Level> {
        let mut levels = Vec::new();
        if self.falls.is_some_and(|falls| falls <= now) {
            self.falls = None;
            levels.push(Level::Low);
        }
        while let Some(pulse) = self.pulses.next_if(|pulse| pulse.edge <= now) {
            if self.falls.is_some() {
                levels.push(Level::Low);
            }
            self.falls = self.falls.max(Some(pulse.end));
            levels.push(Level::High);
        }
        levels
    }

    /// Brings the pin to `now`.
    pub(crate) fn prepare(&mut self, now: WorldNanos, part: &mut Stm32f427) {
        let at = VirtualNanos(now.0);
        for level in self.levels(now) {
            if is_connected(part, at) {
                part.drive_timer(at, TIM4, |timer, registers, context| {
                    timer.drive_input(CHANNEL, level, registers, context);
                });
            }
        }
    }

    /// The first moment after `now` at which the wire changes.
    pub(crate) fn next_stop(&mut self, now: WorldNanos) -> Option<WorldNanos> {
        let rises = self.pulses.peek().map(|pulse| pulse.edge);
        [rises, self.falls]
            .into_iter()
            .flatten()
            .filter(|&at| at > now)
            .min()
    }
}

/// Whether the firmware has given the pin to the timer.
fn is_connected(part: &mut Stm32f427, at: VirtualNanos) -> bool {
    [(MODER, MODER_13), (AFRH, AFRH_13)]
        .into_iter()
        .all(|(address, (mask, wanted))| {
            part.peek(at, address, Width::W32)
                .is_ok_and(|value| value & mask == wanted)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pulse(edge: u64, end: u64) -> Pulse {
        Pulse {
            edge: WorldNanos(edge),
            end: WorldNanos(end),
            utc_s: None,
            late_ps: 0,
        }
    }

    #[test]
    fn it_stops_where_the_wire_changes_and_a_bounce_is_an_edge_of_its_own() {
        let pulses = [pulse(10, 110), pulse(15, 115), pulse(1_000, 1_100)];
        let mut wire = PulseWire::new(pulses.into_iter());
        let mut now = WorldNanos(0);
        let mut seen = Vec::new();
        while let Some(next) = wire.next_stop(now) {
            now = next;
            seen.push((now.0, wire.levels(now)));
        }
        let expected = [
            (10, vec![Level::High]),
            (15, vec![Level::Low, Level::High]),
            (115, vec![Level::Low]),
            (1_000, vec![Level::High]),
            (1_100, vec![Level::Low]),
        ];
        assert_eq!(seen, expected);
    }

    #[test]
    fn an_edge_is_let_in_after_two_to_three_counts_and_in_its_order() {
        let edges = (0..1_000).map(|n| pulse(n * 20, n * 20 + 10));
        let mut delays_ns = Vec::new();
        let mut last = 0;
        for (was, is) in edges.clone().zip(synchronised(edges)) {
            for (was, is) in [(was.edge, is.edge), (was.end, is.end)] {
                delays_ns.push(is.0 - was.0);
                assert!(is.0 >= last);
                last = is.0;
            }
        }
        let mean_ns = delays_ns.iter().sum::<u64>() as f64 / delays_ns.len() as f64;
        assert!((35.0..37.0).contains(&mean_ns), "{mean_ns}");
        assert!(delays_ns.iter().all(|ns| (30..42).contains(ns)));
    }

    #[test]
    fn a_pin_that_is_not_connected_moves_nothing() {
        let mut part = Stm32f427::new().unwrap();
        let mut wire = PulseWire::new([pulse(10, 110)].into_iter());
        wire.prepare(WorldNanos(10), &mut part);
        assert_eq!(wire.next_stop(WorldNanos(10)), Some(WorldNanos(110)));
        assert!(!is_connected(&mut part, VirtualNanos(10)));
    }
}
