//! A recording's bytes through the parser and the clock.
//!
//! *Design.* It plays as in `sim --ubx`: what stands up to each NAV-PVT leaves together
//! at 115200 baud, spaced by its time of week. Bytes are stamped by a perfect crystal as
//! their last bit comes in.
//!
//! *Limits.* A recording of bytes has no arrival times of its own: how late they
//! were is not in it.

use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use comparison::trace::HEADER;
use serde_json::json;
use timebase::{Cycles, StampedByte};
use ubx_link::{Event, Link};
use utc_clock::{Outcome, Published, Settings, UtcClock, UtcNanos};
use world::{Recording, Talker};

use super::options::Options;

/// GPS less UTC since 2017, in s.
const LEAP_COUNT: i8 = 18;

/// The clock's settings for a recording: the leap count is configured where the recording has no
/// NAV-TIMELS, the floor is the user's.
fn settings(options: &Options, recording: &Recording) -> Result<Settings> {
    Ok(Settings {
        leap_seconds: (!recording.has_leap_seconds()).then_some(LEAP_COUNT),
        date_floor: options
            .floor_utc_ns()?
            .map_or(Settings::DATE_FLOOR, UtcNanos),
        ..Settings::DEFAULT
    })
}

/// Replays `bytes` and prints what became of each NAV-PVT, and every counter.
///
/// # Errors
///
/// When they are no recording.
pub fn run(options: &Options, bytes: &[u8]) -> Result<ExitCode> {
    let path = options.file.display();
    if options.svg.is_some() {
        bail!("{path}: a picture is made of a CSV of arrivals or a flight only");
    }
    let mut recording = match Recording::new(bytes) {
        Ok(recording) => recording,
        Err(none) => bail!(
            "{path}: {none}; a recording of a u-blox receiver is wanted, or a CSV of \
             arrivals with the header `{HEADER}`"
        ),
    };
    let line = Published::new();
    let mut clock = UtcClock::new(
        settings(options, &recording)?,
        line.take_writer().context("a line of its own")?,
    );
    let mut link = Link::new();
    let mut marks = 0_u32;
    while let Some(at) = recording.next_event() {
        let Some(burst) = recording.poll(at) else {
            break;
        };
        let stamped: Vec<_> = (0..)
            .zip(&burst.bytes)
            .map(|(index, &byte)| StampedByte {
                stamp: Cycles::from_nanos(burst.byte_end(index).0).stamp(),
                byte,
            })
            .collect();
        let now = Cycles::from_nanos(burst.end().0);
        while clock.poll_timeout() < now {
            clock.handle_timeout(clock.poll_timeout());
        }
        for chunk in stamped.chunks(Link::ROOM) {
            link.push(chunk);
            let then = chunk.last().map_or(now, |byte| byte.stamp.extend(now));
            while let Some(event) = link.poll(then) {
                let Event::NavPvt { mark, .. } = event else {
                    continue;
                };
                marks += 1;
                let outcome = clock.handle_mark(&mark, now);
                if !options.json {
                    let at_s = now.as_nanos() as f64 / 1e9;
                    console::print_line!("{at_s:>12.6} s  {}", described(&outcome));
                }
            }
        }
    }
    let (counted, received) = (clock.counters(), link.counters());
    if options.json {
        let summary = json!({
            "nav_pvts": marks,
            "accepted": counted.accepted,
            "refused": counted.refused(),
            "sets": counted.sets,
            "bad_checksums": received.bad_checksums,
            "foreign_bytes": received.foreign_bytes,
        });
        console::print_line!("{summary}");
    } else {
        console::print_line!(
            "{marks} NAV-PVT: {} accepted, {} refused",
            counted.accepted,
            counted.refused()
        );
        console::print_line!("{counted:#?}\n{received:#?}");
    }
    Ok(ExitCode::SUCCESS)
}

/// What a mark did, for people.
fn described(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Set => "sets the clock".to_owned(),
        Outcome::Slewed { error_ns } => format!("slews: the clock is {error_ns} ns behind"),
        Outcome::Stepped { by_ns } => format!("steps by {by_ns} ns"),
        Outcome::Confirmed => "agrees with the pulse".to_owned(),
        Outcome::Refused(refusal) => format!("refused: {refusal:?}"),
    }
}
