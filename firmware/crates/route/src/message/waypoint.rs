//! #13002, UA Position Waypoint.

use stanag_wire::{Builder, Layout, Values};

use crate::bam::Bam;
use crate::place::Place;
use crate::refusal::Refusal;

const LAYOUT: Layout = Layout {
    vector: 3,
    sizes: &[5, 2, 4, 4, 1, 3, 1, 1, 2, 1, 2, 1, 1, 1, 1, 2, 5, 3],
};
const TIME: usize = 0;
const NUMBER: usize = 1;
const LATITUDE: usize = 2;
const LONGITUDE: usize = 3;
const LOCATION: usize = 4;
const ALTITUDE: usize = 5;
const ALTITUDE_KIND: usize = 6;
const SPEED: usize = 8;
const SPEED_KIND: usize = 9;
const NEXT: usize = 10;
const TURN: usize = 11;

/// Location Type of a place by latitude and longitude.
const ABSOLUTE: u64 = 0;

/// A height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Altitude {
    /// \[2 cm\]
    pub height_2cm: i32,
    /// 0 pressure, 1 barometric, 2 above ground, 3 WGS-84.
    pub kind: u8,
}

/// How fast one goes there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Speed {
    /// \[0.5 m/s\]
    pub half_m_s: u16,
    /// 0 indicated, 1 true, 2 over ground, 3 so that the arrival time holds.
    pub kind: u8,
}

/// A waypoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waypoint {
    /// Time Stamp. \[ms since 2000\]
    pub time_ms: Option<u64>,
    /// Its number.
    pub number: u16,
    /// Where it is.
    pub place: Place,
    /// How high.
    pub altitude: Option<Altitude>,
    /// How fast.
    pub speed: Option<Speed>,
    /// The waypoint behind it; 0 says that it is the last.
    pub next: u16,
    /// 0 cuts the corner, 1 flies over it.
    pub turn: Option<u8>,
}

impl Waypoint {
    /// The message's number.
    pub const NUMBER: u16 = 13_002;

    /// Reads its data.
    ///
    /// # Errors
    ///
    /// `Data` when they are not as the presence vector says or have no number; `NoPlace` without a
    /// latitude or longitude, or when these are relative.
    pub fn read(data: &[u8]) -> Result<Self, Refusal> {
        let values = LAYOUT.values(data).map_err(|_| Refusal::Data)?;
        if values.unsigned(LOCATION).is_some_and(|it| it != ABSOLUTE) {
            return Err(Refusal::NoPlace);
        }
        let altitude = integer(&values, ALTITUDE).map(|height_2cm| Altitude {
            height_2cm,
            kind: unsigned(&values, ALTITUDE_KIND).unwrap_or_default(),
        });
        let speed = unsigned(&values, SPEED).map(|half_m_s| Speed {
            half_m_s,
            kind: unsigned(&values, SPEED_KIND).unwrap_or_default(),
        });
        Ok(Self {
            time_ms: values.unsigned(TIME),
            number: unsigned(&values, NUMBER).ok_or(Refusal::Data)?,
            place: place(&values, LATITUDE, LONGITUDE).ok_or(Refusal::NoPlace)?,
            altitude,
            speed,
            next: unsigned(&values, NEXT).unwrap_or_default(),
            turn: unsigned(&values, TURN),
        })
    }

    /// Its data.
    #[must_use]
    pub fn write(&self) -> Builder {
        let mut data = Builder::new(&LAYOUT);
        if let Some(time_ms) = self.time_ms {
            data.unsigned(TIME, time_ms);
        }
        data.unsigned(NUMBER, self.number.into());
        put_place(&mut data, LATITUDE, self.place);
        data.unsigned(LOCATION, ABSOLUTE);
        if let Some(Altitude { height_2cm, kind }) = self.altitude {
            data.integer(ALTITUDE, height_2cm.into());
            data.unsigned(ALTITUDE_KIND, kind.into());
        }
        if let Some(Speed { half_m_s, kind }) = self.speed {
            data.unsigned(SPEED, half_m_s.into());
            data.unsigned(SPEED_KIND, kind.into());
        }
        data.unsigned(NEXT, self.next.into());
        if let Some(turn) = self.turn {
            data.unsigned(TURN, turn.into());
        }
        data
    }
}

/// An unsigned number that fits its type.
pub(super) fn unsigned<T: TryFrom<u64>>(values: &Values<'_>, field: usize) -> Option<T> {
    values.unsigned(field)?.try_into().ok()
}

/// A signed number.
pub(super) fn integer(values: &Values<'_>, field: usize) -> Option<i32> {
    values.integer(field)?.try_into().ok()
}

/// A place of two fields.
pub(super) fn place(values: &Values<'_>, latitude: usize, longitude: usize) -> Option<Place> {
    Some(Place {
        latitude: Bam(integer(values, latitude)?),
        longitude: Bam(integer(values, longitude)?),
    })
}

/// Writes a place to the field `latitude` and the next.
pub(super) fn put_place(data: &mut Builder, latitude: usize, place: Place) {
    data.integer(latitude, place.latitude.0.into());
    data.integer(latitude + 1, place.longitude.0.into());
}
