//! An array that is indexed by position in the stream.

/// One value for each of the last `RING` positions.
#[derive(Debug)]
pub(super) struct Ring<T, const RING: usize>(pub(super) [T; RING]);

#[expect(
    clippy::indexing_slicing,
    reason = "a remainder by the length is below the length"
)]
impl<T, const RING: usize> Ring<T, RING> {
    #[inline]
    pub(super) const fn at(&self, position: u32) -> &T {
        &self.0[position as usize % RING]
    }

    #[inline]
    pub(super) const fn at_mut(&mut self, position: u32) -> &mut T {
        &mut self.0[position as usize % RING]
    }
}
