//! Frames that wait for their packets: filled and drained by one task.
//!
//! *Design.* What waits is one piece, so that a packet is made of it in place. When there is no room behind it,
//! it moves to the front, which costs less than a ring whose end lies in the middle of a frame.

/// The box.
pub struct Outbox {
    bytes: &'static mut [u8],
    begin: usize,
    end: usize,
}

impl Outbox {
    /// An empty one that holds as many bytes as `bytes` has.
    pub const fn new(bytes: &'static mut [u8]) -> Self {
        Self {
            bytes,
            begin: 0,
            end: 0,
        }
    }

    /// Bytes that wait.
    pub const fn len(&self) -> usize {
        self.end - self.begin
    }

    /// Bytes that have room.
    pub const fn room(&self) -> usize {
        self.bytes.len() - self.len()
    }

    /// Puts `frame` behind the others; whether there was room.
    pub fn push(&mut self, frame: &[u8]) -> bool {
        if self.room() < frame.len() {
            return false;
        }
        if self.bytes.len() - self.end < frame.len() {
            self.bytes.copy_within(self.begin..self.end, 0);
            self.end -= self.begin;
            self.begin = 0;
        }
        let end = self.end + frame.len();
        self.bytes[self.end..end].copy_from_slice(frame);
        self.end = end;
        true
    }

    /// The first bytes, at most `most`.
    pub fn front(&self, most: usize) -> &[u8] {
        let end = self.end.min(self.begin + most);
        &self.bytes[self.begin..end]
    }

    /// Drops the first `count` bytes, or all.
    pub const fn drop_front(&mut self, count: usize) {
        self.begin += if count < self.len() {
            count
        } else {
            self.len()
        };
        if self.begin == self.end {
            self.clear();
        }
    }

    /// Drops everything.
    pub const fn clear(&mut self) {
        self.begin = 0;
        self.end = 0;
    }
}
