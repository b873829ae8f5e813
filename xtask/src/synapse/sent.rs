//! 20 s of what a board sends, through their decoder.
//!
//! *Design.* A board of `sim --stanag` begins at a known UTC, so the epochs of its simulated receiver are
//! known, too: the same receiver is run here. A station in its group asks once a second for what is
//! answered, and every datagram of the board goes to their decoder. #4000 has to be at one of those epochs,
//! rounded down to the ms, and where the receiver is.
//!
//! *Limits.* 20 s are those of the board's heartbeats: a busy machine plays them more slowly.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, ensure};
use jiff::Timestamp;
use serde_json::Value;
use stanag_net::station::{self, TOOLS};
use stanag_net::{Group, Place};
use stanag_node::message as m;
use stanag_wire::{Frame, NodeId, TimeStamp};
use world::{Arrivals, Port, ReceiverSettings, ubx};

use super::decoder::{Decoder, Theirs};
use crate::venv::Board;

/// The board's day; its crystal and its receiver are board 1's of `sim`.
const START: &str = "2026-11-28T06:40:00.123Z";
const BOARD: NodeId = NodeId(0x0050_4301);
/// A place and a port of its own: other steps of CI run beside it.
const PLACE: &str = "239.255.45.86:51018";
const MAVLINK_PORT: u16 = 5_793;
/// How long is judged, by the board's heartbeats. \[ms\]
const JUDGED_MS: i64 = 20_000;
/// Within that time all of it has to be there, and the emulator built.
const PATIENCE: Duration = Duration::from_secs(600);
/// How long the board runs at most. \[s\]
const DURATION_S: &str = "180";
/// How old a position may be when it is sent: one of 5 epochs a second and its way here, in the report that the
/// board's tasks leave each other once a second. \[ms\]
const OLDEST_MS: i64 = 1_300;
/// A BAM of 32 bits. \[rad\]
const BAM: f64 = PI / 2_147_483_648.0;
/// Units of altitude and speed. \[m\], \[m/s\]
const ALTITUDE: f64 = 0.02;
const SPEED: f64 = 0.05;

/// Lets them judge.
///
/// # Errors
///
/// Says what is not as it has to be.
pub fn judge(decoder: &mut Decoder) -> Result<()> {
    let place: Place = PLACE.parse().map_err(anyhow::Error::msg)?;
    let mut group = Group::station(place)?;
    group.set_patience(Some(Duration::from_millis(20)))?;
    let port = MAVLINK_PORT.to_string();
    let _board = Board::start_with(
        "sim",
        &port,
        DURATION_S,
        &["--stanag", PLACE, "--start", START],
    )?;
    let start: Timestamp = START.parse()?;
    let start_ns = i64::try_from(start.as_nanosecond())?;
    let mut seen = Seen::new(start_ns);
    let (begun, mut asked) = (Instant::now(), None::<Instant>);
    let (mut sequence, mut buffer) = (0, [0; 2_048]);
    while !seen.is_all() {
        ensure!(
            begun.elapsed() < PATIENCE,
            "after {PATIENCE:?} there were {:?}",
            seen.kinds
        );
        if asked.is_none_or(|asked| asked.elapsed() > Duration::from_secs(1)) {
            sequence += 1;
            asked = Some(Instant::now());
            for request in [
                station::discovery(TOOLS),
                station::heartbeat(TOOLS, BOARD, start_ns),
                station::clock_request(TOOLS, BOARD, start_ns, sequence),
            ] {
                group.send(&request);
            }
        }
        if let Some(datagram) = group.receive(&mut buffer)? {
            let theirs = decoder
                .decode(datagram)?
                .context("they refuse a datagram")?;
            for frame in &theirs {
                seen.push(frame)?;
            }
            seen.heartbeat(datagram)?;
        }
    }
    for message in [
        m::AUTHORISATION_RESPONSE,
        m::VEHICLE_ID,
        m::INERTIAL_STATES,
        m::ACKNOWLEDGEMENT,
        m::CLOCK_REPORT,
    ] {
        let count = seen.kinds.get(&message.into()).copied().unwrap_or(0);
        ensure!(count >= 15, "{count} × #{message}: {}", seen.summary());
    }
    console::print_line!(
        "  20 s of `sim --stanag`, without a defect: {}",
        seen.summary()
    );
    Ok(())
}

/// What was seen, and what the receiver of this board has to say.
struct Seen {
    /// Time Stamps that a position may have. \[ms since 1970\]
    epochs_ms: BTreeSet<i64>,
    /// Where it is: see [`fix`].
    fix: [f64; 6],
    start_ns: i64,
    /// Frames of each message.
    kinds: BTreeMap<u64, usize>,
    /// Time Stamps of the first heartbeat and the last. \[ms since 1970\]
    heartbeats_ms: Option<(i64, i64)>,
    positions: usize,
}

