//! The far end of the receiver's line, as its driver sees it.
//!
//! *Purpose.* One interface for simulated, replayed and damaged receivers.
//!
//! *Design.* The driver looks at [`Talker::next_event`], lets its world come to
//! that moment, and polls. A [`Transmission`] leaves without gaps; two of them
//! never overlap.
//!
//! *Limits.* 8N1 only: ten bits a byte.

/// Bits that a byte takes on the line: start, eight of data, stop.
const BITS_PER_BYTE: u64 = 10;

/// Nanoseconds of true time since the world's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorldNanos(pub u64);

impl WorldNanos {
    /// `self` and `ns` later; stops at `u64::MAX`.
    #[must_use]
    pub const fn plus(self, ns: u64) -> Self {
        Self(self.0.saturating_add(ns))
    }
}

/// Bytes that leave in one burst, each right behind the one before it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transmission {
    /// When the start bit of the first byte begins.
    pub start: WorldNanos,
    /// The bytes, in their order.
    pub bytes: Vec<u8>,
    /// The speed of the line. \[bits a second\]
    pub baud: u32,
}

impl Transmission {
    /// When the stop bit of byte `index` ends: the moment at which a UART has
    /// received it. Byte `n` starts where byte `n − 1` ends.
    #[must_use]
    pub fn byte_end(&self, index: usize) -> WorldNanos {
        self.start.plus(line_ns(index + 1, self.baud))
    }

    /// When the line is free again.
    #[must_use]
    pub fn end(&self) -> WorldNanos {
        self.start.plus(line_ns(self.bytes.len(), self.baud))
    }
}

/// How long `bytes` bytes take at `baud`, in ns, rounded down.
pub(crate) fn line_ns(bytes: usize, baud: u32) -> u64 {
    bytes as u64 * BITS_PER_BYTE * 1_000_000_000 / u64::from(baud.max(1))
}

/// The truth about one NAV-PVT that was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// The epoch in its fields, UTC since 1970. \[ns\]
    pub epoch_utc_ns: i64,
    /// When the start bit of its first byte began.
    pub first_byte: WorldNanos,
}

/// What sits at the far end of the GPS line.
pub trait Talker {
    /// When [`Talker::poll`] has something next; `None` when it never will unless
    /// it receives something.
    fn next_event(&self) -> Option<WorldNanos>;

    /// What begins to leave at `now` or should have begun before, one
    /// transmission a call: call until it is `None`. It may be `None` at once:
    /// an event can pass without a byte.
    fn poll(&mut self, now: WorldNanos) -> Option<Transmission>;

    /// `bytes` from the board have arrived at `now`; they were sent at `baud`.
    fn handle_bytes(&mut self, now: WorldNanos, baud: u32, bytes: &[u8]);

    /// Every NAV-PVT handed out so far, in its order.
    fn truth(&self) -> &[Sent];
}

impl<T: Talker + ?Sized> Talker for Box<T> {
    fn next_event(&self) -> Option<WorldNanos> {
        (**self).next_event()
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        (**self).poll(now)
    }

    fn handle_bytes(&mut self, now: WorldNanos, baud: u32, bytes: &[u8]) {
        (**self).handle_bytes(now, baud, bytes);
    }

    fn truth(&self) -> &[Sent] {
        (**self).truth()
    }
}
