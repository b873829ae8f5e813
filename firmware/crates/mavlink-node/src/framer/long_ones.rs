//! Candidates with longer payloads than are known: few are awaited, because noise could make many.

/// Candidates with longer payloads than are known that are awaited at once.
const LONG_ONES: usize = 3;

/// Candidates with longer payloads than are known, in no order.
#[derive(Debug)]
pub(super) struct LongOnes {
    windows: [Window; LONG_ONES],
    pub(super) count: usize,
}

/// A stretch of the stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) start: u32,
    pub(super) length: u16,
}

impl Window {
    pub(super) const fn end(self) -> u32 {
        self.start.wrapping_add(self.length as u32)
    }
}

impl LongOnes {
    pub(super) const NONE: Self = Self {
        windows: [Window {
            start: 0,
            length: 0,
        }; LONG_ONES],
        count: 0,
    };

    /// Adds a window. Whether there was room.
    #[inline]
    pub(super) fn push(&mut self, window: Window) -> bool {
        let Some(place) = self.windows.get_mut(self.count) else {
            return false;
        };
        *place = window;
        self.count += 1;
        true
    }

    /// Takes out one that ends at `now`.
    pub(super) fn pop(&mut self, now: u32) -> Option<Window> {
        let some = self.windows.get(..self.count)?;
        let place = some.iter().position(|window| window.end() == now)?;
        let last = *some.last()?;
        let window = core::mem::replace(self.windows.get_mut(place)?, last);
        self.count -= 1;
        Some(window)
    }

    /// The least distance from `now` to an end.
    pub(super) fn until_end(&self, now: u32) -> Option<u32> {
        let some = self.windows.get(..self.count)?;
        some.iter()
            .map(|window| window.end().wrapping_sub(now))
            .min()
    }
}
