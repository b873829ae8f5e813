//! Who a node is.

use stanag_wire::NodeId;

/// Who a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Its id.
    pub id: NodeId,
    /// The firmware's version: major, minor, patch.
    pub version: [u8; 3],
    /// The first 32 bits of its commit's hash.
    pub git_hash: u32,
    /// The board's number, as AUTOPILOT_VERSION has it.
    pub board: u16,
}
