//! The way out of a link, whatever it goes over.

use crate::drivers::uart::Writer;
use crate::drivers::usb;

/// What frames go into.
pub trait Outgoing {
    /// Takes a whole frame, or none of it, and leaves `kept` bytes free; whether there was room.
    fn send_leaving(&mut self, frame: &[u8], kept: usize) -> bool;

    /// Bytes that have not left yet.
    fn waiting(&self) -> usize;

    /// Takes a whole frame, or none of it; whether there was room.
    fn send(&mut self, frame: &[u8]) -> bool {
        self.send_leaving(frame, 0)
    }
}

impl Outgoing for Writer {
    fn send_leaving(&mut self, frame: &[u8], kept: usize) -> bool {
        Self::send_leaving(self, frame, kept)
    }

    fn waiting(&self) -> usize {
        Self::waiting(self)
    }
}

impl Outgoing for usb::Outgoing {
    fn send_leaving(&mut self, frame: &[u8], kept: usize) -> bool {
        Self::send_leaving(self, frame, kept)
    }

    fn waiting(&self) -> usize {
        Self::waiting(self)
    }
}
