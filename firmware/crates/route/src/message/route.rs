//! #13001, UA Route: which waypoint a route begins with.

use stanag_wire::{Builder, Layout};

use super::waypoint::unsigned;
use crate::refusal::Refusal;

const LAYOUT: Layout = Layout {
    vector: 1,
    sizes: &[5, 2, 33, 1, 3],
};
const TIME: usize = 0;
const INITIAL: usize = 1;
const ID: usize = 2;
const KIND: usize = 3;

/// The longest name of a route, without the NUL that ends it. \[bytes\]
const MAX_ID: usize = 32;

/// A route.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RouteMessage {
    /// Time Stamp. \[ms since 2000\]
    pub time_ms: Option<u64>,
    /// Its first waypoint; 0 deletes the route.
    pub initial: u16,
    /// Its name, up to 32 bytes with NULs behind it.
    pub id: [u8; MAX_ID],
    /// 0 launch, 1 approach, 2 flight, 3 and 4 contingencies.
    pub kind: u8,
}

impl RouteMessage {
    /// The message's number.
    pub const NUMBER: u16 = 13_001;

    /// Reads its data.
    ///
    /// # Errors
    ///
    /// `Data` when they are not as the presence vector says, or the initial waypoint is missing.
    pub fn read(data: &[u8]) -> Result<Self, Refusal> {
        let values = LAYOUT.values(data).map_err(|_| Refusal::Data)?;
        let initial = unsigned(&values, INITIAL).ok_or(Refusal::Data)?;
        let id = values.bytes(ID).and_then(<[u8]>::first_chunk);
        Ok(Self {
            time_ms: values.unsigned(TIME),
            initial,
            id: id.copied().unwrap_or_default(),
            kind: unsigned(&values, KIND).unwrap_or_default(),
        })
    }

    /// Its data.
    #[must_use]
    pub fn write(&self) -> Builder {
        let mut data = Builder::new(&LAYOUT);
        if let Some(time_ms) = self.time_ms {
            data.unsigned(TIME, time_ms);
        }
        data.unsigned(INITIAL, self.initial.into());
        data.bytes(ID, &self.id);
        data.unsigned(KIND, self.kind.into());
        data
    }
}
