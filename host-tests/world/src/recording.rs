//! The replay of a recording: what a real receiver once sent.
//!
//! *Purpose.* Real bytes on the simulated line, with times that stand to reason.
//!
//! *Design.* A recording has no arrival times of its own. So the bytes up to and
//! including each NAV-PVT leave together at 115200, spaced by the receiver's own
//! time of week; after the last one there is silence.
//!
//! *Limits.* A step of the time of week that is longer than a minute, as in a
//! cold start or at a seam of the file, counts as one second. What follows the
//! last whole NAV-PVT is not sent. It ignores what it receives.

use std::collections::VecDeque;

use crate::talker::{Sent, Talker, Transmission, WorldNanos, line_ns};
use crate::ubx;

const BAUD: u32 = 115_200;
const MS_PER_WEEK: u32 = 7 * 86_400_000;
const STEP_MAX_MS: u32 = 60_000;
const STEP_INSTEAD_MS: u32 = 1_000;
/// NAV-PVT's `valid`, and in it `validDate`, `validTime` and `fullyResolved`.
const NAV_PVT_VALID: usize = 11;
const RESOLVED: u8 = 7;
const NAV_TIMELS: (u8, u8) = (0x01, 0x26);

/// The file has no NAV-PVT in it, so that there is nothing to replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoNavPvt;

impl core::fmt::Display for NoNavPvt {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("no intact NAV-PVT frame of 92 bytes in it")
    }
}

impl std::error::Error for NoNavPvt {}

/// A burst that ends with a NAV-PVT.
#[derive(Clone, Debug)]
struct Burst {
    due: WorldNanos,
    bytes: Vec<u8>,
    /// Where in it the NAV-PVT begins.
    nav_pvt_at: usize,
    epoch_utc_ns: i64,
}

/// The replay of a UBX file.
#[derive(Clone, Debug)]
pub struct Recording {
    bursts: VecDeque<Burst>,
    line_free: WorldNanos,
    truth: Vec<Sent>,
    began_utc_ns: Option<i64>,
    has_leap_seconds: bool,
}

impl Recording {
    /// A replay of `file` whose first burst leaves at the world's start.
    ///
    /// # Errors
    ///
    /// [`NoNavPvt`] if there is none to be timed by.
    pub fn new(file: &[u8]) -> Result<Self, NoNavPvt> {
        let frames = ubx::find_frames(file, |class, id, length| {
            (class, id) == ubx::NAV_PVT && length == ubx::NAV_PVT_LEN
        });
        let mut began_utc_ns = None;
        let mut bursts = VecDeque::with_capacity(frames.len());
        let mut due = WorldNanos(0);
        let mut last_itow_ms = None;
        let mut from = 0;
        for frame in frames {
            let Some(payload) = frame.payload.first_chunk::<{ ubx::NAV_PVT_LEN }>() else {
                continue;
            };
            if payload[NAV_PVT_VALID] & RESOLVED == RESOLVED {
                began_utc_ns = began_utc_ns.or(Some(ubx::nav_pvt_epoch_utc_ns(payload)));
            }
            let itow_ms = u32::from_le_bytes([payload[0], payload[1], payload[2], payload[3]]);
            let step_ms = last_itow_ms.map_or(0, |last: u32| match itow_ms.checked_sub(last) {
                Some(step) => step,
                // Over the end of a week.
                None => itow_ms.wrapping_add(MS_PER_WEEK).wrapping_sub(last),
            });
            last_itow_ms = Some(itow_ms);
            let step_ms = if step_ms > STEP_MAX_MS {
                STEP_INSTEAD_MS
            } else {
                step_ms
            };
            due = due.plus(u64::from(step_ms) * 1_000_000);
            bursts.push_back(Burst {
                due,
                bytes: file[from..frame.end()].to_vec(),
                nav_pvt_at: frame.offset - from,
                epoch_utc_ns: ubx::nav_pvt_epoch_utc_ns(payload),
            });
            from = frame.end();
        }
        if bursts.is_empty() {
            return Err(NoNavPvt);
        }
        Ok(Self {
            bursts,
            line_free: WorldNanos(0),
            truth: Vec::new(),
            began_utc_ns,
            has_leap_seconds: !ubx::find_frames(file, |class, id, _| (class, id) == NAV_TIMELS)
                .is_empty(),
        })
    }

    /// The first epoch whose date and time the receiver claims to know, in ns of UTC since 1970.
    #[must_use]
    pub const fn began_utc_ns(&self) -> Option<i64> {
        self.began_utc_ns
    }

