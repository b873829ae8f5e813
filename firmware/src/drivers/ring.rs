//! A ring of stamped bytes between one interrupt and one task.
//!
//! *Purpose.* What a UART's handler stores, its task reads in place, and neither keeps the other waiting.
//!
//! *Design.* Two counts that run on: the handler moves `filled`, the task `drained`, each alone. The handler
//! writes only places that are drained, the task reads only places that are filled, so no place is
//! anybody's but one's, and no section is masked. `heapless::spsc` is the same and gives its bytes one by one,
//! which costs the task more than the search for frames.
//!
//! *Limits.* One core: what it sees of its own stores is their order.

use core::cell::UnsafeCell;
use core::sync::atomic::{
    AtomicU32,
    Ordering::{Acquire, Relaxed, Release},
};

use timebase::StampedByte;

/// The ring; `N` is a power of two.
pub struct Ring<const N: usize> {
    bytes: UnsafeCell<[StampedByte; N]>,
    /// Bytes that were ever stored.
    filled: AtomicU32,
    /// Bytes that were ever taken.
    drained: AtomicU32,
}

// SAFETY: as the module says: no place is written and read at once, if `push` has one caller and
// `drain` another.
unsafe impl<const N: usize> Sync for Ring<N> {}

impl<const N: usize> Ring<N> {
    const MASK: u32 = {
        assert!(N.is_power_of_two());
        N as u32 - 1
    };

    /// An empty one.
    pub const fn new() -> Self {
        Self {
            bytes: UnsafeCell::new(
                [StampedByte {
                    stamp: timebase::Stamp(0),
                    byte: 0,
                }; N],
            ),
            filled: AtomicU32::new(0),
            drained: AtomicU32::new(0),
        }
    }

    /// How many bytes wait.
    #[inline(always)]
    pub fn len(&self) -> usize {
        let drained = self.drained.load(Relaxed);
        self.filled.load(Relaxed).wrapping_sub(drained) as usize
    }

    /// Stores a byte; whether there was room.
    ///
    /// # Safety
    ///
    /// One caller, which does not interrupt itself.
    #[inline(always)]
    pub unsafe fn push(&self, byte: StampedByte) -> bool {
        let filled = self.filled.load(Relaxed);
        if filled.wrapping_sub(self.drained.load(Acquire)) as usize == N {
            return false;
        }
        let place = self.bytes.get().cast::<StampedByte>();
        // SAFETY: masked, the count is a place; it is drained, so nobody reads it.
        unsafe { place.add((filled & Self::MASK) as usize).write(byte) };
        self.filled.store(filled.wrapping_add(1), Release);
        true
    }

    /// Passes the bytes that are there now to `take`, in two pieces at most, and then drains them.
    ///
    /// # Safety
    ///
    /// One caller, other than that of [`Self::push`], which does not interrupt itself.
    #[inline(always)]
    pub unsafe fn drain(&self, mut take: impl FnMut(&[StampedByte])) {
        let drained = self.drained.load(Relaxed);
        let filled = self.filled.load(Acquire);
        let count = filled.wrapping_sub(drained) as usize;
        let begin = (drained & Self::MASK) as usize;
        let first = count.min(N - begin);
        let place = self.bytes.get().cast::<StampedByte>().cast_const();
        for (begin, len) in [(begin, first), (0, count - first)] {
            // SAFETY: both pieces lie in the ring and are filled, so that nobody writes there before
            // `drained` is moved.
            take(unsafe { core::slice::from_raw_parts(place.add(begin), len) });
        }
        self.drained.store(filled, Release);
    }
}
