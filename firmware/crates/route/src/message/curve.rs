//! #52010 and #52012: a curve between two waypoints, in a private message of Edition 3's form.

use stanag_wire::{Builder, Layout};

use super::waypoint::{Waypoint, integer, place, put_place, unsigned};
use crate::curve::Curve;
use crate::place::Place;
use crate::refusal::Refusal;

/// #52010 has the first seven.
const FLAT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 2, 4, 4, 4, 4],
};
const SOLID: Layout = Layout {
    vector: 2,
    sizes: &[5, 2, 2, 4, 4, 4, 4, 3, 3],
};
const TIME: usize = 0;
const P1: usize = 1;
const P4: usize = 2;
const P2_PLACE: usize = 3;
const P3_PLACE: usize = 5;
const P2_ALTITUDE: usize = 7;
const P3_ALTITUDE: usize = 8;

/// The handles of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Handles {
    /// P2 and P3.
    pub places: [Place; 2],
    /// Their heights, where the curve has some. \[2 cm\]
    pub heights_2cm: Option<[i32; 2]>,
}

/// A curve between two waypoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurveMessage {
    /// Time Stamp. \[ms since 2000\]
    pub time_ms: Option<u64>,
    /// The number of the waypoint P1.
    pub p1: u16,
    /// The number of the waypoint P4.
    pub p4: u16,
    /// What is between them.
    pub handles: Handles,
}

impl CurveMessage {
    /// The number of the message without altitudes.
    pub const FLAT: u16 = 52_010;
    /// The number of the one with altitudes.
    pub const SOLID: u16 = 52_012;

    /// The number of this message.
    #[must_use]
    pub const fn number(&self) -> u16 {
        match self.handles.heights_2cm {
            None => Self::FLAT,
            Some(_) => Self::SOLID,
        }
    }

    /// Reads the data of the message of that number.
    ///
    /// # Errors
    ///
    /// `Data` when they are not as the presence vector says or have no waypoint's number, or for
    /// another message; `NoPlace` without a handle's place or height.
    pub fn read(number: u16, data: &[u8]) -> Result<Self, Refusal> {
        let layout = match number {
            Self::FLAT => &FLAT,
            Self::SOLID => &SOLID,
            _ => return Err(Refusal::Data),
        };
        let values = layout.values(data).map_err(|_| Refusal::Data)?;
        let handle = |at| place(&values, at, at + 1).ok_or(Refusal::NoPlace);
        let height = |at| integer(&values, at).ok_or(Refusal::NoPlace);
        let waypoint = |at| unsigned(&values, at).ok_or(Refusal::Data);
        let heights_2cm = match number {
            Self::FLAT => None,
            _ => Some([height(P2_ALTITUDE)?, height(P3_ALTITUDE)?]),
        };
        Ok(Self {
            time_ms: values.unsigned(TIME),
            p1: waypoint(P1)?,
            p4: waypoint(P4)?,
            handles: Handles {
                places: [handle(P2_PLACE)?, handle(P3_PLACE)?],
                heights_2cm,
            },
        })
    }

    /// Its data.
    #[must_use]
    pub fn write(&self) -> Builder {
        let heights_2cm = self.handles.heights_2cm;
        let mut data = Builder::new(if heights_2cm.is_some() { &SOLID } else { &FLAT });
        if let Some(time_ms) = self.time_ms {
            data.unsigned(TIME, time_ms);
        }
        data.unsigned(P1, self.p1.into());
        data.unsigned(P4, self.p4.into());
        let [p2, p3] = self.handles.places;
        put_place(&mut data, P2_PLACE, p2);
        put_place(&mut data, P3_PLACE, p3);
        if let Some([p2, p3]) = heights_2cm {
            data.integer(P2_ALTITUDE, p2.into());
            data.integer(P3_ALTITUDE, p3.into());
        }
        data
    }

    /// The curve that it lays between two waypoints.
    ///
    /// # Errors
    ///
    /// `NotNext` when these are not its own, or P1's next is not P4; `Latitude` beyond 85°.
    pub fn between(&self, p1: &Waypoint, p4: &Waypoint) -> Result<Curve, Refusal> {
        if (self.p1, self.p4) != (p1.number, p4.number) || p1.next != p4.number {
            return Err(Refusal::NotNext);
        }
        let [p2, p3] = self.handles.places;
        Curve::new([p1.place, p2, p3, p4.place])
    }
}
