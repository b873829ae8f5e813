//! Who speaks and who is spoken to.

use core::fmt;

/// The id of a vehicle, its adapter or a station: 4 bytes, the first its owner's country.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeId(pub u32);

impl NodeId {
    /// Everybody.
    pub const BROADCAST: Self = Self(0xFFFF_FFFF);
    /// Nobody.
    pub const NULL: Self = Self(0xFF00_0000);
}

/// As the standard writes it: `00:50:43:01`.
impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d] = self.0.to_be_bytes();
        write!(f, "{a:02X}:{b:02X}:{c:02X}:{d:02X}")
    }
}
