//! What goes wrong with a receiver in the field, as seeded pieces of a flight.
//!
//! *Purpose.* Flights with the faults that people have reported, each alone and two
//! at once, with all the evidence that a board would see of them: TIM-TP,
//! NAV-TIMELS, both edges of the pulse, and how long the line had been busy.
//!
//! *Design.* A [`Schedule`] is a receiver, a crystal and a list of [`Fault`]s, each
//! with its span. It is [drawn](Schedule::draw) from a seed, but it is a value that
//! can be written by hand, too. [`Schedule::events`] makes what the board sees; its
//! chance is another stream than the one that drew the faults, so that a fault more
//! or less leaves the rest as it was. [`Schedule::calm`] says when nothing has been
//! wrong for long enough that the clock has no excuse.
//!
//! | piece | reaches |
//! |---|---|
//! | floor: steps, ramps, breathing | ±60 ms, 400 s |
//! | other messages before each mark | 100 ms, 240 s |
//! | lag on a full line | 6 s, 10 to 240 s, or from before the start |
//! | labels off | 1 ms to 1 s for 60 s; an hour for 200 s; one label by 1 s |
//! | the first marks early or late | 110 ms, 3 marks |
//! | leap count not resolved | 750 s; 4 and 15 to 18 for 18 |
//! | restarts | another date until the end; another leap count for 60 s |
//! | pulse of our width at another phase | without TIM-TP's word until the end, with it for 20 s |
//! | pulse doubled, at N Hz, inverted, of another width, another device's, lost, odd | until the end |
//! | qErr | to the ends of its 32 bits; TIM-TP on another base or in another week until the end |
//!
//! *Limits.* [`Schedule::draw`] leaves out what nothing on the board can detect, by
//! [its rules](Schedule::is_detectable); [`Schedule::draw_undetectable`] draws that alone.

mod belief;
mod calm;
mod detectable;
mod draw;
mod fault;
mod messages;
mod pieces;
mod plan;
mod polls;
mod queue;
mod sizes;
mod wire;

pub use calm::Calm;
pub use fault::{
    Fault, FaultKind, LEAP_COUNT, PulseWord, QErrNonsense, RestartLie, RestartPulse, TimTpLie,
};
pub use pieces::LASTS_S;
pub use plan::{FieldReceiver, Schedule};
