//! #52011: the curve as the study that proposed it has it, 52 bytes without a presence vector.

use crate::bam::Bam;
use crate::place::Place;
use crate::refusal::Refusal;

/// What it is long. \[bytes\]
const LENGTH: usize = 52;

/// A curve in the study's form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudyCurve {
    /// When it was said. \[ms since 2000\]
    pub time_ms: f64,
    /// Who shall fly it.
    pub vehicle: u32,
    /// Who says it.
    pub station: u32,
    /// The number of the waypoint P1.
    pub p1: u16,
    /// The number of the waypoint P4.
    pub p4: u16,
    /// Latitude and longitude of P2 and of P3. \[rad\]
    pub handles: [[f64; 2]; 2],
}

impl StudyCurve {
    /// The number that we give to it.
    pub const NUMBER: u16 = 52_011;

    /// Reads its data.
    ///
    /// # Errors
    ///
    /// `Data` for another length, `NoPlace` when an angle is no number.
    pub fn read(data: &[u8]) -> Result<Self, Refusal> {
        let data: &[u8; LENGTH] = data.try_into().map_err(|_| Refusal::Data)?;
        let double = |at: usize| {
            let bytes = data.get(at..).and_then(<[u8]>::first_chunk);
            bytes.map_or(f64::NAN, |it| f64::from_be_bytes(*it))
        };
        let word = |at: usize| {
            let bytes = data.get(at..).and_then(<[u8]>::first_chunk);
            bytes.map_or(0, |it| u32::from_be_bytes(*it))
        };
        let handles = [[double(20), double(28)], [double(36), double(44)]];
        if !handles.as_flattened().iter().all(|it| it.is_finite()) {
            return Err(Refusal::NoPlace);
        }
        let waypoints = word(16);
        Ok(Self {
            time_ms: double(0),
            vehicle: word(8),
            station: word(12),
            p1: (waypoints >> 16) as u16,
            p4: waypoints as u16,
            handles,
        })
    }

    /// Its data.
    #[must_use]
    pub fn write(&self) -> [u8; LENGTH] {
        let [[a, b], [c, d]] = self.handles;
        let waypoints = u32::from(self.p1) << 16 | u32::from(self.p4);
        let mut data = [0; LENGTH];
        let words = [self.vehicle, self.station, waypoints].map(u32::to_be_bytes);
        let doubles = [a, b, c, d].map(f64::to_be_bytes);
        let time = self.time_ms.to_be_bytes();
        let all = time.iter().chain(words.as_flattened());
        for (to, from) in data.iter_mut().zip(all.chain(doubles.as_flattened())) {
            *to = *from;
        }
        data
    }

    /// P2 and P3, on the grid of 32 bits: at most 5 mm off in either axis.
    #[must_use]
    pub fn places(&self) -> [Place; 2] {
        self.handles.map(|[latitude, longitude]| Place {
            latitude: Bam::from_radians(latitude),
            longitude: Bam::from_radians(longitude),
        })
    }
}
