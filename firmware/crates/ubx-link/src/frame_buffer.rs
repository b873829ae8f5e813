//! Where a frame to the receiver is written.

use crate::fletcher::Fletcher;

/// The most bytes that are sent at once: [`Setting::Pulse`](crate::config::Setting::Pulse) by keys.
pub(crate) const LONGEST: usize = 84;

/// What a frame is written into.
pub(crate) type Buffer = [u8; LONGEST];

/// Writes the checksum of a whole frame to its end.
#[inline(never)]
pub(crate) fn sum(frame: &mut [u8]) {
    if let [_, _, summed @ .., a, b] = frame {
        let start = Fletcher::START;
        [*a, *b] = start.then_all(summed).since(start, summed.len());
    }
}

/// Puts `frame` into `buffer` from `at` on; the length of all of it, in bytes.
#[inline(never)]
pub(crate) fn put(buffer: &mut Buffer, at: usize, frame: &[u8]) -> usize {
    let end = at.wrapping_add(frame.len());
    if let Some(space) = buffer.get_mut(at..end) {
        space.copy_from_slice(frame);
    }
    end
}
