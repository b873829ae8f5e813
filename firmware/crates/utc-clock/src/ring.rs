//! The newest so many of a row of values.
//!
//! *Purpose.* The estimators' bounded memory.
//!
//! *Design.* An array and the place of the next value; the oldest makes room.
//!
//! *Limits.* Values come back in no particular order: none is needed here.

/// Up to `N` values.
#[derive(Clone, Debug)]
pub(crate) struct Ring<T, const N: usize> {
    values: [T; N],
    length: usize,
    next: usize,
}

impl<T: Copy, const N: usize> Ring<T, N> {
    /// Empty; `nothing` fills the places that no value has been put into.
    pub(crate) const fn new(nothing: T) -> Self {
        Self {
            values: [nothing; N],
            length: 0,
            next: 0,
        }
    }

    /// Puts `value` in, in the place of the oldest if there is no other.
    pub(crate) fn push(&mut self, value: T) {
        if let Some(place) = self.values.get_mut(self.next) {
            *place = value;
        }
        self.next = if self.next + 1 < N { self.next + 1 } else { 0 };
        self.length = (self.length + 1).min(N);
    }

    /// The values.
    pub(crate) fn values(&self) -> &[T] {
        self.values.get(..self.length).unwrap_or_default()
    }

    /// Forgets all of them.
    pub(crate) const fn clear(&mut self) {
        self.length = 0;
        self.next = 0;
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn the_newest_are_kept() {
        let mut ring = Ring::<u8, 3>::new(0);
        assert!(ring.values().is_empty());
        for value in 1..=7 {
            ring.push(value);
            let mut kept: Vec<u8> = ring.values().to_vec();
            kept.sort_unstable();
            let expected: Vec<u8> = (value.saturating_sub(2).max(1)..=value).collect();
            assert_eq!(kept, expected);
        }
        ring.clear();
        assert!(ring.values().is_empty());
    }
}
