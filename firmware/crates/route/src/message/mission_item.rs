//! A curve in MAVLink: two items for its handles, then the waypoint that it arrives at.
//!
//! *Design.* MAV_CMD_SPATIAL_USER_1 and _2 are items with a place that a ground station does not draw
//! as flown through; an autopilot that does not know them refuses the mission and flies nothing else.

use core::f64::consts::PI;

use crate::bam::Bam;
use crate::curve::Curve;
use crate::place::Place;
use crate::refusal::Refusal;

/// MISSION_ITEM_INT without its extension. \[bytes\]
const LENGTH: usize = 37;
/// Degrees of MAVLink's places to the radian. \[1e-7°\]
const UNITS: f64 = 180e7 / PI;

/// What of a MISSION_ITEM_INT says a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MissionItem {
    /// Its place in the mission, from 0.
    pub sequence: u16,
    /// MAV_CMD.
    pub command: u16,
    /// MAV_FRAME of the height.
    pub frame: u8,
    /// \[1e-7°\]
    pub latitude: i32,
    /// \[1e-7°\]
    pub longitude: i32,
    /// \[m\]
    pub height_m: f32,
}

impl MissionItem {
    /// MAV_CMD_NAV_WAYPOINT.
    pub const WAYPOINT: u16 = 16;
    /// MAV_CMD_SPATIAL_USER_1: P2, the handle of the waypoint before.
    pub const HANDLE_2: u16 = 31_005;
    /// MAV_CMD_SPATIAL_USER_2: P3, the handle of the waypoint behind.
    pub const HANDLE_3: u16 = 31_006;

    /// The payload for a system and its component, the item being one of a mission's own.
    #[must_use]
    pub fn write(&self, system: u8, component: u8) -> [u8; LENGTH] {
        let [la, lb, lc, ld] = self.latitude.to_le_bytes();
        let [oa, ob, oc, od] = self.longitude.to_le_bytes();
        let [ha, hb, hc, hd] = self.height_m.to_le_bytes();
        let [sa, sb] = self.sequence.to_le_bytes();
        let [ca, cb] = self.command.to_le_bytes();
        // The four parameters of the command; then not the current item, and on to the next by itself.
        let place = [la, lb, lc, ld, oa, ob, oc, od, ha, hb, hc, hd];
        let rest = [sa, sb, ca, cb, system, component, self.frame, 0, 1];
        let mut payload = [0; LENGTH];
        for (to, from) in payload.iter_mut().skip(16).zip(place.iter().chain(&rest)) {
            *to = *from;
        }
        payload
    }

    /// Reads a payload, from which MAVLink 2 may have taken the zeros at its end.
    ///
    /// # Errors
    ///
    /// `Data` for one that is longer than the message with its extension, 38 bytes.
    pub fn read(payload: &[u8]) -> Result<Self, Refusal> {
        if payload.len() > LENGTH + 1 {
            return Err(Refusal::Data);
        }
        let byte = |at: usize| payload.get(at).copied().unwrap_or(0);
        let word = |at: usize| [byte(at), byte(at + 1), byte(at + 2), byte(at + 3)];
        let half = |at: usize| u16::from_le_bytes([byte(at), byte(at + 1)]);
        Ok(Self {
            latitude: i32::from_le_bytes(word(16)),
            longitude: i32::from_le_bytes(word(20)),
            height_m: f32::from_le_bytes(word(24)),
            sequence: half(28),
            command: half(30),
            frame: byte(34),
        })
    }

    /// Where it is, to half a unit of either scale: 6 mm and 5 mm.
    #[must_use]
    pub fn place(&self) -> Place {
        let bam = |units| Bam::from_radians(f64::from(units) / UNITS);
        Place {
            latitude: bam(self.latitude),
            longitude: bam(self.longitude),
        }
    }
}

/// The items that say the curve to P4: P2, P3, P4, the first of them `sequence`.
#[must_use]
pub fn curve_items(
    places: [Place; 3],
    height_m: f32,
    frame: u8,
    sequence: u16,
) -> [MissionItem; 3] {
    let [p2, p3, p4] = places;
    let item = |after: u16, command, place: Place| MissionItem {
        sequence: sequence.wrapping_add(after),
        command,
        frame,
        latitude: libm::round(place.latitude.radians() * UNITS) as i32,
        longitude: libm::round(place.longitude.radians() * UNITS) as i32,
        height_m,
    };
    [
        item(0, MissionItem::HANDLE_2, p2),
        item(1, MissionItem::HANDLE_3, p3),
        item(2, MissionItem::WAYPOINT, p4),
    ]
}

/// The curve from the waypoint `p1` that three items say.
///
/// # Errors
///
/// `NotNext` when they are not P2, P3 and a waypoint that follow each other; `Latitude` beyond 85°.
pub fn curve_of_items(p1: &MissionItem, items: &[MissionItem; 3]) -> Result<Curve, Refusal> {
    let commands = [
        p1.command,
        items[0].command,
        items[1].command,
        items[2].command,
    ];
    let expected = [
        MissionItem::WAYPOINT,
        MissionItem::HANDLE_2,
        MissionItem::HANDLE_3,
        MissionItem::WAYPOINT,
    ];
    let follow = items.iter().zip(1..);
    let mut follow = follow.map(|(it, after)| it.sequence == p1.sequence.wrapping_add(after));
    if commands != expected || !follow.all(|it| it) {
        return Err(Refusal::NotNext);
    }
    let [p2, p3, p4] = items;
    Curve::new([p1, p2, p3, p4].map(MissionItem::place))
}
