//! A clock that shows UTC on a board with a GNSS receiver; it counts cycles of 168 MHz.
//!
//! *Purpose.* A receiver sends what time it was some ms ago and, if the wire is there, a pulse at
//! each second. This makes of them a clock that code of any interrupt priority can read, with
//! the uncertainty of each reading. The types that matter:
//!
//! - [`UtcClock`] is a state machine: time marks, pulses and what the receiver says of both go in, and
//!   what they did comes out;
//! - [`Published`] has a [`Reading`] for any moment that was stamped, and takes no lock for it;
//! - [`Settings`] is what is known before the first mark.
//!
//! ```
//! use timebase::{CORE_HZ, CivilTime, Cycles, LeapSeconds, TimeMark, Validity};
//! use utc_clock::{ClockState, Outcome, Published, Settings, UtcClock};
//!
//! static TIMELINE: Published = Published::new();
//! const SECOND: u64 = CORE_HZ as u64;
//!
//! // One task owns the clock, and with it the only writer of the timeline.
//! let mut clock = UtcClock::new(Settings::DEFAULT, TIMELINE.take_writer().unwrap());
//!
//! // The receiver says that it has its leap count from GPS. A second later a NAV-PVT of 04:00:00
//! // arrives on a line that was idle, then one each 0.2 s; each is handled 9 ms later.
//! clock.handle_leap_seconds(
//!     &LeapSeconds {
//!         arrival: Cycles(2 * SECOND),
//!         busy_us: 0,
//!         source: 2,
//!         count: Some(18),
//!         event: None,
//!     },
//!     Cycles(2 * SECOND),
//! );
//! let mut mark = TimeMark {
//!     arrival: Cycles(3 * SECOND),
//!     busy_us: 0,
//!     epoch: CivilTime { year: 2026, month: 11, day: 22, hour: 4, minute: 0, second: 0, nano: 0 },
//!     t_acc_ns: 20,
//!     validity: Validity { date: true, time: true, fully_resolved: true, ..Validity::default() },
//! };
//! let outcome = clock.handle_mark(&mark, mark.arrival.plus(SECOND * 9 / 1_000));
//! assert_eq!(outcome, Outcome::Set);
//! // One mark alone proves no second.
//! let reading = TIMELINE.reading_at(mark.arrival.plus(SECOND / 10));
//! assert_eq!(reading.state, ClockState::Unproved);
//! for fifth in 1..=5_u8 {
//!     mark.arrival = mark.arrival.plus(SECOND / 5);
//!     mark.epoch.second = fifth / 5;
//!     mark.epoch.nano = i32::from(fifth % 5) * 200_000_000;
//!     clock.handle_mark(&mark, mark.arrival.plus(SECOND * 9 / 1_000));
//! }
//!
//! // An interrupt reads the time of something that happened 1.5 s after the first arrival.
//! let reading = TIMELINE.reading_at(Cycles(3 * SECOND).plus(SECOND * 3 / 2));
//! assert_eq!(format!("{:.0}", reading.utc), "2026-11-22T04:00:01Z");
//! assert_eq!(reading.state, ClockState::Set);
//! // As long as the receiver's latency is not known, the clock may be off by as much.
//! assert!(reading.uncertainty_ns >= u64::from(Settings::DEFAULT.latency_uncertainty_ns));
//!
//! // Two seconds without another mark: the clock runs on by itself.
//! while clock.poll_timeout() <= Cycles(7 * SECOND) {
//!     clock.handle_timeout(clock.poll_timeout());
//! }
//! assert_eq!(TIMELINE.reading_at(Cycles(7 * SECOND)).state, ClockState::Holdover);
//! ```
//!
//! *Design.* The question is not only what time it is but what the evidence can prove. Three things
//! are known apart, each with its own uncertainty; what is published is the sum of what is not proved.
//!
//! ```text
//! TimeMark ─▶ gate ─┬▶ second ──────┐
//!                   └▶ envelope ────┤
//! LeapSeconds ───────▶ second       ├▶ discipline ─▶ clock ─▶ Published ─▶ readers
//! PulseForecast ─┬───▶ train ─▶ track
//! PulseEdge ─────┘
//! ```
//!
//! - `second`, *which second*: the leap count, the votes of the marks, what contradicts them;
//! - `train` and `track`, *where in the second*, under a pulse: which edges are the pulse, and
//!   how the crystal stands to them; `envelope`, without one: the least latency of the marks;
//! - *how fast*: the pulse's track, or the envelope; `drift_guard` remembers the whole lock.
//!
//! `calendar` makes an instant of the receiver's fields, and `gate` decides whether a mark may be
//! believed at all. `discipline` decides which source says how far the clock is off, and `clock` how
//! it follows. That owns the timeline: a chain of `model`s, each an affine map from cycles to
//! UTC, with an uncertainty that grows as `holdover` says. `published` shares it.
//!
//! What detects what:
//!
//! | detector | where | time scale | catches | does |
//! |---|---|---|---|---|
//! | claims, tAcc, date window | `gate` | one mark | what the receiver itself does not vouch for, a week number 1024 off | refuses the mark |
//! | busy line | `discipline` | one mark | lag: a mark that waited 20 ms teaches no floor, 300 ms no number | refuses it; after 10 s of nothing else the least delayed set the clock, with their wait in the uncertainty |
//! | source of the leap count | `second` | until resolved; each poll | a count out of the firmware, or of a restart | ±18 s in the uncertainty until the sky has said it |
//! | votes | `second` | 5 marks | one label that is off | the second stays open |
//! | silence of an open second | `second` | 4.5 s; 12 s | a restart with another leap count | votes prove nothing before the count was asked for again |
//! | contradiction | `second` | 3 marks; 300 s | labels, a date or a leap count that changed | both numbers in the uncertainty; followed after 300 s without a pulse |
//! | announced event | `second` | a day | a leap second, a receiver that is a second early | one step at the end of second 60 |
//! | width and polarity | `train` | one pulse | inverted pulses, cameras, other modules | counts it |
//! | one a second | `train` | 5 s | N Hz, two trains side by side | no proof |
//! | TIM-TP's word | `train` | 1.3 s; 10 s of silence | free-running, another receiver's | no proof, or proof begins anew |
//! | own accuracy | `discipline` | one mark | a receiver that is losing its time | proof begins anew |
//! | rhythm | `track` | one pulse | what is not where the crystal puts it | refuses it, widens the uncertainty |
//! | surprise, lag | `track` | 3 to 7 pulses | a ramp that turns round | learns the drift anew |
//! | phase against the pulse followed | `discipline` | 60 s; 120 s beside it | a train that snaps, a camera 3 ppm fast | not followed before it has outlasted that at the crystal's frequency |
//! | first marks | `envelope` | 20 s | a late or early first mark, one wrong label | begins the line anew |
//! | silence of a young line | `envelope` | 2 min | a line that ran on by a crystal of which little is known | begins anew |
//! | early, late | `envelope` (`apart`) | 75 s; 240 s | labels that are off, a queue, a floor that moves | holds the marks off, then takes the floor for another latency |
//! | still moving | `envelope` (`apart`) | twice that | ramps, a frequency learnt from one | not followed; the frequency is learnt anew |
//! | wander | `envelope` (`wander`) | 8 min | floors that breathe | the frequency of many minutes, the scatter in the uncertainty |
//! | step of the frequency | `envelope` | 2 s | a floor taken for a crystal | 4.8 ppm a minute at most, 110 ppm in all |
//! | seconds of another length | `train` | 8 pulses | a crystal beyond 110 ppm, by the pulse | unset until pulses or blocks say otherwise |
//! | floors of blocks | `crystal_watch` | 250 s | the same by messages | the same |
//! | anchor | `drift_guard` | the whole lock | a receiver that drifts as no crystal does | refuses its marks |
//! | silence | `clock` | 2 s or 3.5 periods | a receiver that is gone | holdover |
//!
//! What none of them can catch stands in `docs/integrity.md`.
//!
//! *Limits.* No I/O, and time is an argument. [`UtcClock::handle_timeout`] has to be called when
//! [`UtcClock::poll_timeout`] says. The rate of 168 MHz is [`timebase::CORE_HZ`], a constant and no
//! parameter: it is in the factors that spare the readers every division, and as a parameter it
//! would be in the type of each stamp of each crate.
#![no_std]
#![forbid(unsafe_code)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing
)]

#[cfg(test)]
extern crate std;

mod calendar;
mod clock;
mod counters;
mod crystal_watch;
mod discipline;
mod drift_guard;
mod envelope;
mod float;
mod gate;
mod holdover;
mod kalman;
mod model;
mod outcome;
mod published;
mod refusal;
mod second;
mod settings;
mod track;
mod train;
mod utc;

pub use calendar::CalendarError;
pub use clock::UtcClock;
pub use counters::Counters;
pub use model::Reading;
pub use outcome::{Outcome, PulseOutcome, SecondProof, Source};
pub use published::{Published, Writer};
pub use refusal::{PulseRefusal, Refusal};
pub use settings::Settings;
#[doc(inline)]
pub use timebase::ClockState;
pub use utc::{Ppb, UtcNanos};
