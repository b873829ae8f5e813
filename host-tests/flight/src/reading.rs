//! What a clock said at one moment.

use world::WorldPicos;

/// From reading to reading, the first at 0: 37 ms, which beats with no rate of a
/// receiver's.
pub const READ_EVERY: WorldPicos = WorldPicos::from_millis(37);

/// The state's word while nothing is claimed.
pub const UNSET: &str = "unset";

/// What a clock said at a moment of true time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The moment.
    pub at: WorldPicos,
    /// UTC since 1970, in ns; `None` while the clock is unset.
    pub utc_ns: Option<i64>,
    /// How far UTC may be from it, in ns to either side; `None` while the clock is
    /// unset.
    pub uncertainty_ns: Option<u64>,
    /// The state, in one word; [`UNSET`] while the clock is unset.
    pub state: &'static str,
    /// What steers it, in one word.
    pub source: &'static str,
}

impl Reading {
    /// What an unset clock says.
    #[must_use]
    pub const fn unset(at: WorldPicos, source: &'static str) -> Self {
        Self {
            at,
            utc_ns: None,
            uncertainty_ns: None,
            state: UNSET,
            source,
        }
    }

    /// What it claims: UTC and its uncertainty, both in ns; nothing while unset.
    #[must_use]
    pub fn claim(&self) -> Option<(i64, u64)> {
        self.utc_ns.zip(self.uncertainty_ns)
    }
}