impl Seen {
    fn new(start_ns: i64) -> Self {
        let settings = ReceiverSettings {
            port: Port::CONFIGURED,
            ..ReceiverSettings::new(start_ns)
        };
        let epochs = Arrivals::new(&settings).map(|arrival| arrival.epoch_utc_ns);
        let end_ns = start_ns + 200_000_000_000;
        let epochs = epochs.take_while(|epoch_ns| *epoch_ns < end_ns);
        Self {
            epochs_ms: epochs.map(|ns| ns.div_euclid(1_000_000)).collect(),
            fix: fix(start_ns),
            start_ns,
            kinds: BTreeMap::new(),
            heartbeats_ms: None,
            positions: 0,
        }
    }

    fn is_all(&self) -> bool {
        self.heartbeats_ms
            .is_some_and(|(first, last)| last - first >= JUDGED_MS)
    }

    fn push(&mut self, frame: &Theirs) -> Result<()> {
        if frame.source == u64::from(TOOLS.0) {
            return Ok(());
        }
        ensure!(
            frame.source == u64::from(BOARD.0),
            "somebody else is here: {frame:?}"
        );
        ensure!(frame.defects.is_empty(), "{frame:?}");
        *self.kinds.entry(frame.message).or_default() += 1;
        if frame.message == u64::from(m::INERTIAL_STATES) {
            let fields = frame.fields.as_ref().context("they know #4000")?;
            ensure!(fields["trailing"] == 0, "{fields}");
            let judged = self.position(&fields["values"]);
            judged.with_context(|| fields.to_string())?;
        }
        Ok(())
    }

    /// Its fields as they read them, with their scales.
    fn position(&mut self, values: &Value) -> Result<()> {
        let value = |field: usize| values[field.to_string()]["value"].as_f64();
        let is_near = |field: usize, wanted: f64, unit: f64| {
            // Half a unit, and what 64-bit floats round.
            value(field).is_some_and(|it| (it - wanted).abs() <= unit * 0.500_001)
        };
        let [latitude, longitude, height, speeds @ ..] = self.fix;
        ensure!(is_near(2, latitude, BAM), "latitude {latitude}");
        ensure!(is_near(3, longitude, BAM), "longitude {longitude}");
        ensure!(is_near(4, height, ALTITUDE), "altitude {height}");
        ensure!(value(5) == Some(3.0), "Altitude Type");
        for (field, speed) in (6..).zip(speeds) {
            ensure!(is_near(field, speed, SPEED), "speed {speed}");
        }
        // The first may come before the clock is set: without a Time Stamp.
        let Some(stamp) = values["1"]["value"].as_str() else {
            ensure!(self.positions == 0, "a set clock, and no Time Stamp");
            return Ok(());
        };
        let stamp: Timestamp = stamp.parse()?;
        let stamp_ms = stamp.as_millisecond();
        ensure!(self.epochs_ms.contains(&stamp_ms), "{stamp} is no epoch");
        if let Some((_, now_ms)) = self.heartbeats_ms {
            let age_ms = now_ms - stamp_ms;
            ensure!(
                (0..OLDEST_MS).contains(&age_ms),
                "{stamp} is {age_ms} ms old"
            );
        }
        self.positions += 1;
        Ok(())
    }

    /// Which time it is for the board.
    fn heartbeat(&mut self, datagram: &[u8]) -> Result<()> {
        let (frame, _) = Frame::read(datagram)?;
        if frame.header.message != m::HEARTBEAT || frame.header.source != BOARD {
            return Ok(());
        }
        let Some(ms) = m::HEARTBEAT_LAYOUT.values(frame.data)?.unsigned(0) else {
            return Ok(());
        };
        let stamp = TimeStamp { ms, fraction_ns: 0 };
        let utc_ns = stamp
            .unix_ns(self.start_ns)
            .context("a Time Stamp of 5 bytes")?;
        let now_ms = utc_ns / 1_000_000;
        let (first_ms, _) = *self.heartbeats_ms.get_or_insert((now_ms, now_ms));
        self.heartbeats_ms = Some((first_ms, now_ms));
        Ok(())
    }

    fn summary(&self) -> String {
        let kinds = self
            .kinds
            .iter()
            .map(|(message, count)| format!("{count} × #{message}"));
        kinds.collect::<Vec<_>>().join(", ")
    }
}

/// Where the simulated receiver says that it is, out of its own NAV-PVT: latitude and longitude \[rad\],
/// height above the ellipsoid \[m\], speeds north, east and down \[m/s\].
fn fix(epoch_ns: i64) -> [f64; 6] {
    let claims = ubx::Claims {
        valid: 0x37,
        t_acc_ns: 22,
        fix_type: 3,
    };
    let payload = ubx::nav_pvt_payload(epoch_ns, claims);
    let at = |at: usize| {
        let bytes = payload[at..].first_chunk().copied().unwrap_or_default();
        f64::from(i32::from_le_bytes(bytes))
    };
    let angle = |at_byte: usize| (at(at_byte) * 1e-7).to_radians();
    let metres = |at_byte: usize| at(at_byte) / 1e3;
    [
        angle(28),
        angle(24),
        metres(32),
        metres(48),
        metres(52),
        metres(56),
    ]
}
