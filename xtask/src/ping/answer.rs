//! An answer of a node, and what is certain about the node's clock.
//!
//! *Purpose.* [`Answer`] is a line of `ping`; its [`Window`] is what is certain about the moment that
//! the node's time belongs to.
//!
//! *Design.* A node answers with its time at the arrival of the request's first byte. That byte
//! cannot arrive before it was sent, nor so late that the rest of the request and the whole answer
//! had no time to follow. Where the rate of the line is known, these bytes' own time makes the window
//! narrower on both sides.

use std::fmt;
use std::time::Duration;

use console::units;
use jiff::Timestamp;
use mavlink_node::Version;
use mavlink_node::client;

/// Bits a byte: a start bit, eight, a stop bit.
const BITS_PER_BYTE: u64 = 10;
/// A line may be faster than its nominal rate by this, in percent: more, and an UART misreads the
/// last bit of a byte.
const FASTER_PERCENT: u64 = 5;
/// The time in a PING is cut to whole µs.
const CUT_NS: u64 = 1_000;

/// An answer of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The number of the request.
    pub seq: u32,
    /// The node's time: UTC, or since boot while its clock is not set, in µs.
    pub node_us: u64,
    /// From sending the request to having the answer.
    pub round_trip: Duration,
    /// This host's UTC when the request was sent, in ns since 1970.
    pub sent_utc_ns: i64,
    /// Bytes that the request and the answer have.
    pub bytes: Bytes,
}

/// How long the frames of one answer are, and how fast they go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bytes {
    /// Bytes of the request.
    pub request: usize,
    /// The version of the answer, from which its length follows.
    pub answer: Version,
    /// The rate of the line, in Bd; `None` if nothing is known of it.
    pub baud: Option<u32>,
}

/// When a request arrived by this host's clock: at `middle_ns` of UTC, or up to `half_ns` earlier or
/// later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// In ns since 1970.
    pub middle_ns: i64,
    /// Half its width, in ns.
    pub half_ns: u64,
}

impl Answer {
    /// Node minus host in µs, if both ways took equally long; `None` while the node's clock is not
    /// set.
    pub fn difference_us(&self) -> Option<i64> {
        let host_us = (self.sent_utc_ns + nanos(self.round_trip / 2)) / 1_000;
        let utc_us = i64::try_from(self.node_us).ok()?;
        client::is_utc(self.node_us).then(|| utc_us - host_us)
    }

    /// The node's UTC in ns since 1970, up to [`CUT_NS`] too small.
    pub fn utc_ns(&self) -> Option<i64> {
        self.difference_us()?;
        i64::try_from(self.node_us).ok()?.checked_mul(1_000)
    }

    /// When the request's first byte must have arrived.
    pub fn window(&self) -> Window {
        let round_trip = nanos(self.round_trip).unsigned_abs();
        let (mut before, mut after) = self.bytes.own_time_ns();
        if before + after > round_trip {
            // The line does not have the rate that was given for it.
            (before, after) = (0, 0);
        }
        let half_ns = (round_trip - before - after) / 2;
        Window {
            middle_ns: self.sent_utc_ns + (before + half_ns).cast_signed(),
            half_ns: half_ns + CUT_NS / 2,
        }
    }
}

impl Bytes {
    /// How long a line needs at least for the first byte of the request, and for all that
    /// follows, in ns. Nothing, if its rate is not known.
    fn own_time_ns(&self) -> (u64, u64) {
        let Some(baud) = self.baud.filter(|&baud| baud > 0) else {
            return (0, 0);
        };
        // MAVLink's framing, and a PING's payload. An answer names the asker in its last bytes, so
        // version 2 cuts no zeros off.
        let answer = match self.answer {
            Version::V1 => 8 + 14,
            Version::V2 => 12 + 14,
        };
        let fastest = u64::from(baud) * (100 + FASTER_PERCENT) / 100;
        let time = |bytes: u64| bytes * BITS_PER_BYTE * 1_000_000_000 / fastest;
        (time(1), time(self.request as u64 - 1 + answer))
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let utc = i64::try_from(self.node_us)
            .ok()
            .map(Timestamp::from_microsecond);
        match (self.difference_us(), utc) {
            (Some(_), Some(Ok(utc))) => write!(f, "{utc:.6}")?,
            _ => write!(
                f,
                "clock not set, {:.6} s since boot",
                self.node_us as f64 / 1e6
            )?,
        }
        write!(
            f,
            "  round trip {:.3} ms",
            self.round_trip.as_secs_f64() * 1e3
        )?;
        match self.difference_us() {
            Some(us) => write!(f, "  difference {}", signed(us)),
            None => Ok(()),
        }
    }
}

/// A difference in µs as text: in ms to the µs, in s if it is large.
pub fn signed(us: i64) -> String {
    let (sign, size) = (units::sign(us), us.unsigned_abs() as f64);
    match us.unsigned_abs() {
        0..10_000_000 => format!("{sign}{:.3} ms", size / 1e3),
        _ => format!("{sign}{:.3} s", size / 1e6),
    }
}

/// In ns; what has no room is too long for any use of it.
fn nanos(duration: Duration) -> i64 {
    i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTC_NS: i64 = 1_795_320_000_000_000_000;

    fn answer(round_trip_us: u64, baud: Option<u32>) -> Answer {
        Answer {
            seq: 1,
            node_us: UTC_NS.unsigned_abs() / 1_000,
            round_trip: Duration::from_micros(round_trip_us),
            sent_utc_ns: UTC_NS,
            bytes: Bytes {
                request: 24,
                answer: Version::V2,
                baud,
            },
        }
    }

    #[test]
    fn without_a_rate_the_request_arrived_at_any_time_of_the_round_trip() {
        let window = answer(6_000, None).window();
        assert_eq!(window.middle_ns, UTC_NS + 3_000_000);
        assert_eq!(window.half_ns, 3_000_500);
    }

    #[test]
    fn the_bytes_own_time_is_taken_off_on_both_sides() {
        // 10 bits at 100 kBd and 5 % faster are 95.238 µs a byte; one byte before the moment,
        // 23 of the request and 26 of the answer after it.
        let window = answer(6_000, Some(100_000)).window();
        let (before, after) = (95_238, 4_666_666);
        assert_eq!(window.half_ns, (6_000_000 - before - after) / 2 + 500);
        assert_eq!(
            window.middle_ns - UTC_NS,
            (before + (6_000_000 - before - after) / 2).cast_signed()
        );
    }

    #[test]
    fn a_round_trip_that_is_too_short_for_its_bytes_has_no_such_rate() {
        let short = answer(1_000, Some(100_000)).window();
        assert_eq!(short, answer(1_000, None).window());
    }

    #[test]
    fn differences_are_written_to_the_us() {
        for (us, text) in [
            (-64_256, "−64.256 ms"),
            (46, "+0.046 ms"),
            (0, "0.000 ms"),
            (-12_000_000, "−12.000 s"),
        ] {
            assert_eq!(signed(us), text);
        }
    }
}
