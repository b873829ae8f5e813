//! How a crystal starts.

/// The crystal does not start.
#[derive(Clone, Copy, Debug)]
pub struct CrystalFailed;

/// When the crystal was ready.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrystalStart {
    /// As its kind is.
    InTime,
    #[cfg_attr(
        feature = "qemu",
        expect(dead_code, reason = "this machine's crystal is there at once")
    )]
    /// So late that it, its capacitors or the board is to be looked at.
    Late {
        /// After this. \[µs\]
        after_us: u32,
    },
}
