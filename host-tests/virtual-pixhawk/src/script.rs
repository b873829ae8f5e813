//! What a script sends, and when.
//!
//! *Purpose.* A [`Talker`] for tests: bytes at given moments, to the nanosecond.
//!
//! *Design.* A list in the order of time. What the board answers is kept with its
//! moments by the board itself.
//!
//! *Limits.* It does not listen.

use std::collections::VecDeque;

use world::{Sent, Talker, Transmission, WorldNanos};

/// Transmissions at given moments.
#[derive(Clone, Debug, Default)]
pub struct Script(VecDeque<Transmission>);

impl Script {
    /// A script of `transmissions`, which are put in the order of their starts.
    #[must_use]
    pub fn new(transmissions: impl IntoIterator<Item = Transmission>) -> Self {
        let mut ordered: Vec<_> = transmissions.into_iter().collect();
        ordered.sort_by_key(|transmission| transmission.start);
        Self(ordered.into())
    }
}

impl Talker for Script {
    fn next_event(&self) -> Option<WorldNanos> {
        self.0.front().map(|next| next.start)
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        self.0.pop_front_if(|next| next.start <= now)
    }

    fn handle_bytes(&mut self, _: WorldNanos, _: u32, _: &[u8]) {}

    fn truth(&self) -> &[Sent] {
        &[]
    }
}