    /// Whether there is a NAV-TIMELS in it.
    #[must_use]
    pub const fn has_leap_seconds(&self) -> bool {
        self.has_leap_seconds
    }
}

impl Talker for Recording {
    fn next_event(&self) -> Option<WorldNanos> {
        Some(self.bursts.front()?.due.max(self.line_free))
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        let start = self.next_event()?;
        if start > now {
            return None;
        }
        let burst = self.bursts.pop_front()?;
        self.truth.push(Sent {
            epoch_utc_ns: burst.epoch_utc_ns,
            first_byte: start.plus(line_ns(burst.nav_pvt_at, BAUD)),
        });
        let transmission = Transmission {
            start,
            bytes: burst.bytes,
            baud: BAUD,
        };
        self.line_free = transmission.end();
        Some(transmission)
    }

    fn handle_bytes(&mut self, _: WorldNanos, _: u32, _: &[u8]) {}

    fn truth(&self) -> &[Sent] {
        &self.truth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ubx::Claims;

    const NOON_NS: i64 = 1_795_348_800_000_000_000;
    const CLAIMS: Claims = Claims {
        valid: 0x37,
        t_acc_ns: 20,
        fix_type: 3,
    };

    fn nav_pvt(ms_after_noon: i64) -> Vec<u8> {
        let (class, id) = ubx::NAV_PVT;
        let epoch_utc_ns = NOON_NS + ms_after_noon * 1_000_000;
        ubx::frame(class, id, &ubx::nav_pvt_payload(epoch_utc_ns, CLAIMS))
    }

    #[test]
    fn bursts_end_with_a_nav_pvt_and_keep_their_distance() {
        // Foreign bytes before the first; 200 ms; the same epoch twice; a gap of
        // an hour; and a tail that has no NAV-PVT to leave with.
        let mut file = b"# a comment\n".to_vec();
        for ms in [0, 200, 200, 3_600_000] {
            file.extend(nav_pvt(ms));
        }
        file.extend(&nav_pvt(3_600_200)[..99]);
        let mut recording = Recording::new(&file).unwrap();
        let mut starts = Vec::new();
        let mut bytes = Vec::new();
        while let Some(at) = recording.next_event() {
            let burst = recording.poll(at).unwrap();
            assert_eq!((burst.start, burst.baud), (at, 115_200));
            starts.push(at.0);
            bytes.extend(burst.bytes);
        }
        // A 100-byte frame lasts 8.68 ms at 115200.
        assert_eq!(starts, [0, 200_000_000, 208_680_555, 1_200_000_000]);
        assert_eq!(bytes, file[..412]);
        assert_eq!(recording.truth().len(), 4);
        // The comment's 12 bytes come first.
        assert_eq!(recording.truth()[0].first_byte, WorldNanos(1_041_666));
        assert_eq!(
            recording.truth()[3].epoch_utc_ns,
            NOON_NS + 3_600_000_000_000
        );
    }

    #[test]
    fn it_begins_with_the_first_date_that_is_claimed() {
        let cold = Claims {
            valid: 0x33,
            ..CLAIMS
        };
        let (class, id) = ubx::NAV_PVT;
        let unresolved = ubx::frame(class, id, &ubx::nav_pvt_payload(0, cold));
        let recording = Recording::new(&unresolved).unwrap();
        assert_eq!(recording.began_utc_ns(), None);
        let mut file = [unresolved, nav_pvt(0), nav_pvt(200)].concat();
        let recording = Recording::new(&file).unwrap();
        assert_eq!(recording.began_utc_ns(), Some(NOON_NS));
        assert!(!recording.has_leap_seconds());
        file.extend(ubx::frame(0x01, 0x26, &[0; 24]));
        assert!(Recording::new(&file).unwrap().has_leap_seconds());
    }

    #[test]
    fn the_week_may_end() {
        // 2026-11-21T23:59:41.8 UTC is 0.2 s before the end of the GPS week.
        let first = -(12 * 3_600_000 + 18_200);
        let file = [nav_pvt(first), nav_pvt(first + 200)].concat();
        let mut recording = Recording::new(&file).unwrap();
        assert!(recording.poll(WorldNanos(0)).is_some());
        assert_eq!(recording.next_event(), Some(WorldNanos(200_000_000)));
    }

    #[test]
    fn nothing_to_replay_is_refused() {
        assert_eq!(Recording::new(b"$GPRMC,").err(), Some(NoNavPvt));
    }
}
